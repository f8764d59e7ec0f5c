"""What the steps end with and is less likely than not is looked at again, in sets."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from made_data import COGIRO, measured, term

import crosscheck
from crosscheck.calibration.judgement.verdict import Judgement
from crosscheck.calibration.search import SetSearch
from crosscheck.calibration.unknown.imitated import NOT_ASKED, Imitated
from crosscheck.calibration.unknown.varying import Varying
from crosscheck.diagnosis import small, unexplained, verdict
from crosscheck.diagnosis.chances import Chances
from crosscheck.diagnosis.small import spoils
from crosscheck.diagnosis.unexplained import beside_imitated
from crosscheck.diagnosis.verdict import is_clear, is_undetermined
from crosscheck.fit.effects.possible import hardly_happens
from crosscheck.fit.reasons import DiagnosisVerdict, Reason, Why
from crosscheck.measurements.data import Measurements
from seecr.commands.data import Commands
from seecr.description.mjcf import load_robot
from seecr.effects import Terms
from seecr.pose import Array, quat_from_rxyz
from seecr.prediction.experiment import Experiment

HEAVY = term(load_robot(COGIRO), "platform_mass", added_kg=0.02)
PLANAR = """<mujoco model="tri">
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <site name="A1" pos="0 0 1.2"/>
    <site name="A2" pos="1.5 0 1.2"/>
    <site name="A3" pos="0.75 0 -0.3"/>
    <body name="platform" pos="0.75 0 0.5">
      <joint name="x" type="slide" axis="1 0 0"/>
      <joint name="z" type="slide" axis="0 0 1"/>
      <joint name="ry" type="hinge" axis="0 1 0"/>
      <inertial pos="0 0 -0.02" mass="2" diaginertia="0.01 0.01 0.01"/>
      <site name="B1" pos="-0.08 0 0.03"/>
      <site name="B2" pos="0.08 0 0.03"/>
      <site name="B3" pos="0 0 -0.03"/>
    </body>
  </worldbody>
  <tendon>
    <spatial springlength="0 0.94" stiffness="8000"><site site="A1"/><site site="B1"/></spatial>
    <spatial springlength="0 0.94" stiffness="8000"><site site="A2"/><site site="B2"/></spatial>
    <spatial springlength="0 0.765" stiffness="8000"><site site="A3"/><site site="B3"/></spatial>
  </tendon>
