"""An effect in a package of the user's own: the page that says how, run to the letter."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from click.testing import CliRunner
from effect_cases import experiment_of, moved, worst_mismatch

import seecr
from seecr.cli import main
from seecr.effects.edits import edit_readings, edit_setup
from seecr.effects.setup import plain_setup

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "effects.md").read_text(encoding="utf-8")
PYTHON = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
ENTRY_POINTS = re.search(
    r"```toml\n\[project\.entry-points\.\"(.*?)\"\]\n(.*?)```", PAGE, re.DOTALL
)


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[object]:
    """Install modules and entry points as pip would, for one test."""
    names: list[str] = []

    def put(module: str, source: str, entries: str) -> None:
        (tmp_path / f"{module}.py").write_text(source, encoding="utf-8")
        info = tmp_path / f"{module}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(
            f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n", encoding="utf-8"
        )
        (info / "entry_points.txt").write_text(f"[seecr.effects]\n{entries}\n", encoding="utf-8")
        names.append(module)
        monkeypatch.syspath_prepend(tmp_path)
        seecr.catalogue.cache_clear()

    yield put
    for name in names:
        sys.modules.pop(name, None)
    seecr.catalogue.cache_clear()


@pytest.fixture
def documented(install) -> None:  # type: ignore[no-untyped-def]
    """The page's own package."""
    assert ENTRY_POINTS and ENTRY_POINTS[1] == "seecr.effects"
    entries = ENTRY_POINTS[2].replace('"', "").strip()
    install("my_effects", PYTHON[0] + PYTHON[1], entries)


# --- the page ------------------------------------------------------------------------------------


def test_the_catalogue_finds_what_the_page_installs(documented: None) -> None:
    assert list(seecr.catalogue())[-2:] == ["lens_distortion", "braid"]
    lens = seecr.effect_named("lens_distortion")
    assert lens.__module__ == "my_effects" and lens.place == "sensing"
    layout = seecr.layout_of(lens, experiment_of("demobot_cogiro").robot)
    assert layout.names == ("bend_1_per_m2",)


def test_the_pages_last_example_prints_what_it_printed(capsys: pytest.CaptureFixture[str]) -> None:
    exec("\n".join(PYTHON), {"__name__": "__main__"})
    printed = np.array(re.findall(r"[\d.]+", capsys.readouterr().out), float)
    assert printed == pytest.approx([0.0563, 0.0673], abs=1e-4)


@pytest.mark.parametrize("kind", ["demobot_cogiro", "demobot_parallel", "jointed"])
@pytest.mark.parametrize("name, vector", [
    ("lens_distortion", [0.02]), ("braid", [0.4, 5e-4]),
])  # fmt: skip
def test_the_pages_effects_are_absent_at_null_and_differentiated_without_derivatives(
    documented: None, name: str, vector: list[float], kind: str
) -> None:
    experiment = experiment_of(kind, seed=5)
    layout = seecr.layout_of(seecr.effect_named(name), experiment.robot)
    plain = experiment.predict().readings
    absent = experiment.predict([layout.build(layout.null)]).readings
    assert np.array_equal(absent.position, plain.position)
    assert np.array_equal(absent.tensions, plain.tensions)
    terms = seecr.Terms([seecr.Term(layout, np.array(vector))])
    at = experiment.predict(terms.effects)
    assert np.all(at.solved)
    worst, whose = worst_mismatch(experiment, terms, seecr.sensitivities(experiment, terms, at))
    assert worst < 1e-4, whose


@pytest.mark.parametrize("name, others", [
    ("braid", ("cable_weight", 0.2)),
    ("braid", ("pulley_radius", 0.01)),
    ("braid", ("winch_side_length", 0.2)),
    ("lens_distortion", ("stiffness", 1.2)),
])  # fmt: skip
def test_the_pages_effects_work_beside_built_in_ones(
    documented: None, name: str, others: tuple[str, float]
) -> None:
    experiment = experiment_of("demobot_parallel")
    robot = experiment.robot
    own, built_in = (seecr.layout_of(seecr.effect_named(n), robot) for n in (name, others[0]))
    vector = own.null.copy()
    vector[0] += 0.3
    terms = seecr.Terms([seecr.Term(own, vector), seecr.Term(built_in, np.array([others[1]]))])
    at = experiment.predict(terms.effects)
    assert np.all(at.solved)
    worst, whose = worst_mismatch(experiment, terms, seecr.sensitivities(experiment, terms, at))
    assert worst < 1e-4, whose


