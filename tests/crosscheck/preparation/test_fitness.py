"""Data that cannot carry a verdict get none, with the reason and what to do."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from called import refused, run
from made_data import case, measured, term
from made_diagnoses import SIGMA, readings, robot

from crosscheck.calibration import calibrate
from crosscheck.diagnosis.diagnose import diagnose
from crosscheck.errors import CrosscheckError
from crosscheck.fit.reasons import DiagnosisVerdict, Unfit
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.planning.design import make_plan
from crosscheck.preparation.prepare import prepare
from seecr.description.mjcf import load_robot, model_path
from seecr.effects import Term, Terms
from seecr.pose import quat_from_rotvec


@pytest.fixture(scope="module")
def data() -> Measurements:
    return readings(radius_m=0.01)


def unfit(data: Measurements) -> Unfit | None:
    refusal = prepare(robot(), data, Terms()).refusal
    return None if refusal is None else refusal.unfit


def with_position(data: Measurements, position: np.ndarray) -> Measurements:
    return replace(data, position=position)


@pytest.mark.parametrize("count", [2, 3, 4, 5])
def test_two_to_five_rows_carry_no_verdict(data: Measurements, count: int) -> None:
    few = data.rows(slice(0, count))
    found = diagnose(robot(), few)
    assert found.verdict is DiagnosisVerdict.NO_VERDICT and found.converged
    assert found.as_json()["catalogue"] == found.as_json()["classes"] == []
    assert f"only {count} poses measured" in found.sentence
    assert "add poses spread over the workspace" in found.measure_next[0]
    with pytest.raises(CrosscheckError, match=f"only {count} poses .* add poses spread") as error:
        calibrate(robot(), few)
    assert error.value.exit_status == 2


def test_a_pause_counts_once_and_a_way_back_again(data: Measurements) -> None:
    assert unfit(data.rows(slice(0, 6))) is None
    assert unfit(data.rows(np.repeat(np.arange(5), 10))) is Unfit.FEW_POSES
    assert unfit(data.rows([0, 1, 2, 1, 0, 1, 2, 1])) is None


def test_rows_that_are_all_alike_carry_no_verdict(data: Measurements) -> None:
    assert unfit(data.rows(np.zeros(20, dtype=int))) is Unfit.CONSTANT_COMMANDS
    assert data.quat_wxyz is not None
    frozen = replace(
        data, position=np.tile(data.position[:1], (data.n_rows, 1)),
        quat_wxyz=np.tile(data.quat_wxyz[:1], (data.n_rows, 1)),
        tensions=np.tile(data.tensions[:1], (data.n_rows, 1)),
    )  # fmt: skip
    assert unfit(frozen) is Unfit.FROZEN_READINGS
    assert unfit(replace(frozen, tensions=data.tensions)) is None


def test_effects_of_which_none_can_be_tried_carry_no_verdict(data: Measurements) -> None:
    """Nothing was tried, so nothing is unknown either."""
    none = np.full_like(data.tensions, np.nan)
    untold = replace(data, tensions=none)
    found = diagnose(robot(), untold, only="tension_scale")
    assert found.verdict is DiagnosisVerdict.NO_VERDICT and found.converged
    assert (
        "none of the effects considered is visible in these data: tension_scale (needs measured"
        in found.sentence
    )
    assert diagnose(robot(), data, only="tension_scale").refusal is None


class Searched(Exception):
    """The data were fit to be searched for effects, which need not be done."""


def test_noise_that_hides_all_effects_carries_no_verdict(
    data: Measurements, monkeypatch: pytest.MonkeyPatch
) -> None:
    def searched(*_args: object) -> None:
        raise Searched

    monkeypatch.setattr("crosscheck.diagnosis.diagnose.Search", searched)
    # millimetres in the place of metres
    sigma = Sigma(position_m=30.0, orientation_rad=3.5, tension_N=1e4)
    found = diagnose(robot(), replace(data, sigma=sigma))
    assert found.verdict is DiagnosisVerdict.NO_VERDICT and found.converged
    assert found.refusal is not None and found.refusal.unfit is Unfit.BLIND
    assert "noise of 30000 mm, 201 deg, 10000 N would hide every effect" in found.sentence
    assert "check the stated noise and its units" in found.measure_next[0]
    # one that some effects would show through, or that is no larger than what is there, is none
    for said in (data, replace(data, sigma=replace(data.sigma, position_m=1e-4))):
        with pytest.raises(Searched):
            diagnose(robot(), said)
    # of a few effects, or beside some, nobody can say that noise alone hides them
    dark = replace(data, sigma=sigma)
    with pytest.raises(Searched):
        diagnose(robot(), dark, only=["pulley_radius"])
    with pytest.raises(Searched):
        diagnose(robot(), dark, [Term.of(robot(), "stiffness", factor=1.1)])
    # what is off by more than that noise is no noise
    with pytest.raises(Searched):
        diagnose(robot(), with_position(dark, data.position + 300.0))


@pytest.mark.parametrize("only", ["tension_scale", "centre_of_mass"])
def test_where_nothing_of_the_catalogue_shows_there_are_no_columns(
    data: Measurements, only: str
) -> None:
    """As where one effect is asked for, and the readings do not see it: no traceback."""
    clean = readings(radius_m=0.0)
    assert not diagnose(robot(), replace(clean, tensions=None), only=[only]).missing
    dark = replace(data, sigma=Sigma(position_m=30.0, orientation_rad=3.5, tension_N=1e4))
    for blind in (replace(data, tensions=None), dark, replace(dark, tensions=None)):
        assert {e.effect for e in diagnose(robot(), blind, only=[only]).missing} <= {only}


def twice(data: Measurements, off: float) -> Measurements:
    """Each row read twice without motion in between, the second time off by so much."""
    both = data.rows(np.repeat(np.arange(data.n_rows), 2))
    shift = np.where(np.arange(both.n_rows) % 2, off, 0.0)
    return with_position(both, both.position + shift[:, None] * [0.0, 0.0, 1.0])


def test_readings_at_rest_that_are_far_apart_contradict_each_other(data: Measurements) -> None:
    assert SIGMA.position_m is not None
    assert unfit(twice(data, 3.0 * SIGMA.position_m)) is None
    apart = twice(data, 40.0 * SIGMA.position_m)
    assert unfit(apart) is Unfit.CONTRADICTION
    found = diagnose(robot(), apart)
    assert found.verdict is DiagnosisVerdict.NO_VERDICT
    assert "readings contradict each other: lines " in found.sentence
    assert "measure these poses again" in found.measure_next[0]
    # noise that nobody stated may be that large
    assert unfit(replace(apart, sigma=Sigma())) is None


def test_one_row_in_ten_may_be_far_off(data: Measurements) -> None:
    both = twice(data, 0.0)
    position = both.position.copy()
    position[1::20, 2] += 0.1
    assert unfit(with_position(both, position)) is None


def test_two_runs_that_do_not_agree_contradict_each_other(data: Measurements) -> None:
    n = data.n_rows
    both = data.rows(np.tile(np.arange(n), 2))
    names = np.concatenate([data.run, [f"{name} again" for name in data.run]])
    both = replace(both, run=names, sigma=Sigma())
    shift = np.repeat([0.0, 1.0], n)[:, None] * [1.0, 0.0, 0.0]
    # a tracker that was moved by a little is something to find, by a part of the way it is not
    assert unfit(with_position(both, both.position + 1e-3 * shift)) is None
    assert unfit(with_position(both, both.position + 0.3 * shift)) is Unfit.CONTRADICTION


@pytest.mark.slow
@pytest.mark.usefixtures("unpaged")
def test_from_the_command_line(tmp_path: Path) -> None:
    xml, data = case(tmp_path, points=3)
    lines = data.read_text().splitlines()
    data.write_text("\n".join(lines[:5]) + "\n")
    done = run("diagnose", xml, data, "--out", tmp_path / "out", "--no-recording")
    assert done.exit_code == 0 and "no_verdict: Only 4 poses" in done.stdout
    assert "next: add poses spread over the workspace" in done.stdout
    done = run("compare", xml, data, "--out", tmp_path / "out", "--no-recording")
    assert "No verdict: only 4 poses measured" in done.stdout and "agree" not in done.stdout
    # errors beyond the noise are no verdict either: once the page had none and the sentence one
    off = ("--sigma", "position=1um", "--sigma", "orientation=0.001deg")
    done = run("compare", xml, data, *off, "--out", tmp_path / "out", "--no-recording")
    assert "No verdict: only 4 poses measured" in done.stdout and "misses" not in done.stdout
    assert "times the noise." in " ".join(done.stdout.split())
    words = refused("calibrate", xml, data, "--model", tmp_path / "m.toml")
    assert "only 4 poses measured" in words and not (tmp_path / "m.toml").exists()
    # two rows: their errors are taken as noise, so that they are not so many times the noise
    data.with_suffix(".toml").unlink()
    data.write_text("\n".join(lines[:3]) + "\n")
    done = run("compare", xml, data, "--out", tmp_path / "out", "--no-recording")
    assert "are taken as noise" in done.stdout and "The errors are " not in done.stdout


def test_readings_of_what_joints_lock_carry_no_verdict() -> None:
    """Nothing was missing, it said, of a robot of which only locked rotations were read."""
    camera = load_robot(model_path("camera"))
    data = measured(camera, [term(camera, "stiffness", factor=0.5)])
    random = np.random.default_rng(0)
    turned = 1e-4 * random.standard_normal((data.n_rows, 3))
    blind = replace(
        data, position=np.full((data.n_rows, 3), np.nan), quat_wxyz=quat_from_rotvec(turned)
    )
    found = diagnose(camera, blind)
    assert found.verdict is DiagnosisVerdict.NO_VERDICT and found.converged
    assert "the robot's joints lock all parts of the pose that were read" in found.sentence
    assert "tensions" in found.measure_next[0]
    with pytest.raises(CrosscheckError, match=r"its joints lock all that would be read"):
        make_plan(camera, data, reads=["orientation"])