</mujoco>
"""


MAY_BE = [
    "pulley_radius", "stiffness", "cable_length_offset", "exit_point_error", "drum_gain",
    "platform_mass",
]  # fmt: skip


@pytest.mark.slow
def test_an_effect_that_is_unlikely_is_not_listed_though_steps_end_with_noise(
    tmp_path: Path,
) -> None:
    """Thirty poses' tensions, nothing stated: steps find the cables' offsets, at 22 %."""
    (tmp_path / "tri.xml").write_text(PLANAR, encoding="utf-8")
    robot = load_robot(tmp_path / "tri.xml")
    random = np.random.default_rng(2)
    pose = np.zeros((30, 7))
    pose[:, 0], pose[:, 2] = random.uniform(0.35, 1.15, 30), random.uniform(0.2, 0.8, 30)
    turn = np.radians(random.uniform(-12.0, 12.0, 30))
    pose[:, 3:] = quat_from_rxyz(np.column_stack([0.0 * turn, turn, 0.0 * turn]))
    hidden = [term(robot, "pulley_radius", radius_m=0.027), term(robot, "stiffness", factor=0.455)]
    read = Experiment(robot, Commands(pose)).predict([one.effect() for one in hidden])
    assert read.solved.all()
    data = Measurements(
        path=Path("m.csv"), n_cables=3, run=np.full(30, "1"), command_pose=pose,
        tensions=read.readings.tensions + 0.4 * random.standard_normal((30, 3)),
    )  # fmt: skip
    found = crosscheck.diagnose(robot, data, only=MAY_BE)
    assert found.verdict is crosscheck.DiagnosisVerdict.EFFECTS_FOUND
    assert {one.effect for one in found.missing} == {"pulley_radius", "stiffness"}
    assert all(one.probability > 0.95 for one in found.missing)
    # what is listed is a model by itself: the one whose errors are shown
    assert found.search is not None
    for one in found.missing:
        shown = found.search.last.fit.terms[one.effect].vector
        np.testing.assert_array_equal(one.term.vector, shown)


def test_what_explains_only_with_a_size_that_hardly_happens_is_said_to() -> None:
    """A frame tilted by twenty-nine degrees explains everything, and may stand for anything."""
    robot = load_robot(COGIRO)
    data = measured(robot, [term(robot, "gravity_tilt", tilt_x_rad=0.51)], points=18, seed=3)
    found = crosscheck.diagnose(robot, data, only=["gravity_tilt", "stiffness", "pulley_radius"])
    assert [one.effect for one in found.missing] == ["gravity_tilt"]
    assert any(
        note.startswith("gravity_tilt would be 51 times its plausible size") for note in found.notes
    )


def test_a_target_may_sit_anywhere() -> None:
    """Where it sits, a user may have forgotten to say: 0.15 m is sixty plausible sizes."""
    robot = load_robot(COGIRO)
    assert not hardly_happens(term(robot, "tracker_target", shift_z_m=0.15))
    assert not hardly_happens(term(robot, "tracker_frame", shift_z_m=3.0))
    assert hardly_happens(term(robot, "gravity_tilt", tilt_x_rad=0.51))
    assert not hardly_happens(term(robot, "gravity_tilt", tilt_x_rad=0.49))


def found(count: int, stderr: Array) -> Any:
    """A listed effect of so many parameters, with their standard errors."""

    class Parameters(list[int]):
        shape = np.zeros(count, bool)

    layout = Parameters(range(count))
    return SimpleNamespace(effect="external_wrench", probability=1.0, layout=layout, stderr=stderr)


def test_what_the_steps_leave_open_is_looked_at_in_sets() -> None:
    """Of five effects none paid for itself, and one of them was sure: sets name it."""
    listed = found(6, np.ones(6))
    large = found(8, np.ones(8))
    hidden, partly = found(6, np.full(6, np.inf)), found(6, np.where(np.arange(6) > 1, np.inf, 1.0))
    unlikely: Any = SimpleNamespace(**{**vars(listed), "probability": 0.9})
    nearly: Any = SimpleNamespace(**{**vars(listed), "probability": 0.96})
    first, more = (("external_wrench",), 1.0), (("stiffness", "platform_mass"), 0.99)
    unsure: Any = SimpleNamespace(why_not=Reason(Why.NOT_SURE, p=0.6))
    for missing, classes, candidates, clear, *imitated in (
        ([listed], (first,), (), True),
        ([listed], (first,), (), False, NOT_ASKED),
        ([large, large, listed], (first,), (), True),
        ([large, large, large], (first,), (), False),
        ([listed], (first, more), (), False),
        ([listed], (first, (("creep",), 0.6)), (), False),
        ([listed], (first, (("creep",), 0.4)), (), True),
        ([listed], (first, (("creep", "stiffness"), 0.9)), (), True),
        ([nearly], (first, (("creep", "stiffness"), 0.6)), (), False),
        ([nearly], (first, (("creep", "stiffness"), 0.4)), (), True),
        ([unlikely], (first,), (), False),
        ([hidden], (first,), (), False),
        ([partly], (first,), (), True),
        ([], (), (unsure,), False),
        ([], (), (SimpleNamespace(why_not=Reason(Why.UNSEEN)),), True),
    ):
        chances = Chances({}, classes, None, None, imitated=next(iter(imitated), None))
        steps: Any = SimpleNamespace(missing=missing, chances=chances, candidates=candidates)
        assert is_clear(steps) is clear


def test_of_an_effect_only_a_shape_that_is_determined_says_nothing_about_its_size() -> None:
    one = found(3, np.array([np.inf, np.inf, 0.1]))
    assert not is_undetermined(one)
    one.layout.shape[2] = True
    assert is_undetermined(one)


def test_small_effects_of_the_steps_are_listed_beside_what_others_imitate(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Pulleys were not, beside a platform that flexes, which drums out of round imitate."""
    imitated = Imitated(9.0, frozenset({"creep"}), (Varying.WINCHES,))
    said = Judgement(DiagnosisVerdict.UNKNOWN_EFFECT, (), 0.0, imitated=imitated)
    best = SimpleNamespace(names=frozenset({"creep", "pulley_radius", "stiffness"}))
    nothing: Any = None
    sets: Any = SimpleNamespace(best=best)
    sought = SetSearch(nothing, sets, nothing, nothing, 0.0, None, said, imitated)
    warranted = {"pulley_radius": 1.0, "creep": 1.0, "stiffness": 0.9, "backlash": 1.0}
    listed = [SimpleNamespace(effect=n, probability=p) for n, p in warranted.items()]
    monkeypatch.setattr(unexplained, "chances_of", lambda _sought: None)
    monkeypatch.setattr(unexplained, "_warranted", lambda *_: (listed, None))
    now = beside_imitated(nothing, sought).judgement
    assert now.sure == ("pulley_radius",) and now.imitated is imitated
    # what sets say for themselves goes first, and without something unknown nothing changes
    for other in (replace(said, sure=("stiffness",)), replace(said, imitated=None)):
        asked = replace(sought, judgement=other)
        assert beside_imitated(nothing, asked) is asked