def test_a_law_of_the_users_is_the_built_in_one_it_imitates() -> None:
    """T += quadratic E S eps^2, as a law and as nonlinear_elasticity."""

    class Squared(seecr.Effect):
        name = "squared"
        place = "cable"

        def edit_setup(self, setup) -> None:  # type: ignore[no-untyped-def]
            setup.laws.append(lambda strain: 300.0 * setup.ea * strain * np.abs(strain))

    experiment = experiment_of("demobot_parallel")
    built_in = seecr.effect_named("nonlinear_elasticity")(quadratic=300.0)
    assert moved(experiment, [Squared()]) == pytest.approx(
        moved(experiment, [built_in]), rel=1e-6, abs=1e-9
    )


def test_a_law_is_followed_along_a_walk_too(documented: None) -> None:
    experiment = experiment_of("demobot_cogiro")
    braid = seecr.effect_named("braid")(share=0.4, knee=5e-4)
    slack_gear = seecr.effect_named("backlash")(gap=1e-12)
    walked = moved(experiment, [braid, slack_gear])
    assert walked == pytest.approx(moved(experiment, [braid]), rel=1e-5, abs=1e-8)


def test_pose_answers_with_a_law_of_the_users(documented: None, tmp_path: Path) -> None:
    """It had ended with status 2: no other equilibria can be sought."""
    model = tmp_path / "model.toml"
    model.write_text('[[effect]]\nname = "braid"\nparameters = { share = 0.4, knee = 5e-4 }')
    args = ["pose", "demobot_cogiro", "0.3", "0.25", "0.1", "--model", str(model)]
    told = CliRunner().invoke(main, args)
    assert told.exit_code == 0, told.output
    assert "other equilibria are not sought: with braid, " in told.stdout


# --- what is said of one that is wrong -----------------------------------------------------------

HEAD = """
from dataclasses import dataclass
import numpy as np
from seecr.effects import Effect, parameter

@dataclass(frozen=True, eq=False)
class Mine(Effect):
    name = "mine"
    place = "cable"
    amount: float = parameter("", 1.0)

    def edit_setup(self, setup):
        {edit}

    def edit_readings(self, readings, setup):
        {read}
"""


def source(edit: str = "pass", read: str = "pass") -> str:
    return HEAD.format(edit=edit, read=read)


@pytest.mark.parametrize("text, complaint", [
    ("mine = 3", r"entry point mine \(own_effects:mine\) is no effect; expected a subclass"),
    ("class mine: pass", "is no effect; expected a subclass of seecr.effects.Effect with a name"),
    ("from nowhere_at_all import mine", "cannot be loaded: No module named 'nowhere_at_all'"),
    ("other = 1", "cannot be loaded: module 'own_effects' has no attribute 'mine'"),
    (source().replace('"mine"', '"stiffness"') + "mine = Mine", "stiffness, which exists already"),
    (source().replace('"cable"', '"roof"') + "mine = Mine", "place 'roof'; expected one of act"),
    (source().replace("@dataclass(frozen=True, eq=False)", "") + "mine = Mine",
     "effect mine is no dataclass.*@dataclass"),
    (source().replace('parameter("", 1.0)', "3.0") + "mine = Mine",
     "effect mine has a field amount that is no parameter"),
    ("from seecr.effects import Effect\nfrom dataclasses import dataclass\n"
     "@dataclass(frozen=True)\nclass mine(Effect):\n    name = 'idle'\n    place = 'load'",
     "effect idle changes nothing; expected it to define edit_setup or edit_readings"),
])  # fmt: skip
def test_a_bad_entry_point_is_answered_in_one_line(install, text: str, complaint: str) -> None:  # type: ignore[no-untyped-def]
    install("own_effects", text, "mine = own_effects:mine")
    with pytest.raises(seecr.InputError, match=complaint) as caught:
        seecr.catalogue()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("edit, read, complaint", [
    ("setup.laws.append(lambda eps: eps[:, :2])", "pass",
     r"effect mine: its law returns tensions of shape \(6, 2\); expected \(6, 8\)"),
    ("setup.laws.append(lambda eps: eps * np.nan)", "pass",
     "effect mine: its law returns a tension that is not finite"),
    ("setup.laws.append(lambda eps: 'much')", "pass",
     "effect mine: its law returns a tension that is no number: 'much'"),
    ("setup.ea = setup.ea * np.inf", "pass", "effect mine leaves setup.ea that is not finite"),
    ("setup.ea = 3.0", "pass", r"effect mine leaves setup.ea of shape \(\); expected \(8,\)"),
    ("setup.mass = None", "pass", "effect mine leaves setup.mass that is not finite"),
    ("pass", "readings.position = readings.position[:1]",
     r"effect mine leaves readings.position of shape \(1, 3\); expected \(6, 3\)"),
    ("pass", "readings.tensions = readings.tensions * np.nan",
     "effect mine leaves readings.tensions that is not finite"),
])  # fmt: skip
def test_an_effect_that_leaves_nonsense_is_named(  # type: ignore[no-untyped-def]
    install, edit: str, read: str, complaint: str
) -> None:
    install("own_effects", source(edit, read), "mine = own_effects:Mine")
    with pytest.raises(seecr.InputError, match=complaint) as caught:
        experiment_of("demobot_cogiro").predict([seecr.effect_named("mine")(amount=1.0)])
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("arguments, complaint", [
    ({"size": "cables"}, "size must be one of one, cable, spring, vector, point, got 'cables'"),
    ({"unit": 0.1}, 'unit must be a text such as "m", or "" for none, got 0.1'),
    ({"scale": 0.0}, "scale must be a positive number or a function of the robot, got 0.0"),
    ({"scale": float("nan")}, "scale must be a positive number"),
    ({"bounds": (1.0, 2.0)}, r"bounds must hold the null value 0.0, got \(1.0, 2.0\)"),
    ({"bounds": (1.0, -1.0), "null": 0.0}, "bounds must hold the null value"),
    ({"bounds": (0.0,)}, r"bounds must be \(lowest, highest\), got \(0.0,\)"),
])  # fmt: skip
def test_parameter_says_what_it_expected(arguments: dict, complaint: str) -> None:
    with pytest.raises(seecr.InputError, match=complaint):
        seecr.parameter(**{"unit": "m", "scale": 1.0, **arguments})


