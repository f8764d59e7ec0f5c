"""Plant one fault at a time in a copy of the sources, and see whether tests of its folder fail.

    python scripts/mutate.py seecr/statics crosscheck/comparison --each 8 --seed 1

Each fault (a mutant) changes a comparison, the sign of an operation, a constant, a condition or a
returned value. A mutant is killed if the tests of the mirrored folder, without slow ones, fail or
take longer than the limit; one that survives is either equivalent to the source, or shows what no
test holds.
"""

from __future__ import annotations

import argparse
import ast
import copy
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# What a copy needs; compiled functions are kept, since copies keep the times of their sources.
COPIED = ("seecr", "crosscheck", "models", "docs", "tests", "scripts", "pyproject.toml")
OTHER: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt, ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.And: ast.Or,
    ast.Or: ast.And, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd,
}  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """A file whose node ``index`` (in the order of ast.walk) is changed."""

    path: Path
    index: int
    line: int
    text: str

    def source(self) -> str:
        """The whole file with the fault in it."""
        tree = ast.parse(self.path.read_text())
        _change(list(ast.walk(tree))[self.index])
        return ast.unparse(tree)


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
    inside = {id(n) for f in ast.walk(tree) if isinstance(f, ast.FunctionDef) for n in _body(f)}
    for index, node in enumerate(ast.walk(tree)):
        if id(node) in inside and _change(other := copy.deepcopy(node)):
            text = f"`{ast.unparse(node)}` -> `{ast.unparse(other)}`"
            yield Mutant(path, index, getattr(node, "lineno", 0), text.replace("\n", " "))


def _body(function: ast.FunctionDef) -> Iterator[ast.AST]:
    for statement in function.body:
        yield from ast.walk(statement)


def survives(mutant: Mutant, tree: Path, tests: str, seconds: float) -> bool:
    """Whether the tests pass with the fault in ``tree``, a copy of the sources."""
    target = tree / mutant.path.relative_to(ROOT)
    whole = mutant.path.read_text()
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "-m", "not slow", tests]
    inside = {**os.environ, "PYTHONPATH": str(tree)}  # commands that tests start are to see it too
    try:
        target.write_text(mutant.source())
        done = subprocess.run(
            [*command, "-p", "no:cacheprovider"],
            cwd=tree, env=inside, capture_output=True, timeout=seconds,
        )  # fmt: skip
        return done.returncode == 0
    except subprocess.TimeoutExpired:
        return False
    finally:
        target.write_text(whole)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="+", help="folders or files of sources")
    parser.add_argument("--each", type=int, default=8, help="mutants of each, drawn at random")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--tests", help="what to run; the mirrored folder of tests by default")
    parser.add_argument("--timeout", type=float, default=300.0, help="seconds for each [s]")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder)
        for name in COPIED:
            source, target = ROOT / name, tree / name
            (shutil.copytree if source.is_dir() else shutil.copy2)(source, target)
        for name in args.folders:
            place = (ROOT / name).resolve()
            files = sorted(place.glob("*.py")) if place.is_dir() else [place]
            every = [mutant for path in files for mutant in mutants(path)]
            drawn = random.Random(args.seed).sample(every, min(args.each, len(every)))
            tests = args.tests or f"tests/{place.relative_to(ROOT).with_suffix('')}"
            left = 0
            for mutant in drawn:
                alive = survives(mutant, tree, tests, args.timeout)
                left += alive
                where = f"{mutant.path.relative_to(ROOT)}:{mutant.line}"
                print("SURVIVED" if alive else "killed  ", where, mutant.text, flush=True)
            print(f"{name}: {len(drawn) - left} of {len(drawn)} killed", flush=True)


if __name__ == "__main__":
    main()
