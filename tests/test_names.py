"""Names that say one thing: no module hides what its package gives, no two things share one."""

from __future__ import annotations

import ast
from importlib import import_module

from sources import modules, name_of, tree_of

import crosscheck
import seecr

FACES = ("seecr", "crosscheck")
# A command line has one of each module; compiled functions are called by those of the same name.
ON_PURPOSE = {"command", "main"}


def defined_twice(kind: type[ast.AST], *packages: str, compiled: bool = True) -> set[str]:
    names = [
        node.name
        for package in packages
        for path in modules(package)
        if compiled or "compiled" not in path.parts
        for node in tree_of(path).body
        if isinstance(node, kind)
    ]
    return {name for name in names if names.count(name) > 1 and not name.startswith("_")}


def test_no_two_definitions_share_a_name() -> None:
    """``explained`` was a diagnosis in one module and a number in another."""
    assert defined_twice(ast.ClassDef, *FACES) == set()
    for face in FACES:
        assert defined_twice(ast.FunctionDef, face, compiled=False) <= ON_PURPOSE
    public = {*seecr.__all__, *crosscheck.__all__}
    assert defined_twice(ast.FunctionDef, *FACES) & public == set()


def test_no_module_has_the_name_of_what_its_package_gives() -> None:
    """Importing it would put the module in the place of the function."""
    hidden = [
        f"{name_of(path)}.{name}"
        for face in FACES
        for path in modules(face)
        if path.stem == "__init__"
        for name in getattr(import_module(name_of(path)), "__all__", ())
        if path.with_name(f"{name}.py").exists() or path.with_name(name).is_dir()
    ]
    assert hidden == []
