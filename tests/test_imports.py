"""Imports point one way, and heavy ones wait until they are needed.

The floors of both packages are one table, read from the lowest floor up and from left to right: a
room, a folder or file, may import what stands before it. The same holds within a folder that has
folders of its own. Imports inside functions count; those for types alone do not.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

import pytest
from sources import ROOT, imports, imports_of, modules, name_of, tree_of

# The rooms, folders or files, floor by floor from the lowest up.
TABLE = (
    "seecr: errors lazy counted parallel compiled",
    "seecr: files pose arguments curves result units",
    "seecr: description commands columns",
    "seecr: effects statics prediction",
    "seecr: tensions equilibrium inverse workspace exported",
    "seecr: show cli",
    "crosscheck: errors given",
    "crosscheck: settle model measurements twin",
    "crosscheck: fit suite importing inference preparation",
    "crosscheck: comparison planning",
    "crosscheck: calibration add diagnosis",
    "crosscheck: show cli",
)
# The rooms of a folder that has folders of its own.
INNER_TABLE = ("crosscheck.fit: reasons least_squares words noise effects",)


def rooms_of(floor: str) -> list[str]:
    package, _, names = floor.partition(": ")
    return [f"{package}.{name}" for name in names.split()]


def order_of(table: Iterable[str]) -> dict[str, int]:
    """Rooms, each with its number in reading order."""
    return {room: k for k, room in enumerate(room for line in table for room in rooms_of(line))}


FLOORS = {room: floor for floor, line in enumerate(TABLE) for room in rooms_of(line)}
ORDER, INNER_ORDER = order_of(TABLE), order_of(INNER_TABLE)

# Packages, whose faces stand on all floors: through them anything could import anything.
FACES = ("seecr", "crosscheck")
# What is no face's alone: the version, which a package has before it imports anything.
PLAIN = {f"{face}.__version__" for face in FACES}

# What stands against the floors today; each is to go, none is to come.
KNOWN: set[tuple[str, str]] = set()


def place(module: str, depth: int = 2) -> str:
    """The folder or file that a module belongs to, "" for a package's own face.

    Args:
        module: its name. depth: 3 for the folder or file within a folder, then "" also for
            the outer one's own face.
    """
    parts = module.replace("__main__", "cli").split(".")  # it is how cli is called
    return ".".join(parts[:depth]) if len(parts) >= depth else ""


def upward(
    name: str, targets: Iterable[str], order: Mapping[str, int] = ORDER, depth: int = 2
) -> set[tuple[str, str]]:
    """Imports of a module that do not point to rooms before its own."""
    own = place(name, depth)
    some = {place(target, depth) for target in targets} - {own}
    if own not in order:
        return set()
    return {(own, other) for other in some if order.get(other, -1) >= order[own]}


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
            found |= names - set(FLOORS) - PLAIN
    return found


def uses(path: Path, package: str) -> bool:
    return any(name == package or name.startswith(f"{package}.") for name in imports(path))


def test_every_folder_and_file_has_its_floor() -> None:
    found = {place(name_of(p)) for package in ("seecr", "crosscheck") for p in modules(package)}
    assert found - {""} == set(FLOORS)


def test_no_import_points_upwards() -> None:
    wrong = set()
    for package in ("seecr", "crosscheck"):
        for path in modules(package):
            wrong |= upward(name_of(path), imports(path))
    assert wrong == KNOWN


def test_an_upward_import_is_seen_also_a_lazy_one() -> None:
    lazy = "def late():\n    from crosscheck.cli import main\n    return main\n"
    assert upward("crosscheck.fit.words", imports_of(ast.parse(lazy))) == {
        ("crosscheck.fit", "crosscheck.cli")
    }
    assert upward("seecr.pose", imports_of(ast.parse("import crosscheck.fit.words"))) == {
        ("seecr.pose", "crosscheck.fit")
    }
    only_types = f"if TYPE_CHECKING:\n{lazy.replace('def late():', '    pass').split('return')[0]}"
    assert upward("crosscheck.fit.words", imports_of(ast.parse(only_types))) == set()


def test_every_inner_folder_and_file_has_its_floor() -> None:
    folders = {place(inner).replace(".", "/") for inner in INNER_ORDER}
    names = {name_of(path) for folder in folders for path in modules(folder)}
    assert {place(name, 3) for name in names} - {""} == set(INNER_ORDER)


def test_no_import_points_upwards_within_a_folder() -> None:
    folders = {place(inner).replace(".", "/") for inner in INNER_ORDER}
    files = [path for folder in folders for path in modules(folder)]
    wrong = [upward(name_of(path), imports(path), INNER_ORDER, 3) for path in files]
    assert set().union(*wrong) == set()


def test_an_upward_import_within_a_folder_is_seen() -> None:
    lazy = "def late():\n    from crosscheck.fit.effects.nothing import is_nothing\n"
    taken = imports_of(ast.parse(lazy))
    seen = {("crosscheck.fit.noise", "crosscheck.fit.effects")}
    assert upward("crosscheck.fit.noise.smooth", taken, INNER_ORDER, 3) == seen
    assert upward("crosscheck.fit.effects.possible", taken, INNER_ORDER, 3) == set()
    assert upward("crosscheck.preparation.freed", taken, INNER_ORDER, 3) == set()


def test_only_commands_use_the_faces() -> None:
    taken = {
        name_of(path): through_faces(tree_of(path))
        for face in FACES
        for path in modules(face)
        if place(name_of(path)) != f"{face}.cli"
    }
    assert {name: found for name, found in taken.items() if found} == {}


@pytest.mark.parametrize(
    ("source", "taken"),
    [
        ("def late():\n    import crosscheck\n    crosscheck.compare('r', 'm')", "crosscheck"),
        ("def late():\n    import seecr\n    seecr.solve(robot, poses)", "seecr"),
        ("import seecr.pose", "seecr.pose"),
        ("from crosscheck import compare", "crosscheck.compare"),
    ],
)
def test_an_import_through_a_face_is_seen(source: str, taken: str) -> None:
    assert through_faces(ast.parse(source)) == {taken}
    assert through_faces(ast.parse("from seecr import __version__, statics")) == set()


def test_nothing_of_crosscheck_is_in_seecr() -> None:
    assert [name_of(path) for path in modules("seecr") if uses(path, "crosscheck")] == []


def test_modules_are_imported_by_name() -> None:
    """Where the name is computed nobody can hold it against a floor: in two places alone."""
    users = [name_of(p) for f in FACES for p in modules(f) if uses(p, "importlib.import_module")]
    assert users == ["seecr.cli.group", "seecr.lazy"]


def test_no_two_modules_import_each_other() -> None:
    """Not even by way of others; types aside. A package's face, which is lazy, does not count."""
    files = {name_of(p): p for package in ("seecr", "crosscheck") for p in modules(package)}
    files = {name: path for name, path in files.items() if path.stem != "__init__"}
    arrows = {name: (imports(path) & set(files)) - {name} for name, path in files.items()}
    while True:
        leaves = {name for name, targets in arrows.items() if not targets & set(arrows)}
        if not leaves:
            break
        arrows = {name: targets for name, targets in arrows.items() if name not in leaves}
    assert sorted(arrows) == []