def test_what_takes_a_kind_of_reading_farther_off_is_not_there() -> None:
    """A tracker that lags behind was called backlash, with angles twice as far off."""

    def step(position: float, orientation: float | None) -> Any:
        rms = {"position_rms_m": position, "orientation_rms_rad": orientation}
        return SimpleNamespace(held_out=SimpleNamespace(rms=rms))

    before = step(3e-4, 1.0)
    assert spoils(before, step(1e-4, 1.2)) and spoils(before, step(3.4e-4, 0.1))
    assert not spoils(before, step(1e-4, 1.05)) and not spoils(step(3e-4, None), step(1e-4, None))


def test_the_steps_vouch_for_what_sets_leave_beside_something_unknown(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    imitated = Imitated(9.0, frozenset({"creep"}), (Varying.WINCHES,))
    said = Judgement(DiagnosisVerdict.UNKNOWN_EFFECT, (), 0.0, imitated=imitated)
    sought, vouched = SimpleNamespace(judgement=said), object()
    noisy = SimpleNamespace(whiteness=SimpleNamespace(is_noise=False))
    steps = SimpleNamespace(last=noisy, steps=())
    data = SimpleNamespace(data=SimpleNamespace(sigma=None))
    ready: Any = SimpleNamespace(problem=data, terms=None)
    monkeypatch.setattr(verdict, "Beginning", lambda *_: nullcontext())
    monkeypatch.setattr(verdict, "by_steps", lambda *_: (steps, ()))
    monkeypatch.setattr(verdict, "pairs_instead", lambda _steps: [])
    monkeypatch.setattr(verdict, "search_sets", lambda *_: sought)
    monkeypatch.setattr(verdict, "beside_imitated", lambda *given: (given, vouched))
    monkeypatch.setattr(verdict, "explained", lambda shown, _notes: shown)
    nothing: Any = None
    told: Any = verdict._searched(ready, nothing, nothing, (), lambda _text, _part: None)
    assert told == ((steps, sought), vouched)


@pytest.mark.parametrize("spoilt", [False, True])
def test_no_step_is_listed_that_spoils_something(
    monkeypatch: pytest.MonkeyPatch, spoilt: bool
) -> None:
    for module in (small, unexplained):
        monkeypatch.setattr(module, "share_of", lambda *_: 1.0)
        monkeypatch.setattr(module, "spoils", lambda *_: spoilt)
        monkeypatch.setattr(module, "beyond_smooth", lambda *_: True)
    monkeypatch.setattr(unexplained, "is_plausible", lambda _term: True)
    fit = SimpleNamespace(
        state=None, at_bound=np.zeros(1, dtype=bool), valid=True, terms=Terms([HEAVY])
    )
    step = SimpleNamespace(fit=fit, held_out=None, candidates=())
    name = "platform_mass"
    steps: Any = SimpleNamespace(
        found=(name,), steps=(step, step), last=step, problem=None,
        trials=SimpleNamespace(refit=lambda *_: fit),
    )  # fmt: skip
    assert unexplained._is_warranted(steps, name) is not spoilt
    best = SimpleNamespace(name=name, fit=fit)
    monkeypatch.setattr(small, "_best_small", lambda *_: best)
    monkeypatch.setattr(small, "node_of", lambda *_: None)
    monkeypatch.setattr(small, "step_of", lambda *_: step)
    monkeypatch.setattr(small, "significantly_improves", lambda *_: True)
    assert small._small_step(steps, 3, 0.5) is (None if spoilt else step)
