"""A user's effect is taken wherever a built-in one is, without a package."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from called import printed
from hoses import Heavier, Hose
from made_data import measured

import crosscheck
import seecr
from seecr.effects import registry

ROBOT = seecr.load_robot("demobot_cogiro")
FILE = Path(__file__).parents[1] / "support" / "hoses.py"


@pytest.fixture(autouse=True)
def fresh() -> Iterator[None]:
    """What a test makes known stays in it."""
    yield
    fresh_catalogue()


def fresh_catalogue() -> None:
    registry._introduced.clear()
    registry._given.clear()
    registry.catalogue.cache_clear()


@pytest.fixture(scope="module")
def data() -> crosscheck.Measurements:
    return measured(ROBOT, [seecr.Term.of(ROBOT, Hose(pull=1.5))], points=6)


# --- Python ---------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("given", [Hose, Hose(), [Hose, "stiffness"]])
def test_a_diagnosis_considers_it(data: crosscheck.Measurements, given: Any) -> None:
    found = crosscheck.diagnose(ROBOT, data, only=given)
    (missing,) = found.missing
    assert missing.effect == "hose"
    assert missing.values == pytest.approx([1.5], abs=4.0 * missing.stderr[0])
    assert missing.check.startswith("take the hose off: expect 1.")
    assert "hose" not in seecr.catalogue()  # another diagnosis does not


def test_exclude_takes_it(data: crosscheck.Measurements) -> None:
    with pytest.raises(crosscheck.CrosscheckError, match="only hose and not hose"):
        crosscheck.diagnose(ROBOT, data, only=Hose, exclude=[Hose])


def test_a_model_may_be_its_instance(data: crosscheck.Measurements) -> None:
    absent = crosscheck.compare(ROBOT, data, [Hose()])
    there = crosscheck.compare(ROBOT, data, [Hose(pull=1.5)])
    assert absent.rms == crosscheck.compare(ROBOT, data).rms
    assert there.is_noise and not absent.is_noise
    with pytest.raises(seecr.InputError, match=r"got the class Hose, which has none; Hose\(\.\.\."):
        crosscheck.compare(ROBOT, data, [Hose])  # type: ignore[list-item]


@pytest.mark.slow
def test_it_is_added_kept_and_read_again(data: crosscheck.Measurements, tmp_path: Path) -> None:
    found = crosscheck.add_effect(ROBOT, data, Hose)
    assert found.pays
    value, error = found.own.term.vector[0], found.own.stderr[0]
    assert abs(value - 1.5) < 4.0 * error < 0.5
    begun = crosscheck.add_effects(ROBOT, data, [Hose(pull=1.2), "stiffness"])
    assert begun.terms["hose"].vector == pytest.approx([value], abs=error)
    crosscheck.save_model(tmp_path / "m.toml", found.model)
    registry._given.clear()  # as in another process
    with pytest.raises(seecr.InputFileError, match=r"line \d+: no effect 'hose'.*seecr\.introduce"):
        seecr.load_model(tmp_path / "m.toml", ROBOT)
    assert seecr.introduce(Hose) is Hose and list(seecr.catalogue())[-1] == "hose"
    model = seecr.load_model(tmp_path / "m.toml", ROBOT)
    assert model.terms["hose"].vector == pytest.approx([value])


@pytest.mark.slow
def test_it_is_calibrated_and_planned(data: crosscheck.Measurements) -> None:
    found = crosscheck.calibrate(ROBOT, data, only=[Hose, "stiffness"])
    assert found.terms["hose"].vector == pytest.approx([1.5], abs=0.2)
    plan = crosscheck.make_plan(ROBOT, data, effects=[Hose])
    seen = {one.name: one for one in plan.effects}
    assert seen["hose"].visible and len(seen) + len(plan.missing) == len(seecr.catalogue()) + 1
    chosen = crosscheck.choose_poses(ROBOT, 6, effects=Hose)
    assert chosen.n_rows == 6


def test_seecr_takes_it() -> None:
    pose = [0.5, 0.25, 0.1, 1, 0, 0, 0]
    wrench = seecr.Term.of(ROBOT, "external_wrench", force_x_N=1.5)
    own, ours = (seecr.solve(ROBOT, pose, effects=[e]) for e in (Hose(pull=1.5), wrench))
    assert own.pose == pytest.approx(ours.pose, abs=1e-9)
    told, same = (seecr.correct(ROBOT, pose, effects=[e]) for e in (Hose(pull=1.5), wrench))
    assert told.commands.lengths == pytest.approx(same.commands.lengths, abs=1e-9)


@pytest.mark.slow
def test_a_twin_hides_it_by_its_law_and_mujoco_agrees() -> None:
    kwargs: dict[str, Any] = {"seed": 3, "points": 4, "tensions": True}
    own = crosscheck.make_twin(ROBOT, effects=[Heavier(added=0.06)], **kwargs)
    ours = crosscheck.make_twin(
        ROBOT, effects=[seecr.Term.of(ROBOT, "platform_mass", added_kg=0.06)], **kwargs
    )
    none = crosscheck.make_twin(ROBOT, effects=(), **kwargs)
    for name in ("position", "quat_wxyz", "tension_readings", "pose", "tensions"):
        truth, wanted, plain = (getattr(t.truth, name) for t in (own, ours, none))
        moved = np.abs(wanted - plain).max()
        assert np.abs(truth - wanted).max() < 1e-4 * moved, name
    assert own.answer.values == {"heavier": {"added_kg": 0.06}}
    assert own.answer.truth.endswith("; heavier by its own law in SEECR")
    # beside what MuJoCo simulates, and drawn from the seed
    both = crosscheck.make_twin(ROBOT, 5, effects=[Hose, "pulley_radius"], points=4)
    assert both.answer.hidden == ["hose", "pulley_radius"]
    assert both.answer.values["hose"]["pull_N"] != 0.0


class Nameless(seecr.Effect):
    place = "load"


class Dotted(Hose):
    name: ClassVar[str] = "my.hose"


class Taken(Heavier):
    name: ClassVar[str] = "platform_mass"


def another_hose() -> type[seecr.Effect]:
    class Hose2(Hose):
        pass

    return Hose2


WRONG: dict[str, tuple[Any, str]] = {
    "a number": (3.0, "only: expected names of effects, got 3.0"),
    "numbers": ([3.0], "expected the name of an effect, got 3.0; its class or an instance"),
    "a class": ([float], "class float is no effect; expected a subclass"),
    "no name": ([Nameless], "class Nameless has the name ''; expected letters"),
    "a dot": ([Dotted], "class Dotted has the name 'my.hose'; expected letters"),
    "taken": ([Taken], "class Taken: .*no dataclass|names its effect platform_mass"),
    "twice": ([Hose, another_hose()], "two effects are called hose: Hose and Hose2|no dataclass"),
}


@pytest.mark.parametrize("what", WRONG)
def test_what_is_no_effect_of_ones_own_is_one_sentence(
    data: crosscheck.Measurements, what: str
) -> None:
    given, words = WRONG[what]
    with pytest.raises(seecr.InputError, match=words):
        crosscheck.diagnose(ROBOT, data, only=given)


@pytest.mark.parametrize(
    ("effect", "words"),
    [
        (Hose(pull=np.nan), "pull_N holds numbers that are not finite"),
        (Hose(pull="much"), "effect hose: pull: expected numbers"),  # type: ignore[arg-type]
        (Hose(pull=[1.0, 2.0]), "effect hose: pull: expected 1 number, got 2"),  # type: ignore[arg-type]
        (Hose(pull=1e9), r"effect hose: pull_N: 1e\+09 is out of bounds"),
    ],
)
def test_values_of_an_instance_are_checked(effect: Hose, words: str) -> None:
    with pytest.raises(seecr.InputError, match=words):
        seecr.Term.of(ROBOT, effect)


# --- the command line -----------------------------------------------------------------------------


@pytest.mark.slow
def test_commands_take_it_from_its_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    own = ("--effect", f"{FILE}:Hose")
    text = printed("twin", "demobot_cogiro", "--hide", 7, *own, "--out", "case")
    assert f"measured.csv --effect {FILE}:Hose" in text
    assert f"twin --open case --effect {FILE}:Hose" in text
    files = ("case/robot.xml", "case/measured.csv")
    said = printed(
        "diagnose", *files, *own, "--only", "hose", "--no-recording", "--model-out", "m.toml"
    )
    assert "28 of" not in said and "hose: a hose that pulls" in said
    assert "Model and data agree" in printed("compare", *files, "--model", "m.toml", *own)
    assert "Written to n.toml: hose" in printed("add", "hose", *files, "--model", "n.toml", *own)
    assert "hose" in printed("effects", *own) and "your own" in printed("effects", "hose", *own)
    opened = printed("twin", "--open", "case", *own)
    assert "pull = " in opened and opened.endswith(f"measured.csv --effect {FILE}:Hose\n")
    fresh_catalogue()  # as in another process
    unnamed = printed("twin", "--open", "case")
    assert "pull_N = " in unnamed
    assert "hose: of a file of its own; --effect FILE.py:CLASS names it, here and" in unnamed
    refused = printed("twin", "--open", "case", "--effect", "pulley_radius", status=2)
    assert "leave out all other options but --json and --effect FILE.py:CLASS" in refused


GOOD = FILE.read_text(encoding="utf-8")
DAMAGED: dict[str, tuple[str, str, str]] = {
    "syntax": ("def f(:", "x.py:Hose", "x.py: line 1: cannot be run: SyntaxError"),
    "an error": ("a = 1\nb = c", "x.py:Hose", "line 2: cannot be run: NameError: name 'c'"),
    "it exits": ("raise SystemExit(3)", "x.py:Hose", "cannot be run: SystemExit: 3"),
    "an import": ("import nothing_of_that_name", "x.py:Hose", "ModuleNotFoundError"),
    "no class": (GOOD, "x.py:Hoze", "has no class Hoze; it has Hose and|it has Hose, Heavier"),
    "no class said": (GOOD, "x.py", r"x.py: expected a class after the file, FILE.py:CLASS; it ha"),
    "no effect": ("class Hose: pass", "x.py:Hose", "x.py: Hose is no effect; expected a subclass"),
    "no dataclass": (GOOD.replace("@dataclass", "#"), "x.py:Hose", "Hose: .* is no dataclass"),
    "no method": (GOOD.replace("edit_setup", "edit_all"), "x.py:Hose", "hose changes nothing"),
    "no file": ("", "y.py:Hose", "y.py: no such file; expected FILE.py:CLASS"),
    "another text": ("", "Hose", "--effect: expected FILE.py:CLASS, .* got 'Hose'"),
    "it fails": (
        GOOD.replace("setup.wrench = ", "setup.wrenches += "), "x.py:Hose",
        r"effect hose: edit_setup raises AttributeError: .*x.py, line \d+\)",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", DAMAGED)
def test_a_damaged_file_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, what: str, data: crosscheck.Measurements
) -> None:
    monkeypatch.chdir(tmp_path)
    text, given, words = DAMAGED[what]
    Path("x.py").write_text(text, encoding="utf-8")
    crosscheck.write_measurements("m.csv", data)
    out = printed("diagnose", "demobot_cogiro", "m.csv", "--effect", given, status=2)
    assert out.count("\n") == 1
    assert re.search(words, out), out


def test_two_of_one_name_are_refused(tmp_path: Path) -> None:
    other = tmp_path / "another.py"
    other.write_text(GOOD, encoding="utf-8")
    out = printed("effects", "--effect", f"{FILE}:Hose", "--effect", f"{other}:Hose", status=2)
    assert "are both called hose; expected a name of its own for each" in out


@pytest.mark.slow
def test_other_processes_find_the_class_of_a_file(tmp_path: Path) -> None:
    from seecr.effects.registry import load_effect
    from seecr.parallel import processes

    file = tmp_path / "hoses_of_a_test.py"
    file.write_text(GOOD, encoding="utf-8")
    effect: Any = load_effect(f"{file}:Hose")(pull=2.5)
    with processes(2) as executor:
        assert executor is not None
        assert executor.submit(getattr, effect, "pull").result() == 2.5