def test_no_two_classes_have_one_name() -> None:
    names = [
        node.name
        for package in ("seecr", "crosscheck")
        for path in modules(package)
        for node in tree_of(path).body
        if isinstance(node, ast.ClassDef)
    ]
    assert sorted({name for name in names if names.count(name) > 1}) == []


# A command line has one of each module; compiled functions are called by those of the same name.
ON_PURPOSE = {"command", "main"}


@pytest.mark.parametrize("package", ["seecr", "crosscheck"])
def test_no_two_public_functions_of_a_package_have_one_name(package: str) -> None:
    """``explained`` was a diagnosis in one module and a number in another."""
    names = [
        node.name
        for path in modules(package)
        if "compiled" not in path.parts
        for node in tree_of(path).body
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_")
    ]
    assert sorted({n for n in names if names.count(n) > 1} - ON_PURPOSE) == []


# The two physics are worth comparing because they share the description of the robot alone.
DESCRIPTION = {
    "seecr.errors",
    "seecr.result",
    "seecr.pose",
    "seecr.description.robot",
    "seecr.description.mjcf",
    "seecr.effects",
}


# Beside it: what winches are told, how things are counted, that numbers are numbers, and files.
BESIDE = {"seecr.commands", "seecr.counted", "seecr.arguments", "seecr.files"}
# What the effects edit, and the path through commands, are SEECR's side of them.
PHYSICS = {
    "seecr.effects.setup", "seecr.effects.edits",
    "seecr.commands.Path", "seecr.commands.waypoints_of", "seecr.commands.turning",
}  # fmt: skip
# A trajectory is poses that the robot's joints can reach: what is commanded, no physics.
OF_ITS_OWN = {"crosscheck.twin.lab": {"seecr.description.joints"}}


def physics_taken(name: str, targets: Iterable[str]) -> set[str]:
    """What a module of MuJoCo's side takes of seecr beyond the description of the robot."""
    allowed = DESCRIPTION | BESIDE | OF_ITS_OWN.get(name, set())
    taken = {target for target in targets if target.split(".")[0] == "seecr"}
    return {t for t in taken if not within(t, allowed) or within(t, PHYSICS)}


