"""What `import seecr` and `import crosscheck` give: documented names that nothing hides.

Commands are built of those names, of what shows results, and of a few names of their own trade.
"""

from __future__ import annotations

import ast
import inspect
import re
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest
from sources import modules, name_of, tree_of

import crosscheck
import seecr
from seecr.result import Result

ROOT = Path(__file__).resolve().parents[1]
FACES = [seecr, crosscheck]
COMMANDS = [p for face in ("seecr", "crosscheck") for p in modules(face) if p.parent.name == "cli"]
# What functions take and others give, and effects, which are everybody's own classes.
NO_RESULTS = {
    seecr.Robot, seecr.Effect, seecr.Commands, crosscheck.Case, crosscheck.Limits,
    crosscheck.Thresholds,
}  # fmt: skip
# What results hold of more of their kind.
PARTS = {crosscheck.CaseResult, crosscheck.MissingEffect, seecr.Jump}


def repr_of(value: object) -> str:
    return type(value).__name__


def returned() -> set[type]:
    """The classes of which the faces' functions return one, or several."""
    found = set()
    for face in FACES:
        functions = [getattr(face, n) for n in face.__all__ if callable(getattr(face, n))]
        for function in filter(inspect.isfunction, functions):
            words = re.findall(r"\w+", str(inspect.signature(function).return_annotation))
            found |= {getattr(face, word) for word in words if word in face.__all__}
    return {one for one in found if inspect.isclass(one)}


RESULTS = sorted((returned() | PARTS) - NO_RESULTS, key=lambda one: one.__name__)


@pytest.mark.parametrize("face", FACES, ids=lambda face: face.__name__)
def test_every_public_name_is_there_and_documented(face: ModuleType) -> None:
    assert face.__all__ == sorted(face.__all__)
    for name in face.__all__:
        found = getattr(face, name)
        assert inspect.getdoc(found), name
        if inspect.isfunction(found) and len(inspect.signature(found).parameters) > 2:
            assert "Args:" in str(found.__doc__), name
    with pytest.raises(AttributeError, match=r"has no attribute 'nothing'"):
        face.nothing  # noqa: B018


@pytest.mark.parametrize("face", FACES, ids=lambda face: face.__name__)
def test_help_shows_defaults_that_people_can_read(face: ModuleType) -> None:
    functions = filter(inspect.isfunction, (getattr(face, name) for name in face.__all__))
    assert [one.__name__ for one in functions if " at 0x" in str(inspect.signature(one))] == []


@pytest.mark.parametrize("face", FACES, ids=lambda face: face.__name__)
def test_a_shell_completes_public_names_before_their_first_use(face: ModuleType) -> None:
    shown = {name for name in dir(face) if not name.startswith("__")}
    assert shown == {*face.__all__, *(("inverse", "workspace") if face is seecr else ())}


def test_both_packages_say_their_version() -> None:
    assert len({face.__version__ for face in FACES}) == 1


def test_errors_that_functions_raise_can_be_caught_by_their_public_names() -> None:
    public = {*seecr.__all__, *crosscheck.__all__}
    raised = set()
    for face in FACES:
        for function in filter(inspect.isfunction, (getattr(face, n) for n in face.__all__)):
            words = str(inspect.getdoc(function)).partition("\nRaises:\n")[2].split("\n\n")[0]
            raised |= set(re.findall(r"\b\w+Error\b", words))
    assert "UnsolvedError" in raised and raised <= public


def test_no_module_hides_a_public_name() -> None:
    """Importing a module makes it an attribute of its package: of another name than a function."""
    for package in ("seecr", "crosscheck"):
        for path in modules(package):
            import_module(name_of(path))
    for face in FACES:
        assert [n for n in face.__all__ if isinstance(getattr(face, n), ModuleType)] == []


# Folders that show results: on the console, as pages, as figures and recordings.
SHOWING = ("crosscheck.show", "seecr.show")
# What else the commands use, name by name: their own trade, which Python has no use for.
TRADE = {
    # files that are complete or not there, and that replace none of the user's
    "seecr.files": {
        "check_replaces",
        "check_writable",
        "json_text",
        "staged",
        "with_toml",
        "write_text",
        "write_texts",
        "Made",
    },
    "crosscheck.model.write": {"check_place"},
    "crosscheck.importing": {"check_case", "write_case"},
    "crosscheck.planning.write": {"NAME", "box_of", "check_own", "sometimes_written"},
    "crosscheck.suite.write": {"FILE_NAME", "RESULTS"},
    "crosscheck.twin": {"FILES"},
    "seecr.exported.export": {"wrote"},
    # what results were made of
    "seecr.description.fingerprint": {"fingerprint"},
    # what people type: files of commands and readings (in Python crosscheck.load_commands), numbers
    "seecr.columns.commands": {"read_commands"},
    "seecr.workspace.grid": {"own_directions"},
    "seecr.columns.plausible": {"ABSURD", "scalar_last"},
    "seecr.description.mjcf": {"CABLES"},
    "seecr.pose": {"NORM_TOLERANCE"},
    "seecr.statics.starts": {"commanded_poses"},
    "seecr.workspace.maps": {"evenly"},
    "crosscheck.suite.cases": {"select"},
    "crosscheck.suite.run": {"every_shipped", "shipped_like"},
    # words
    "seecr.counted": {"counted"},
    "seecr.units": {"millimetres"},
    "seecr.description.robot": {"ITS_A_POINT"},
    "seecr.effects.base": {"unfed"},
    "seecr.equilibrium.solving": {"strained", "strained_rows"},
    "seecr.equilibrium.search": {"elsewhere", "on_their_way"},
    # processes
    "seecr.compiled.compile_notice": {"tell_compiling"},
    "seecr.parallel": {"processors"},
}


