"""Arrows between modules point one way, and heavy imports wait until they are needed."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

# A module may import those of a lower floor; on one floor only what is named beside.
SEECR = {
    "errors": 0, "shipped": 1, "pose": 1, "robot": 2,
    "joints": 3, "mjcf": 3, "setup": 3, "cable_law": 3,
    "effects": 4, "forces": 4, "kernel": 4, "path": 4,
    "statics": 5,
    "seed_methods": 6, "response": 6,
    "equilibrium": 7,
    "history": 8, "planar": 8, "workspace": 8,
    "experiment": 9,
    "sensitivity": 10,
}  # fmt: skip
# shared between the modules of one floor, or lazily of the one above
ALLOWED = {
    ("kernel", "forces"),
    ("setup", "cable_law"),
    ("equilibrium", "seed_methods"),
}


def modules(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def name_of(path: Path) -> str:
    parts = list(path.relative_to(ROOT).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports(path: Path) -> set[str]:
    """Every module that a file imports, also inside functions; not those for types alone."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    typing_only = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        for inner in ast.walk(node)
    }
    found: set[str] = set()
    for node in ast.walk(tree):
        if id(node) in typing_only:
            continue
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            assert node.module is not None
            found |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def uses(path: Path, package: str) -> bool:
    return any(name == package or name.startswith(f"{package}.") for name in imports(path))


def floor(module: str) -> tuple[str, int]:
    part = module.split(".")[1]
    return part, SEECR[part]


def test_seecr_knows_nothing_of_crosscheck() -> None:
    assert [name_of(p) for p in modules("seecr") if uses(p, "crosscheck")] == []
    assert any(uses(p, "seecr") for p in modules("crosscheck"))  # and the search does find


def test_mujoco_is_imported_in_one_place_of_seecr() -> None:
    assert [name_of(p) for p in modules("seecr") if uses(p, "mujoco")] == ["seecr.mjcf"]


def test_rerun_is_imported_by_recordings_alone() -> None:
    users = [name_of(p) for p in modules("crosscheck") + modules("seecr") if uses(p, "rerun")]
    assert all(name.startswith("crosscheck.recording") for name in users), users


def test_every_module_of_seecr_has_its_floor() -> None:
    parts = {name_of(p).split(".")[1] for p in modules("seecr") if name_of(p) != "seecr"}
    assert parts == set(SEECR)


def test_arrows_of_seecr_point_down() -> None:
    wrong = []
    for path in modules("seecr"):
        name = name_of(path)
        if name == "seecr":
            continue
        own, height = floor(name)
        for target in imports(path):
            if not target.startswith("seecr.") or target.split(".")[1] not in SEECR:
                continue
            other, theirs = floor(target)
            if other != own and theirs >= height and (own, other) not in ALLOWED:
                wrong.append(f"{name} imports {target}")
    assert wrong == []


def test_compiled_modules_import_numba_and_nobody_else_does() -> None:
    users = {name_of(p) for p in modules("seecr") + modules("crosscheck") if uses(p, "numba")}
    compiled = ("cable_law", "forces", "kernel", "history", "response")
    assert users <= {f"seecr.{name}" for name in compiled}
    assert {"seecr.cable_law", "seecr.kernel"} <= users


@pytest.mark.parametrize("module", ["seecr", "crosscheck", "crosscheck.cli", "seecr.robot"])
def test_importing_is_light(module: str) -> None:
    if module == "crosscheck.cli" and not (ROOT / "crosscheck" / "cli").exists():
        pytest.skip("crosscheck has no command line yet")
    heavy = ("numba", "mujoco", "rerun", "matplotlib", "pyarrow", "scipy")
    code = f"import sys, {module}; print(*[m for m in {heavy!r} if m in sys.modules])"
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert run.stdout.split() == []
