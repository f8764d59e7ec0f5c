"""Imports point one way, and heavy ones wait until they are needed.

The floors of both packages are one table, read from the lowest floor up and from left to right: a
room, a folder or file, may import what stands before it. The same holds within a folder whose
files stand in an order. Imports inside functions count; those for types alone do not.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import pytest
from sources import ROOT, imports, imports_of, modules, name_of, tree_of

# The rooms, folders or files, floor by floor from the lowest up.
TABLE = (
    "seecr: errors lazy version counted parallel compiled",
    "seecr: files folders pose arguments result units parts",
    "seecr: description commands columns importing",
    "seecr: effects statics prediction",
    "seecr: tensions equilibrium inverse workspace exported controlled",
    "seecr: show cli",
    "crosscheck: errors given",
    "crosscheck: settle model measurements twin",
    "crosscheck: fit controlled suite importing inference preparation",
    "crosscheck: comparison planning",
    "crosscheck: calibration add diagnosis studies",
    "crosscheck: show cli",
)
# The rooms of a folder whose files stand in an order.
INNER_TABLE = (
    "crosscheck.fit: reasons algebra problem length_errors state words",
    "crosscheck.fit: registration residual_noise",
)

# Packages, whose faces stand on all floors: through them anything could import anything.
FACES = ("seecr", "crosscheck")
EVERY = [path for face in FACES for path in modules(face)]


def rooms_of(floor: str) -> list[str]:
    package, _, names = floor.partition(": ")
    return [f"{package}.{name}" for name in names.split()]


# Rooms in their order, by how many names say which: in a package, and in a folder of it.
ORDERS = {
    depth: [room for floor in table for room in rooms_of(floor)]
    for depth, table in ((2, TABLE), (3, INNER_TABLE))
}


def place(module: str, depth: int = 2) -> str:
    """The room of a module, "" for the face of its package, or with depth 3 of its folder."""
    parts = module.replace("__main__", "cli").split(".")  # it is how cli is called
    return ".".join(parts[:depth]) if len(parts) >= depth else ""


def upward(name: str, targets: Iterable[str], depth: int = 2) -> set[tuple[str, str]]:
    """Imports of a module that do not point to rooms before its own."""
    order, own = ORDERS[depth], place(name, depth)
    after = order[order.index(own) + 1 :] if own in order else []
    return {(own, place(target, depth)) for target in targets if place(target, depth) in after}


def within(module: str, some: Iterable[str]) -> bool:
    """Whether a module, or what is taken of it, is one of some or in one of their folders."""
    return any(module == one or module.startswith(f"{one}.") for one in some)


def through_faces(tree: ast.Module) -> set[str]:
    """What a source takes of a package's face instead of a module's own names.

    ``import seecr.pose`` too: the name that it binds is ``seecr``, and that has all of it.
    """
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names if alias.name.split(".")[0] in FACES}
        elif isinstance(node, ast.ImportFrom) and node.module in FACES:
            names = {f"{node.module}.{alias.name}" for alias in node.names}
            # the version is there before a package imports anything
            found |= names - set(ORDERS[2]) - {f"{node.module}.__version__"}
    return found


def uses(path: Path, package: str) -> bool:
    return any(within(name, [package]) for name in imports(path))


@pytest.mark.parametrize("depth", ORDERS)
def test_every_room_has_its_floor(depth: int) -> None:
    folders = FACES if depth == 2 else {place(room) for room in ORDERS[3]}
    found = {place(name_of(path), depth) for path in EVERY if within(name_of(path), folders)}
    assert found - {""} == set(ORDERS[depth])


@pytest.mark.parametrize("depth", ORDERS)
def test_no_import_points_upwards(depth: int) -> None:
    assert set().union(*(upward(name_of(path), imports(path), depth) for path in EVERY)) == set()


def test_only_commands_use_the_faces() -> None:
    others = [path for path in EVERY if not place(name_of(path)).endswith(".cli")]
    assert {name_of(p): taken for p in others if (taken := through_faces(tree_of(p)))} == {}


def test_no_two_modules_import_each_other() -> None:
    """Not even by way of others; types aside. A package's face, which is lazy, does not count."""
    files = {name_of(path): path for path in EVERY if path.stem != "__init__"}
    arrows = {name: (imports(path) & set(files)) - {name} for name, path in files.items()}
    while leaves := {name for name, targets in arrows.items() if not targets & set(arrows)}:
        arrows = {name: targets for name, targets in arrows.items() if name not in leaves}
    assert sorted(arrows) == []


# Those who import a package: MuJoCo in one place of seecr, and crosscheck in none. Where the name
# of a module is computed nobody can hold it against a floor.
USERS = {
    "seecr crosscheck": "",
    "seecr mujoco": "seecr.description: mjcf",
    "seecr numba": "seecr.compiled: jit",
    "seecr llvmlite": "seecr.compiled: jit",
    "crosscheck numba": "",
    "seecr importlib.import_module": "seecr: cli.group lazy",
    "crosscheck importlib.import_module": "",
    "seecr rerun": ("seecr.show: layout map_recording plots scene stream sweep_recording"),
    "crosscheck rerun": ("crosscheck.show: case_recording error_recordings"),
}


