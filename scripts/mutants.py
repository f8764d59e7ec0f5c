"""Single faults in the functions of a source, and how one is planted into a running process."""

from __future__ import annotations

import ast
import builtins
import copy
import importlib
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "support")]
OTHER: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt, ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.And: ast.Or,
    ast.Or: ast.And, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd,
}  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """A file whose node ``index`` (in the order of ast.walk) is changed, in a function of it."""

    path: Path
    index: int
    line: int
    function: str
    text: str

    def __str__(self) -> str:
        return f"{self.path.relative_to(ROOT)}:{self.line} {self.text}"

    @property
    def key(self) -> str:
        """The function, as the files of tests that run it name it."""
        return f"{self.path}:{self.function}"

    def plant(self) -> bool:
        """Put the fault into this process; False if the function can no longer be reached."""
        return bool(_plant(self.path, lambda tree: _change(list(ast.walk(tree))[self.index])))


def note_calls(path: Path, calls: set[str]) -> None:
    """From now on each function of a file adds its ``key`` to calls when it is called."""
    vars(builtins)["note_call"] = calls.add

    def change(tree: ast.Module) -> None:
        for name, function in _functions(tree):
            function.body[:0] = ast.parse(f"note_call({f'{path}:{name}'!r})").body

    _plant(path, change)


def _plant(path: Path, change: Callable[[ast.Module], object]) -> list[str]:
    """Change the functions of a file in this process; says which of them."""
    from planted import plant_code

    module = importlib.import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))
    tree = ast.parse(path.read_text())
    before = compile(tree, path, "exec")
    change(tree)
    after = compile(ast.fix_missing_locations(tree), path, "exec")
    return plant_code(pytest.MonkeyPatch(), module, before, after)


def _change(node: ast.AST) -> bool:
    """Change a node in place; False if it is of no kind that is changed."""
    if isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in OTHER:
        node.ops = [OTHER[type(node.ops[0])]()]  # type: ignore[list-item]
    elif isinstance(node, ast.BinOp | ast.BoolOp | ast.AugAssign) and type(node.op) in OTHER:
        node.op = OTHER[type(node.op)]()  # type: ignore[assignment]
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        node.value = not node.value
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        whole = isinstance(node.value, int)
        node.value = node.value + 1 if whole else node.value * 2.0 or 1.0
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not | ast.Invert):
        node.op = ast.UAdd() if isinstance(node.op, ast.USub) else node.op
        if not isinstance(node.op, ast.UAdd):
            node.operand = ast.UnaryOp(node.op, node.operand)
    elif isinstance(node, ast.Return) and isinstance(node.value, ast.Name | ast.Call):
        node.value = ast.Constant(None)
    else:
        return False
    return True


def mutants(path: Path) -> Iterator[Mutant]:
    """All single faults of a file that lie in functions, where calls can see them."""
    tree = ast.parse(path.read_text())
    inside = {id(node): name for name, function in _functions(tree) for node in _body(function)}
    for index, node in enumerate(ast.walk(tree)):
        if id(node) in inside and _change(other := copy.deepcopy(node)):
            text = f"`{ast.unparse(node)}` -> `{ast.unparse(other)}`".replace("\n", " ")
            yield Mutant(path, index, getattr(node, "lineno", 0), inside[id(node)], text)


def _functions(node: ast.AST, place: str = "") -> Iterator[tuple[str, ast.FunctionDef]]:
    """Functions and methods, not those within others."""
    for part in ast.iter_child_nodes(node):
        if isinstance(part, ast.FunctionDef):
            yield place + part.name, part
        else:
            inner = f"{place}{part.name}." if isinstance(part, ast.ClassDef) else place
            yield from _functions(part, inner)


def _body(node: ast.AST) -> Iterator[ast.AST]:
    """All nodes of a function's body but those that no result depends on.

    They are annotations, and ``strict=True`` of ``zip``, which says that lengths are equal.
    """
    for name, value in ast.iter_fields(node):
        outer = isinstance(node, ast.FunctionDef) and name in ("decorator_list", "args")
        checks = isinstance(node, ast.keyword) and node.arg == "strict"
        for part in value if isinstance(value, list) else [value]:
            counts = name not in ("annotation", "returns") and not (outer or checks)
            if isinstance(part, ast.AST) and counts:
                yield part
                yield from _body(part)