# --- What effects of other people leave is checked, and ours are trusted


def nothing(_: Any) -> None: ...


@dataclass(frozen=True, eq=False)
class Theirs(seecr.Effect):
    """An effect of somebody's own, that does as it is told."""

    name: ClassVar[str] = "theirs"
    place: ClassVar[str] = "load"

    setup: Callable[[seecr.Setup], None] = field(default=nothing)
    read: Callable[[seecr.Readings], None] = field(default=nothing)

    def edit_setup(self, setup: seecr.Setup) -> None:
        self.setup(setup)

    def edit_readings(self, readings: seecr.Readings, setup: seecr.Setup) -> None:
        self.read(readings)


def plain() -> seecr.Setup:
    experiment = experiment_of("demobot_cogiro")
    return plain_setup(experiment.robot, experiment.commands)


def readings(lost: int) -> seecr.Readings:
    """Of three rows; one had no equilibrium."""
    position = np.zeros((3, 3))
    position[lost] = np.nan
    return seecr.Readings(position, np.tile([1.0, 0, 0, 0], (3, 1)), np.ones((3, 8)))


def test_laws_that_were_there_before_are_not_theirs() -> None:
    setup = plain()
    setup.laws.append(lambda strain: strain[:, :2])  # of another shape
    edit_setup(Theirs(lambda s: s.laws.append(lambda strain: 2.0 * strain)), setup)
    first, second = (law(np.ones((3, 8))) for law in setup.laws)
    assert first.shape == (3, 2) and np.all(second == 2.0)


def test_rows_without_rest_may_stay_without_readings_and_others_may_not() -> None:
    def spoil(row: int) -> Theirs:
        return Theirs(read=lambda r: r.tensions.__setitem__(row, np.nan))

    setup = plain()
    edit_readings(spoil(1), readings(lost=1), setup)
    with pytest.raises(
        seecr.InputError, match=r"^effect theirs leaves readings\.tensions that is not"
    ):
        edit_readings(spoil(0), readings(lost=1), setup)


def test_a_long_text_in_place_of_numbers_is_cut() -> None:
    def spoil(setup: seecr.Setup) -> None:
        setup.ea = "much " * 99  # type: ignore[assignment]

    with pytest.raises(
        seecr.InputError, match=r"leaves setup\.ea that is no number: 'much"
    ) as error:
        edit_setup(Theirs(spoil), plain())
    assert len(str(error.value)) < 150
