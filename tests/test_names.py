"""Names that say one thing: no module hides what its package gives, no two functions are one."""

from __future__ import annotations

import ast
import re
from importlib import import_module

from sources import ROOT, modules, name_of, tree_of

import crosscheck
import seecr

EVERY = [path for package in ("seecr", "crosscheck") for path in modules(package)]


def test_no_module_has_the_name_of_what_its_package_gives() -> None:
    """Importing it would put the module in the place of the function."""
    hidden = [
        f"{name_of(path)}.{name}"
        for path in EVERY
        if path.stem == "__init__"
        for name in getattr(import_module(name_of(path)), "__all__", ())
        if path.with_name(f"{name}.py").exists() or path.with_name(name).is_dir()
    ]
    assert hidden == []


def test_no_other_function_has_the_name_of_a_public_one() -> None:
    public = {*seecr.__all__, *crosscheck.__all__}
    names = [
        node.name
        for path in EVERY
        for node in tree_of(path).body
        if isinstance(node, ast.FunctionDef) and node.name in public
    ]
    assert sorted({name for name in names if names.count(name) > 1}) == []


def test_what_each_has_is_told_as_per() -> None:
    folders = ("seecr", "crosscheck", "docs", "scripts", "models")
    files = [p for f in folders for kind in ("py", "md") for p in (ROOT / f).rglob(f"*.{kind}")]
    odd = re.compile(r"(?:\bone|\b[mµ]?s|\bor so|z|chi2|\bothers) a (?:pose|cable|row|reading)\b")
    found = {p.name: odd.findall(p.read_text(encoding="utf-8")) for p in files}
    assert {name: words for name, words in found.items() if words} == {}