def taken(path: Path) -> set[tuple[str, str]]:
    """(module, name) of what a source imports of the two packages; not what only names types."""
    found = set()
    tree = tree_of(path)
    typing = [n for n in tree.body if isinstance(n, ast.If) and "TYPE_CHECKING" in ast.unparse(n)]
    silent = {id(inner) for node in typing for inner in ast.walk(node)}
    for node in ast.walk(tree):
        if id(node) in silent:
            continue
        if isinstance(node, ast.Import):
            found |= {(alias.name, "") for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {(str(node.module), alias.name) for alias in node.names}
    return {(m, n) for m, n in found if m.split(".")[0] in ("seecr", "crosscheck")}


def is_allowed(module: str, name: str) -> bool:
    """Whether commands may use it: a face's name, what shows results, or their own trade."""
    if module.startswith(("seecr.cli", "crosscheck.cli")):
        return True
    if module in ("seecr", "crosscheck"):
        return name in {*import_module(module).__all__, "__version__"}
    if module.startswith(tuple(f"{folder}." for folder in SHOWING)):
        # what such a module defines itself, and not for itself alone
        own = getattr(getattr(import_module(module), name), "__module__", "") == module
        return own and not name.startswith("_")
    return name in TRADE.get(module, ())


@pytest.mark.parametrize("path", COMMANDS, ids=lambda path: f"{path.parents[1].name}-{path.stem}")
def test_commands_use_public_names_and_those_of_their_trade(path: Path) -> None:
    private = {f"{module}.{name}" for module, name in taken(path) if not is_allowed(module, name)}
    assert private == set(), "put it into a face, or into TRADE if Python has no use for it"


def test_what_is_neither_is_seen() -> None:
    assert is_allowed("crosscheck", "diagnose") and is_allowed("seecr.files", "staged")
    assert is_allowed("seecr.show.pose_words", "pose_lines")
    # declared by their modules, and yet no command's
    assert not is_allowed("crosscheck.given", "considered")
    assert not is_allowed("seecr.workspace.maps", "with_history")
    assert not is_allowed("seecr.files", "read_toml")
    assert not is_allowed("crosscheck.fit.least_squares.state", "evaluate")
    assert not is_allowed("seecr.show.pose_words", "_known")


def test_the_trade_of_commands_has_nothing_that_none_uses_or_that_is_public() -> None:
    used = set().union(*map(taken, COMMANDS))
    listed = {(module, name) for module, names in TRADE.items() for name in names}
    assert listed - used == set()
    public = {*seecr.__all__, *crosscheck.__all__}
    assert {name for _module, name in listed} & public == set()


REFUSED = {
    "load_commands": lambda odd: crosscheck.load_commands(odd, "planar_vertical"),
    "load_measurements": lambda odd: crosscheck.load_measurements(odd, "planar_vertical"),
    "compare": lambda odd: crosscheck.compare("planar_vertical", odd),
    "import_case": lambda odd: crosscheck.import_case(odd, "a.csv", "planar_vertical", "b.csv"),
    "make_plan": lambda odd: crosscheck.make_plan("planar_vertical", odd),
    "choose_poses": lambda odd: crosscheck.choose_poses("planar_vertical", odd),
    "make_twin": lambda odd: crosscheck.make_twin("planar_vertical", odd),
    "shipped_cases": crosscheck.shipped_cases,
    "Sigma": lambda odd: crosscheck.Sigma(position_m=odd),
    "Tolerance": lambda odd: crosscheck.Tolerance(tension_N=odd),
    "user_cases": lambda odd: crosscheck.user_cases("planar_vertical", n_random=odd),
    "write_measurements": lambda odd: crosscheck.write_measurements("a.csv", odd),
    "write_plan": lambda odd: crosscheck.write_plan(odd, "a"),
    "save_model": lambda odd: crosscheck.save_model("a.toml", odd),
    "load_diagnosed": lambda odd: crosscheck.load_diagnosed(odd, "planar_vertical"),
    "load_limits": crosscheck.load_limits,
    "load_thresholds": crosscheck.load_thresholds,
    "unseal": crosscheck.unseal,
    "write_run": lambda odd: crosscheck.write_run(odd, "a"),
    "tracked": lambda odd: seecr.tracked("planar_vertical", odd, ()),
    "placed": lambda odd: seecr.placed("planar_vertical", odd, ()),
    "with_history": lambda odd: seecr.with_history("planar_vertical", odd),
    "layout_of": lambda odd: seecr.layout_of(odd, "planar_vertical"),
    "slack_zones": seecr.slack_zones,
    "slack_spans": seecr.slack_spans,
    "midline_points": seecr.midline_points,
    "bar_balances": lambda odd: seecr.bar_balances("planar_two_cable", odd),
    "barriers": lambda odd: seecr.barriers(odd, odd),
    "default_axes": lambda odd: seecr.default_axes("planar_vertical", odd),
    "bar_tilt": lambda odd: seecr.bar_tilt([[0, 1], [1, 1]], odd),
    "midline_point": lambda odd: seecr.midline_point(odd, odd),
}


@pytest.mark.parametrize("odd", [object(), {"a": 1}, -0.5, [["a"]]], ids=repr_of)
@pytest.mark.parametrize("name", REFUSED)
def test_what_is_of_another_kind_is_refused_by_the_typed_error(name: str, odd: object) -> None:
    with pytest.raises(seecr.SeecrError):
        REFUSED[name](odd)


@pytest.mark.parametrize("result", RESULTS, ids=lambda result: result.__name__)
def test_results_show_themselves(result: type) -> None:
    assert issubclass(result, Result)
    assert result.__repr__ is Result.__repr__ and result.__str__ is Result.__str__
    assert result.to_frame is Result.to_frame and result.to_json is Result.to_json
