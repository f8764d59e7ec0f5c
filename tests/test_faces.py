"""What `import seecr` and `import crosscheck` give: documented names, and results of one kind.

Commands are built of those names, of what shows results, and of a few names of their own trade.
"""

from __future__ import annotations

import ast
import inspect
import re
from functools import partial
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest
from sources import modules, tree_of

import crosscheck
import seecr
from seecr.result import Result

FACES = [seecr, crosscheck]
PUBLIC = {*seecr.__all__, *crosscheck.__all__}
FUNCTIONS = {
    name: one
    for face in FACES
    for name in face.__all__
    if inspect.isfunction(one := getattr(face, name))
}
COMMANDS = [p for face in FACES for p in modules(face.__name__) if p.parent.name == "cli"]
# What functions take and others give, and effects, which are everybody's own classes.
NO_RESULTS = {
    seecr.Robot, seecr.Effect, seecr.Terms, seecr.Commands, crosscheck.Case, crosscheck.Limits,
    crosscheck.Thresholds,
}  # fmt: skip
# What results hold of more of their kind.
PARTS = {crosscheck.CaseResult, crosscheck.MissingEffect, seecr.Jump}


def returned() -> set[type]:
    """The classes of which the faces' functions return one, or several."""
    words = [
        word
        for function in FUNCTIONS.values()
        for word in re.findall(r"\w+", str(inspect.signature(function).return_annotation))
    ]
    found = [getattr(face, word) for face in FACES for word in words if word in face.__all__]
    return {one for one in found if inspect.isclass(one)}


@pytest.mark.parametrize("face", FACES, ids=lambda face: face.__name__)
def test_every_public_name_is_there_and_documented(face: ModuleType) -> None:
    assert face.__all__ == sorted(face.__all__)
    assert [name for name in face.__all__ if not inspect.getdoc(getattr(face, name))] == []
    with pytest.raises(AttributeError, match=r"has no attribute 'nothing'"):
        face.nothing  # noqa: B018
    # also before their first use, for shells that complete names
    shown = {name for name in dir(face) if not name.startswith("__")}
    assert shown == {*face.__all__, *(("inverse", "workspace") if face is seecr else ())}
    assert face.__version__ == seecr.__version__


def test_errors_that_functions_raise_can_be_caught_by_their_public_names() -> None:
    docs = [str(inspect.getdoc(function)) for function in FUNCTIONS.values()]
    told = [doc.partition("\nRaises:\n")[2].split("\n\n")[0] for doc in docs]
    raised = set(re.findall(r"\b\w+Error\b", " ".join(told)))
    assert "UnsolvedError" in raised and raised <= PUBLIC


# Folders that show results: on the console, as pages, as figures and recordings.
SHOWING = ("crosscheck.show.", "seecr.show.")
# What else the commands use: their own trade, which Python has no use for. Files that are complete
# or not there and replace none of the user's; what results were made of; what people type; words.
TRADE = {
    f"{module}.{name}"
    for line in """
crosscheck.measurements.data: parse_kind parse_quantity
crosscheck.model.write: check_place state_of
crosscheck.planning.write: box_of planned_files
crosscheck.studies.cases: read_cases
crosscheck.studies.study: studied
crosscheck.suite.cases: select
crosscheck.suite.run: every_shipped shipped_like
crosscheck.suite.write: FILE_NAME RESULTS
crosscheck.given: check_case
crosscheck.importing: FILES write_case
crosscheck.twin: FILES
seecr.columns.csv: table_text
seecr.columns.commands: CommandFile read_commands
seecr.columns.headers: columns_said parse_columns renamed
seecr.columns.plausible: ABSURD scalar_last
seecr.counted: counted some
seecr.description.cables: ea_of
seecr.description.fingerprint: fingerprint
seecr.description.fixing: told write_fixed
seecr.description.mjcf: CABLES
seecr.description.robot: ITS_A_POINT
seecr.effects.base: unfed
seecr.errors: printable
seecr.effects.registry: load_effect
seecr.equilibrium.search: elsewhere on_their_way
seecr.equilibrium.strange: strained_rows strange walked_in_steps
seecr.exported.export: wrote
seecr.folders: check_ours staged
seecr.files: Made check_writable json_pieces json_text with_toml write_text write_texts
seecr.importing.caspr: read_caspr
seecr.importing.draft: write_robot
seecr.importing.firmware: firmware_text read_firmware settings_beside
seecr.importing.points_table: read_points
seecr.importing.wirex: read_wirex
seecr.parallel: cluster processes processors
seecr.pose: NORM_TOLERANCE
seecr.statics.starts: commanded_poses
seecr.units: millimetres
seecr.version: full_version
seecr.workspace.grid: own_directions
seecr.workspace.maps: MOST_POSES MOST_STORED axis_of
""".strip().splitlines()
    for module, _, names in [line.partition(": ")]
    for name in names.split()
}


