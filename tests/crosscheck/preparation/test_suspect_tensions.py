"""Tensions in kgf, lbf or grams are told from all that a model may lack; others are let alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from made_data import measured, soft_cogiro, term

import crosscheck
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.measurements.read import together
from crosscheck.preparation.exchanged import Pulls
from crosscheck.preparation.prepare import prepare
from crosscheck.preparation.suspect import unit_of
from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.effects import Terms

SIGMA = Sigma(3e-5, 3.5e-4, 0.05)
COGIRO, WEIGHED = soft_cogiro(), load_robot("demobot_parallel")
FACTORS = {"kgf": 9.80665, "lbf": 4.44822, "grams (gf)": 9.80665e-3}
SAID = "times the load that the model puts on the cables"
LACKING: dict[str, Mapping[str, float]] = {
    "stiffness": {"factor": 0.5},
    "tension_scale": {"factor": 1.12},
    "platform_mass": {"added_kg": 0.1 * COGIRO.mass},
    "cable_length_offset": {f"offset_{i}_m": 4e-4 * (-1) ** (i // 2) for i in range(1, 9)},
}


@cache
def read_of(lacking: str = "") -> Measurements:
    """Poses and tensions of a robot that has an effect."""
    names = dict(LACKING.get(lacking, {}))
    terms = [term(COGIRO, lacking, **names)] if lacking else []
    return measured(COGIRO, terms, points=3, sigma=SIGMA, tensions=True)


def told(data: Measurements, robot: Robot = COGIRO) -> list[str]:
    return [note for note in prepare(robot, data, Terms()).notes if "ension" in note]


def in_unit(data: Measurements, newtons: float) -> Measurements:
    return replace(data, tensions=data.tensions / newtons)


@pytest.mark.parametrize("lacking", ["", *LACKING])
@pytest.mark.parametrize("unit", FACTORS)
def test_the_unit_is_named_whatever_the_model_lacks(unit: str, lacking: str) -> None:
    (said,) = told(in_unit(read_of(lacking), FACTORS[unit]))
    assert SAID in said and f"are they in {unit}, or" in said
    assert f"of {FACTORS[unit]:.6g} N each" in said


@pytest.mark.parametrize("lacking", ["", *LACKING])
def test_newtons_are_let_alone(lacking: str) -> None:
    assert told(read_of(lacking)) == []


@pytest.mark.parametrize("factor", [0.6, 0.35, 0.16, 0.06, 2.0, 5.0])
def test_what_is_no_unit_is_not_called_one(factor: float) -> None:
    assert told(in_unit(read_of(), 1.0 / factor)) == []


@pytest.mark.parametrize(("factor", "said"), [(30.0, True), (0.03, True), (8.0, False)])
def test_another_order_is_said_without_a_unit(factor: float, said: bool) -> None:
    notes = told(in_unit(read_of(), 1.0 / factor))
    assert len(notes) == said and all("is it another unit, the file of" in one for one in notes)


def test_slack_cables_count_for_nothing() -> None:
    """On fishing line most of the cables of this robot are slack somewhere."""
    data = measured(WEIGHED, points=3, sigma=SIGMA, tensions=True)
    assert (data.tensions < 0.1).mean() > 0.1
    assert told(data, WEIGHED) == []
    (said,) = told(in_unit(data, 9.80665), WEIGHED)
    assert "are they in kgf" in said


def test_pretension_that_is_gone_is_no_unit() -> None:
    """Cables that only carry the load, where the model strains them four times as much."""
    robot = load_robot("ipanema")
    data = measured(robot, points=2, sigma=SIGMA, tensions=True)
    looser = replace(robot, rest_lengths=robot.rest_lengths * 1.004)
    left = measured(looser, points=2, sigma=SIGMA, tensions=True)
    part = float(np.median(left.tensions.sum(axis=1) / data.tensions.sum(axis=1)))
    assert part < 0.3  # as if in lbf
    assert not any(SAID in one for one in told(left, robot))
    (said,) = told(in_unit(left, 9.80665), robot)
    assert "are they in kgf" in said


def test_where_a_cable_was_not_read_nothing_is_known_of_the_load() -> None:
    data = read_of()
    some = data.tensions.copy()
    some[:, 3] = np.nan
    partly = replace(data, tensions=some, tension_mask=np.isfinite(some).any(axis=0))
    assert not any(SAID in one for one in told(in_unit(partly, 9.80665)))


def test_without_pretension_any_cable_tells() -> None:
    robot = load_robot("planar_two_cable")
    data = measured(robot, points=3, sigma=SIGMA, tensions=True)
    some = data.tensions.copy()
    some[:, 1] = np.nan
    partly = replace(data, tensions=some, tension_mask=np.isfinite(some).any(axis=0))
    assert not any(SAID in one for one in told(partly, robot))
    (said,) = told(in_unit(partly, 4.44822), robot)
    assert "are they in lbf" in said


def test_of_two_files_the_one_is_named() -> None:
    one = replace(read_of(), path=Path("monday.csv"))
    other = replace(in_unit(read_of(), 9.80665), path=Path("tuesday.csv"))
    (said,) = told(together([one, other]))
    assert said.startswith("tuesday.csv: The measured tensions carry 0.101 times the load")


def test_a_comparison_tells_and_changes_nothing() -> None:
    found = crosscheck.compare(COGIRO, in_unit(read_of(), 9.80665))
    assert sum(SAID in note for note in found.notes) == 1
    assert found.rms["tension_rms_N"] > 0.5


def test_a_unit_needs_rows_that_agree() -> None:
    assert unit_of(np.full(4, 1.0 / 9.80665)) == "kgf"
    assert unit_of(np.full(3, 1.0 / 9.80665)) is None and unit_of(np.ones(9)) is None
    assert unit_of(np.array([0.02, 0.02, 0.102, 0.102, 0.102, 0.4, 0.4])) is None


def test_the_carried_part_is_one_where_tensions_are_as_expected() -> None:
    ready = prepare(COGIRO, read_of(), Terms()).problem
    at = ready.experiment.predict(())
    part = Pulls.of(ready, at).carried()
    np.testing.assert_allclose(part, 1.0, atol=0.1)
