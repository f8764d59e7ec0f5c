"""Of long logs a search takes some rows, the way to them as it was, and tells of the others."""

from __future__ import annotations

import functools
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import crosscheck
import seecr
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.preparation.prepare import note_on_others, thinned
from seecr.effects import Term, Terms
from seecr.pose import quat_from_rotvec
from seecr.prediction.experiment import Experiment

ROBOT = seecr.load_robot(seecr.model_path("demobot_cogiro"))
NOISE = Sigma(position_m=1e-4, orientation_rad=1e-3)
ROWS, RUNS = 1200, 3
PLAIN = Terms()


def stream(terms: Terms = PLAIN) -> Measurements:
    """Three runs of a robot that moves slowly to and fro, read all the way."""
    run = np.repeat(np.arange(RUNS), ROWS // RUNS)
    t = np.tile(np.linspace(0.0, 1.0, ROWS // RUNS), RUNS)
    pose = np.tile(ROBOT.reference_pose, (ROWS, 1))
    pose[:, 0] += 0.1 * np.sin(9.0 * t + run)
    pose[:, 1] += 0.06 * np.sin(5.0 * t + 2.0 * run)
    pose[:, 2] -= 0.03 * np.sin(4.0 * t)
    data = Measurements(
        Path("stream.csv"), ROBOT.n_cables, np.char.add("run ", run.astype(str)),
        command_pose=pose, t_s=np.arange(ROWS, dtype=float), sigma=NOISE,
    )  # fmt: skip
    read = Experiment(ROBOT, data.as_commands(ROBOT)).predict(terms.effects).readings
    random = np.random.default_rng(1)
    off = NOISE.position_m * random.standard_normal((ROWS, 3))
    return replace(data, position=read.position + off)


def test_few_rows_are_all_taken() -> None:
    data = stream()
    some, others = thinned(ROBOT, data, ROWS)
    assert some is data
    assert not others.any() and note_on_others(ROBOT, data, others, PLAIN, NOISE) == []


def test_rows_are_taken_evenly_in_each_run_and_the_others_are_those_left() -> None:
    data = stream()
    some, others = thinned(ROBOT, data, 120)
    taken = ~others
    assert taken[::10].all() and taken[np.flatnonzero(np.diff(data.run_index))].all() and taken[-1]
    assert 120 <= some.n_rows < 200  # and where a cable turns round
    assert some.line.tolist() == data.line[taken].tolist()
    assert "one in 10" in some.notes[-1] and " rows of 1200: " in some.notes[-1]


def test_lengths_turn_round_at_rows_that_are_taken() -> None:
    """Play in the winches is the same at the rows that are left, but for the smallest turns."""
    backlash = Terms([Term.of(ROBOT, "backlash", gap_m=2e-3)])
    data = stream(backlash)
    some, others = thinned(ROBOT, data, 60)
    whole, some = (
        Experiment(ROBOT, one.as_commands(ROBOT)).predict(backlash.effects).pose[:, :3]
        for one in (data, some)
    )
    plain = Experiment(ROBOT, data.as_commands(ROBOT)).predict().pose[:, :3]
    taken = ~others
    off = np.abs(some - whole[taken]).max(axis=1)
    assert np.median(np.abs(whole - plain).max(axis=1)) > 5e-4
    assert off.max() < 1e-4 and np.mean(off > 1e-6) < 0.02


def test_of_poses_in_no_order_the_first_of_each_run_are_taken() -> None:
    data = stream()
    mixed = np.random.default_rng(2).permutation(ROWS)
    data = replace(data, command_pose=data.command_pose[mixed], position=data.position[mixed])
    some, others = thinned(ROBOT, data, 120)
    place = np.arange(ROWS) % (ROWS // RUNS)
    assert others.tolist() == (place >= ROWS // RUNS // 10).tolist()
    assert "in no order" in some.notes[-1]


@pytest.mark.parametrize("most", [100, 150, 300])
def test_of_runs_that_alternate_some_of_each_kind_are_taken(most: int) -> None:
    """Each place was gone to from two sides; every second run came from one of them."""
    data = stream()
    to_and_fro = replace(data, run=np.char.add("run ", (np.arange(ROWS) // 2).astype(str)))
    some, others = thinned(ROBOT, to_and_fro, most)
    taken = np.char.replace(np.unique(some.run), "run ", "").astype(int)
    assert most / 2 < len(some.run) < 1.1 * most
    assert re.search(r"of one run in \d+; `add`", some.notes[-1])
    assert others.sum() + some.n_rows == ROWS
    for period in (2, 3, 4, 6):
        counts = np.bincount(taken % period, minlength=period)
        assert counts.min() > 0.7 * counts.mean(), period


def test_of_fewer_runs_all_are_kept_though_more_rows_are_left() -> None:
    """Half of 760 runs tell as much as all, in half of the time; of forty each may be a place."""
    data = stream()
    fewer = replace(data, run=np.char.add("run ", (np.arange(ROWS) // 30).astype(str)))
    some, _others = thinned(ROBOT, fewer, 120)
    assert 120 < some.n_rows <= 240
    assert len(np.unique(some.run)) == 40


def test_the_others_are_predicted_to_the_noise_by_the_model_that_is_there_alone() -> None:
    terms = Terms([Term.of(ROBOT, "pulley_radius", radius_m=0.02)])
    data = stream(terms)
    _some, others = thinned(ROBOT, data, 120)
    (well,) = note_on_others(ROBOT, data, others, terms, NOISE)
    (badly,) = note_on_others(ROBOT, data, others, PLAIN, NOISE)
    assert "not used in any fit, predicted to 0.1" in well and "outlier" not in well
    assert well != badly


def test_rows_far_off_are_no_part_of_what_is_told_of_the_others() -> None:
    data = stream()
    data.position[1::100] += 0.05
    _some, others = thinned(ROBOT, data, 120)
    (said,) = note_on_others(ROBOT, data, others, PLAIN, NOISE)
    far = others[1::100].sum()
    assert far > 8 and "predicted to 0.1" in said
    assert said.endswith(f", except for {far} outliers")


def test_what_was_filled_in_is_no_part_of_what_is_told_of_the_others() -> None:
    plain = stream()
    tilted = plain.command_pose.copy()
    tilted[:, 3:] = quat_from_rotvec(np.outer(np.sin(np.arange(ROWS) / 20.0), [0.05, 0.03, 0.02]))
    plain = replace(plain, command_pose=tilted)
    level = replace(plain, quat_wxyz=np.tile([1.0, 0.0, 0.0, 0.0], (ROWS, 1)))
    said = [
        note_on_others(ROBOT, one, thinned(ROBOT, one, 120)[1], PLAIN, NOISE)
        for one in (plain, level)
    ]
    assert said[0] == said[1] and "deg" not in said[0][0]


@pytest.mark.slow
def test_a_diagnosis_of_some_rows_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    few = functools.partial(thinned, most=80)
    monkeypatch.setattr("crosscheck.calibration.thinned", few)
    twin = crosscheck.make_twin(ROBOT, seed=4, effects=["pulley_radius"])
    found = crosscheck.diagnose(ROBOT, twin.measured, only="pulley_radius")
    assert [one.effect for one in found.missing] == ["pulley_radius"]
    assert any(note.startswith("the search uses ") and ": one in 2" in note for note in found.notes)
    assert "not used in any fit" in found.notes[-1]
    made = crosscheck.calibrate(ROBOT, twin.measured, only="pulley_radius")
    assert "not used in any fit" in made.notes[-1]