def within(module: str, some: Iterable[str]) -> bool:
    """Whether a module, or what is taken of it, is one of some or in one of their folders."""
    return any(module == one or module.startswith(f"{one}.") for one in some)


@pytest.mark.parametrize("folder", ["settle", "twin"])
def test_mujocos_side_takes_the_description_of_seecr_alone(folder: str) -> None:
    files = modules(f"crosscheck/{folder}")
    taken = {name_of(path): physics_taken(name_of(path), imports(path)) for path in files}
    assert {name: found for name, found in taken.items() if found} == {}
    text = "".join(path.read_text(encoding="utf-8") for path in files)
    assert "edit_setup" not in text and "edit_readings" not in text


@pytest.mark.parametrize(
    ("module", "source", "taken"),
    [
        ("crosscheck.settle.newton", "def late():\n    import seecr\n    seecr.solve()", "seecr"),
        (
            "crosscheck.twin.lab",
            "from seecr.equilibrium.solving import solve",
            "seecr.equilibrium.solving seecr.equilibrium.solving.solve",
        ),
        ("crosscheck.twin.lab", "from seecr.description.joints import motion_columns", ""),
        (
            "crosscheck.twin.measure",
            "from seecr.commands import Commands, waypoints_of",
            "seecr.commands.waypoints_of",
        ),
        (
            "crosscheck.twin.robot",
            "from seecr.effects import Term\nfrom seecr.effects.setup import Setup",
            "seecr.effects.setup seecr.effects.setup.Setup",
        ),
        (
            "crosscheck.twin.world",
            "from seecr.description.joints import motion_columns",
            "seecr.description.joints seecr.description.joints.motion_columns",
        ),
    ],
)
def test_physics_of_seecr_on_mujocos_side_is_seen(module: str, source: str, taken: str) -> None:
    assert physics_taken(module, imports_of(ast.parse(source))) == set(taken.split())


def test_mujoco_is_imported_in_one_place_of_seecr() -> None:
    assert [name_of(p) for p in modules("seecr") if uses(p, "mujoco")] == ["seecr.description.mjcf"]


def test_rerun_is_imported_by_recordings_alone() -> None:
    users = [name_of(p) for p in modules("crosscheck") + modules("seecr") if uses(p, "rerun")]
    recordings = {
        "crosscheck.show": ("case_recording", "error_recordings", "misfit"),
        "seecr.show": (
            "layout", "map_recording", "plots", "scene", "stream", "sweep_recording",
        ),
    }  # fmt: skip
    assert users == [f"{folder}.{name}" for folder, names in recordings.items() for name in names]


def test_compiled_modules_import_numba_and_nobody_else_does() -> None:
    users = [name_of(p) for p in modules("seecr") + modules("crosscheck") if uses(p, "numba")]
    assert users == ["seecr.compiled.jit"]


@pytest.mark.slow
@pytest.mark.parametrize("package", ["seecr", "crosscheck"])
def test_a_package_runs_as_its_command(package: str) -> None:
    run = subprocess.run(
        [sys.executable, "-m", package, "--help"], capture_output=True, text=True, cwd=ROOT
    )
    assert run.returncode == 0 and run.stdout.startswith(f"Usage: {package} [OPTIONS]")


def test_what_is_compiled_takes_arrays_alone() -> None:
    # what tells a user that compiling takes long is beside what is compiled
    files = [path for path in modules("seecr/compiled") if path.stem != "compile_notice"]
    taken = {t for path in files for t in imports(path)}
    assert {t.split(".")[0] for t in taken} == {"__future__", "math", "numba", "numpy", "seecr"}
    assert {place(t) for t in taken if t.startswith("seecr")} == {"seecr.compiled"}


HEAVY_SCIPY = ("scipy.stats", "scipy.signal")


@pytest.mark.parametrize(
    "module", ["seecr", "crosscheck", "crosscheck.cli", "seecr.cli", "seecr.description.robot"]
)
def test_importing_is_light(module: str) -> None:
    heavy = ("numba", "mujoco", "rerun", "matplotlib", "pyarrow", "scipy")
    code = f"import sys, {module}; print(*[m for m in {heavy!r} if m in sys.modules])"
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert run.stdout.split() == []


@pytest.mark.parametrize("module", ["crosscheck.comparison", "crosscheck.diagnosis.diagnose"])
def test_what_few_data_need_waits_for_them(module: str) -> None:
    """``scipy.stats`` and ``scipy.signal`` take most of a second to import."""
    code = f"import sys, {module}; print(*[m for m in sys.modules if m in {HEAVY_SCIPY!r}])"
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert run.stdout.split() == []