def taken(path: Path) -> set[str]:
    """What a source imports of the two packages; not what only names types."""
    tree = tree_of(path)
    typing = [n for n in tree.body if isinstance(n, ast.If) and "TYPE_CHECKING" in ast.unparse(n)]
    silent = {inner for node in typing for inner in ast.walk(node)}
    found = set()
    for node in set(ast.walk(tree)) - silent:
        if isinstance(node, ast.Import):
            found |= {f"{alias.name}." for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return {one for one in found if one.split(".")[0] in ("seecr", "crosscheck")}


def is_allowed(one: str) -> bool:
    """Whether commands may use it: a face's name, what shows results, or their own trade."""
    module, _, name = one.rpartition(".")
    if module.startswith(("seecr.cli", "crosscheck.cli")):
        return True
    if module in ("seecr", "crosscheck"):
        return name in {*import_module(module).__all__, "__version__"}
    if module.startswith(SHOWING):
        # what such a module defines itself, and not for itself alone
        own = getattr(getattr(import_module(module), name), "__module__", "") == module
        return own and not name.startswith("_")
    return one in TRADE


@pytest.mark.parametrize("path", COMMANDS, ids=lambda path: f"{path.parents[1].name}-{path.stem}")
def test_commands_use_public_names_and_those_of_their_trade(path: Path) -> None:
    private = {one for one in taken(path) if not is_allowed(one)}
    assert private == set(), "put it into a face, or into TRADE if Python has no use for it"


def test_what_is_neither_is_seen() -> None:
    seen = {
        "crosscheck.diagnose": True,
        "seecr.folders.staged": True,
        "seecr.show.pose_words.pose_lines": True,
        # declared by their modules, and yet no command's
        "crosscheck.given.considered": False,
        "seecr.files.read_toml": False,
        "crosscheck.fit.words.rms_words": False,
        "seecr.show.pose_words._known": False,
    }
    assert {one: is_allowed(one) for one in seen} == seen


def test_the_trade_of_commands_has_nothing_that_none_uses_or_that_is_public() -> None:
    assert TRADE - set().union(*map(taken, COMMANDS)) == set()
    assert {one.rpartition(".")[2] for one in TRADE} & PUBLIC == set()


# What each function needs, but the robot, is replaced at once; these have one odd argument each.
ONE_ODD = {
    "Sigma": lambda odd: crosscheck.Sigma(position_m=odd),
    "Tolerance": lambda odd: crosscheck.Tolerance(tension_N=odd),
    "bar_balances": lambda odd: seecr.bar_balances("planar_two_cable", odd),
    "bar_tilt": lambda odd: seecr.bar_tilt([[0, 1], [1, 1]], odd),
    "default_axes": lambda odd: seecr.default_axes("planar_vertical", odd),
    "load_thresholds": crosscheck.load_thresholds,
    "save_model": lambda odd: crosscheck.save_model("a.toml", odd),
    "shipped_cases": crosscheck.shipped_cases,
    "user_cases": lambda odd: crosscheck.user_cases("planar_vertical", n_random=odd),
    "write_measurements": lambda odd: crosscheck.write_measurements("a.csv", odd),
}
# These take what other functions gave, or nothing that must be given.
UNCHECKED = {"exceeded", "sensitivities", "export", "new_model", "model_names", "run_suite"}


def all_odd(name: str, odd: object) -> None:
    every = inspect.signature(FUNCTIONS[name]).parameters.values()
    needed = {one.name: odd for one in every if one.default is one.empty}
    FUNCTIONS[name](**needed | {"robot": "planar_vertical"} if "robot" in needed else needed)


@pytest.mark.parametrize("name", sorted((ONE_ODD.keys() | FUNCTIONS.keys()) - UNCHECKED))
def test_what_is_of_another_kind_is_refused_by_the_typed_error(name: str) -> None:
    for odd in (object(), {"a": 1}, -0.5, [["a"]]):
        with pytest.raises(seecr.SeecrError):
            ONE_ODD.get(name, partial(all_odd, name))(odd)


@pytest.mark.parametrize(
    "result", sorted((returned() | PARTS) - NO_RESULTS, key=repr), ids=lambda one: one.__name__
)
def test_results_show_themselves(result: type) -> None:
    assert issubclass(result, Result)
    for name in ("__repr__", "__str__", "to_frame", "to_json"):
        assert getattr(result, name) is getattr(Result, name)