@pytest.mark.parametrize("who", USERS)
def test_a_package_is_imported_in_its_places_alone(who: str) -> None:
    face, package = who.split()
    assert [name_of(path) for path in modules(face) if uses(path, package)] == rooms_of(USERS[who])


# The two physics are worth comparing because they share the description of the robot alone, and
# beside it what winches are told, how things are counted, that numbers are numbers, and files.
SHARED = rooms_of(
    "seecr: errors result pose description.robot description.mjcf description.mjcf_text "
    "description.passive effects commands counted arguments files folders"
)
# What the effects edit, and the path through commands, are SEECR's side of them.
PHYSICS = rooms_of(
    "seecr: effects.setup effects.edits commands.Path commands.waypoints_of commands.turning"
)
# A trajectory is poses that the robot's joints can reach: what is commanded, no physics.
# Of an effect of a user's own nobody has written the mathematics a second time.
OF_ITS_OWN = {
    "crosscheck.twin.lab": ["seecr.description.joints", "seecr.prediction.experiment"],
}


def physics_taken(name: str, targets: Iterable[str]) -> set[str]:
    """What a module of MuJoCo's side takes of seecr beyond the description of the robot."""
    allowed = SHARED + OF_ITS_OWN.get(name, [])
    taken = {target for target in targets if within(target, ["seecr"])}
    return {t for t in taken if not within(t, allowed) or within(t, PHYSICS)}


def test_mujocos_side_takes_the_description_of_seecr_alone() -> None:
    files = [path for folder in ("settle", "twin") for path in modules(f"crosscheck/{folder}")]
    taken = {name_of(path): physics_taken(name_of(path), imports(path)) for path in files}
    assert {name: found for name, found in taken.items() if found} == {}
    text = "".join(path.read_text(encoding="utf-8") for path in files)
    assert "edit_setup" not in text and "edit_readings" not in text


def test_the_checks_see_what_they_are_for() -> None:
    def seen(source: str, head: str = "def late()") -> set[str]:
        return imports_of(ast.parse(f"{head}:\n    {source}"))

    climbs = "from crosscheck.cli import main"
    assert upward("crosscheck.fit.words", seen(climbs)) == {("crosscheck.fit", "crosscheck.cli")}
    assert upward("crosscheck.fit.words", seen(climbs, "if TYPE_CHECKING")) == set()
    assert upward("seecr.pose", seen("import crosscheck.fit")) == {("seecr.pose", "crosscheck.fit")}
    first, *_, last = ORDERS[3]
    assert upward(f"{first}.inside", seen(f"import {last}.inside"), 3) == {(first, last)}
    assert upward(last, seen(f"import {first}, {last}"), 3) == set()
    assert upward("crosscheck.preparation.freed", seen(f"import {last}"), 3) == set()

    for source in ("import crosscheck", "import seecr.pose", "from crosscheck import compare"):
        assert through_faces(ast.parse(f"def late():\n    {source}")) != set()
    assert through_faces(ast.parse("from seecr import __version__, statics")) == set()

    joints, solve = "import seecr.description.joints", "import seecr.equilibrium.solving"
    assert physics_taken("crosscheck.twin.lab", seen(joints)) == set()
    for module, source in (
        ("twin.world", joints),
        ("twin.lab", solve),
        ("twin.measure", "from seecr.commands import Commands, waypoints_of"),
        ("twin.robot", "from seecr.effects.setup import Setup"),
        ("settle.newton", "import seecr"),
    ):
        assert physics_taken(f"crosscheck.{module}", seen(source)) != set()


def test_what_is_compiled_takes_arrays_alone() -> None:
    # what tells a user that compiling takes long is beside what is compiled
    files = [path for path in modules("seecr/compiled") if path.stem != "compile_notice"]
    taken = {t for path in files for t in imports(path)}
    others = {"__future__", "collections", "contextlib", "typing"}
    others |= {"hashlib", "llvmlite", "math", "numba", "numpy", "pathlib"}
    assert {t.split(".")[0] for t in taken} == {*others, "seecr"}
    assert {place(t) for t in taken if t.startswith("seecr")} == {"seecr.compiled"}


@pytest.mark.slow
@pytest.mark.parametrize("package", FACES)
def test_a_package_runs_as_its_command(package: str) -> None:
    run = subprocess.run(
        [sys.executable, "-m", package, "--help"], capture_output=True, text=True, cwd=ROOT
    )
    assert run.returncode == 0 and run.stdout.startswith(f"Usage: {package} [OPTIONS]")


@pytest.mark.parametrize(
    ("imported", "heavy"),
    [
        ("seecr, crosscheck, crosscheck.cli, seecr.cli, seecr.description.robot",
         "numba mujoco rerun matplotlib pyarrow scipy"),
        # what few data need takes most of a second
        ("crosscheck.comparison.residuals, crosscheck.diagnosis.diagnose",
         "scipy.stats scipy.signal"),
    ],
)  # fmt: skip
def test_importing_is_light(imported: str, heavy: str) -> None:
    code = f"import sys, {imported}; print(*(sys.modules.keys() & {heavy.split()}))"
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert run.stdout.split() == []
