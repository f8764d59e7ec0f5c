"""Columns that were exchanged and tensions in other units are named, only where that is certain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from made_data import measured, soft_cogiro, term

import crosscheck
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.measurements.read import load_measurements, together
from crosscheck.preparation.exchanged import Pulls, exchanged_lengths
from crosscheck.preparation.prepare import prepare
from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot
from seecr.effects import Terms
from seecr.pose import Array

SIGMA = Sigma(3e-5, 3.5e-4, 0.02)
COGIRO = soft_cogiro()
LACKING = {
    "": {},
    "stiffness": {"factor": 0.6},
    "platform_mass": {"added_kg": 0.2 * COGIRO.mass},
    "tension_scale": {"factor": 1.15},
    "pulley_radius": {"radius_m": 0.008},
    "cable_length_offset": {f"offset_{i}_m": 4e-4 * (-1) ** (i // 2) for i in range(1, 9)},
}


@cache
def read_of(lacking: str = "", robot: str = "") -> Measurements:
    """Poses and tensions of a robot that has an effect."""
    one = load_robot(robot) if robot else COGIRO
    terms = [term(one, lacking, **LACKING[lacking])] if lacking else []
    return measured(one, terms, points=4, sigma=SIGMA, tensions=True)


@cache
def by_lengths(told: bool = False) -> Measurements:
    """The same robot, commanded in lengths."""
    data = read_of()
    lengths = COGIRO.commanded_lengths(data.command_pose)
    return replace(data, command_pose=None, command_lengths=lengths, told=told)


def order(*cycle: int, m: int = 8) -> Array:
    """The order in which each column of a cycle, counted from 1, holds the next one's."""
    out = np.arange(m)
    out[[i - 1 for i in cycle]] = [i - 1 for i in (*cycle[1:], cycle[0])]
    return out


def pulled(data: Measurements, by: Array) -> Measurements:
    return replace(data, tensions=data.tensions[:, by])


def paid_out(data: Measurements, by: Array) -> Measurements:
    assert data.command_lengths is not None
    return replace(data, command_lengths=data.command_lengths[:, by])


def told(data: Measurements, robot: Robot = COGIRO) -> list[str]:
    return [note for note in prepare(robot, data, Terms()).notes if "exchanged" in note]


@pytest.mark.parametrize("lacking", LACKING)
def test_columns_in_their_order_are_let_alone(lacking: str) -> None:
    assert told(read_of(lacking)) == []


@pytest.mark.parametrize("lacking", LACKING)
@pytest.mark.parametrize("pair", [(1, 7), (2, 5), (3, 8)])
def test_exchanged_tensions_are_named_whatever_the_model_lacks(
    lacking: str, pair: Sequence[int]
) -> None:
    (said,) = told(pulled(read_of(lacking), order(*pair)))
    assert said.startswith(f"The columns tension_{pair[0]} and tension_{pair[1]} seem exchanged: ")
    assert said.endswith("They are taken as they stand.")


def test_the_note_says_how_much_of_the_load_is_unbalanced() -> None:
    (said,) = told(pulled(read_of(), order(2, 5)))
    words = said.split("leave ")[1].replace(",", "").split()
    here, there = float(words[0]), float(words[words.index("and") + 1])
    assert here > 0.3 and there < 0.1


def test_of_three_each_one_is_named_with_its_cable() -> None:
    (said,) = told(pulled(read_of(), order(1, 2, 6)))
    assert said.startswith("The columns tension_1, tension_2 and tension_6 seem exchanged (tension")
    assert "(tension_1 is of cable 2, tension_2 is of cable 6, tension_6 is of cable 1): " in said


@pytest.mark.parametrize("name", ["ipanema", "camera", "planar_vertical", "demobot_parallel"])
def test_other_robots(name: str) -> None:
    robot = load_robot(name)
    data = measured(robot, points=4, sigma=Sigma(1e-4, 3.5e-4, 0.02), tensions=True)
    assert told(data, robot) == []
    (said,) = told(pulled(data, order(1, 2, m=robot.n_cables)), robot)
    assert "tension_1 and tension_2 seem exchanged" in said


def test_in_another_unit_they_are_named_all_the_same() -> None:
    data = pulled(read_of(), order(2, 5))
    finer = replace(SIGMA, tension_N=0.02 / 9.80665)
    (said,) = told(replace(data, tensions=data.tensions / 9.80665, sigma=finer))
    assert "tension_2 and tension_5 seem exchanged" in said


def test_cables_that_pull_alike_show_no_exchange() -> None:
    """On the middle line of a robot that is its own mirror, so do the cables of either side."""
    robot = load_robot("demobot_parallel")
    data = measured(robot, points=4, sigma=SIGMA, tensions=True)
    assert data.command_pose is not None
    pairs = np.abs(data.tensions[:, :, None] - data.tensions[:, None, :])
    level = np.abs(data.command_pose[:, 1] - 0.25) < 1e-9
    same = np.argwhere((pairs[level].max(axis=0) < 0.2) & ~np.eye(8, dtype=bool))
    assert level.sum() >= 8 and len(same) > 0
    i, j = (int(k) + 1 for k in same[0])
    assert told(pulled(data.rows(level), order(i, j)), robot) == []


def test_a_cable_that_was_not_read_hides_what_is_held() -> None:
    data = pulled(read_of(), order(2, 5))
    some = data.tensions.copy()
    some[:, 0] = np.nan
    assert told(replace(data, tensions=some)) == []


def test_what_is_less_than_the_noise_names_nothing() -> None:
    """The better order is so by luck: noise may leave as much unbalanced."""
    data = pulled(read_of(), order(2, 5))
    assert told(replace(data, sigma=replace(SIGMA, tension_N=3.0))) == []
    lengths = paid_out(by_lengths(), order(2, 5))
    assert told(replace(lengths, sigma=replace(SIGMA, position_m=1.0))) == []


def test_where_all_cables_are_exchanged_positions_must_say_that_no_axis_is() -> None:
    robot = load_robot("planar_two_cable")
    data = pulled(measured(robot, points=4, sigma=SIGMA, tensions=True), order(1, 2, m=2))
    (said,) = told(data, robot)
    assert "tension_1 and tension_2 seem exchanged" in said
    nowhere = np.full_like(data.position, np.nan)
    blind = replace(data, position=nowhere)
    assert told(blind, robot) == []


def test_of_two_files_the_one_is_named() -> None:
    one = replace(read_of(), path=Path("monday.csv"))
    other = replace(pulled(read_of(), order(2, 5)), path=Path("tuesday.csv"))
    (said,) = told(together([one, other]))
    assert said.startswith("tuesday.csv: The columns tension_2 and tension_5 seem exchanged")
    other = replace(in_unit(read_of(), 9.80665), path=Path("tuesday.csv"))
    (said,) = said_of(together([one, other]))
    assert said.startswith("tuesday.csv: The measured tensions carry 0.10")


@pytest.mark.parametrize("kind", [False, True], ids=["absolute", "told"])
@pytest.mark.parametrize("pair", [(2, 5), (4, 7)])
def test_exchanged_lengths_are_named(pair: Sequence[int], kind: bool) -> None:
    data = by_lengths(kind)
    assert told(data) == []
    (said,) = told(paid_out(data, order(*pair)))
    assert said.startswith(f"The columns length_{pair[0]} and length_{pair[1]} seem exchanged: ")
    assert "mm from the straight lengths at the measured poses" in said


def test_constant_offsets_of_lengths_hide_no_exchange() -> None:
    data = paid_out(by_lengths(), order(2, 5))
    shifted = data.command_lengths + np.linspace(-0.5, 0.5, 8)
    (said,) = told(replace(data, command_lengths=shifted))
    assert "length_2 and length_5 seem exchanged" in said


def test_lengths_are_told_from_positions_alone() -> None:
    data = replace(paid_out(by_lengths(), order(2, 5)), quat_wxyz=None)
    (said,) = told(data)
    assert "length_2 and length_5 seem exchanged" in said
    nowhere = np.full_like(data.position, np.nan)
    assert told(replace(data, position=nowhere)) == []


def test_a_frame_that_is_turned_round_is_no_exchange() -> None:
    """All four cables of the camera seem to be those across: the tracker may look from behind."""
    robot = load_robot("camera")
    data = measured(robot, points=4, sigma=Sigma(1e-3, 3.5e-4))
    lengths = robot.commanded_lengths(data.command_pose)
    lengths = lengths[:, [2, 3, 0, 1]]
    assert told(replace(data, command_pose=None, command_lengths=lengths), robot) == []


def test_a_comparison_tells_and_changes_nothing() -> None:
    data = pulled(read_of(), order(2, 5))
    found = crosscheck.compare(COGIRO, data)
    assert sum("seem exchanged" in note for note in found.notes) == 1
    np.testing.assert_array_equal(found.problem.data.tensions, data.tensions)
    found = crosscheck.compare(COGIRO, in_unit(read_of(), 9.80665))
    assert sum(SAID in note for note in found.notes) == 1
    assert found.rms["tension_rms_N"] > 0.5


def test_neither_trial_data_nor_real_robots_are_doubted(shared_data: Path) -> None:
    folders = [f.parent for f in sorted(shared_data.glob("*/*/measured.csv"))]
    assert len(folders) >= 32
    for folder in folders:
        robot = load_robot(folder / "robot.xml")
        notes = prepare(robot, load_measurements(folder / "measured.csv", robot), Terms()).notes
        assert not any("exchanged" in one or "as if they were in" in one for one in notes), folder


@pytest.mark.parametrize("pair", [(1, 2), (2, 4), (3, 4)])
def test_lengths_of_a_real_robot(shared_data: Path, pair: Sequence[int]) -> None:
    folder = shared_data / "real" / "hangprinter"
    robot = load_robot(folder / "robot.xml")
    data = load_measurements(folder / "measured.csv", robot)
    (said,) = told(paid_out(data, order(*pair, m=4)), robot)
    assert f"length_{pair[0]} and length_{pair[1]} seem exchanged" in said


def exchanges(apart: Array) -> dict[int, int]:
    """The exchange that misfits (m, m) of column i and cable j, of 20 rows, show."""
    return exchanged_lengths(apart, 20)


def test_only_one_order_that_fits_far_better_is_named() -> None:
    swapped = np.array([[9.0, 1.0, 8.0], [1.0, 9.0, 8.0], [8.0, 8.0, 1.0]])
    assert exchanges(swapped) == {0: 1, 1: 0}
    assert exchanged_lengths(swapped, 8) != exchanged_lengths(swapped, 7) == {}
    one_way = swapped.copy()
    one_way[1, 0] = 5.0
    assert exchanges(one_way) == {}
    unlike_the_others = swapped.copy()
    unlike_the_others[2, 2] = 0.2
    assert exchanges(unlike_the_others) == {}
    own = np.array([[1.0, 9.0, 8.0], [9.0, 1.0, 8.0], [8.0, 8.0, 1.0]])
    assert exchanges(own) == {}
    three = np.full((6, 6), 9.0) - 8.0 * np.eye(6)
    three[:3, :3] = [[9.0, 1.0, 1.0], [1.0, 9.0, 1.0], [1.0, 1.0, 9.0]]
    assert exchanges(three) == {}  # 1 2 3 to 2 3 1 or to 3 1 2
    three[:3, :3] = [[9.0, 1.0, 9.0], [9.0, 9.0, 1.0], [1.0, 9.0, 9.0]]
    assert exchanges(three) == {0: 1, 1: 2, 2: 0}
    pairs = 9.0 - 8.0 * np.eye(6)[[1, 0, 3, 2, 4, 5]]
    assert exchanges(pairs) == {0: 1, 1: 0, 2: 3, 3: 2}


FACTORS = {"kgf": 9.80665, "lbf": 4.44822, "grams (gf)": 9.80665e-3}
SAID = "times the load that the model puts on the cables"


def said_of(data: Measurements, robot: Robot = COGIRO) -> list[str]:
    return [note for note in prepare(robot, data, Terms()).notes if "ension" in note]


def in_unit(data: Measurements, newtons: float) -> Measurements:
    return replace(data, tensions=data.tensions / newtons)


@pytest.mark.parametrize("lacking", LACKING)
@pytest.mark.parametrize("unit", FACTORS)
def test_the_unit_is_named_whatever_the_model_lacks(unit: str, lacking: str) -> None:
    (said,) = said_of(in_unit(read_of(lacking), FACTORS[unit]))
    assert SAID in said and f"are they in {unit}, or" in said
    assert f"of {FACTORS[unit]:.6g} N each" in said


def test_a_row_that_is_far_off_hides_no_unit() -> None:
    data = in_unit(read_of(), 9.80665)
    data.tensions[2] *= 5.0
    (said,) = said_of(data)
    assert "are they in kgf, or" in said


@pytest.mark.parametrize("lacking", LACKING)
def test_newtons_are_let_alone(lacking: str) -> None:
    assert said_of(read_of(lacking)) == []


@pytest.mark.parametrize("factor", [0.6, 0.35, 0.16, 0.06, 2.0, 5.0])
def test_what_is_no_unit_is_not_called_one(factor: float) -> None:
    assert said_of(in_unit(read_of(), 1.0 / factor)) == []


@pytest.mark.parametrize(("factor", "said"), [(30.0, True), (0.03, True), (8.0, False)])
def test_another_order_is_said_without_a_unit(factor: float, said: bool) -> None:
    notes = said_of(in_unit(read_of(), 1.0 / factor))
    assert len(notes) == said and all("is it another unit, the file of" in one for one in notes)


def test_slack_cables_count_for_nothing() -> None:
    """On fishing line most of the cables of this robot are slack somewhere."""
    robot = load_robot("demobot_parallel")
    data = measured(robot, points=3, sigma=SIGMA, tensions=True)
    assert (data.tensions < 0.1).mean() > 0.1
    assert said_of(data, robot) == []
    (said,) = said_of(in_unit(data, 9.80665), robot)
    assert "are they in kgf" in said


def test_pretension_that_is_gone_is_no_unit() -> None:
    """Cables that only carry the load, where the model strains them four times as much."""
    robot = load_robot("ipanema")
    data = measured(robot, points=2, sigma=SIGMA, tensions=True)
    looser = replace(robot, rest_lengths=robot.rest_lengths * 1.004)
    left = measured(looser, points=2, sigma=SIGMA, tensions=True)
    part = float(np.median(left.tensions.sum(axis=1) / data.tensions.sum(axis=1)))
    assert part < 0.3  # as if in lbf
    assert not any(SAID in one for one in said_of(left, robot))
    (said,) = said_of(in_unit(left, 9.80665), robot)
    assert "are they in kgf" in said


def test_where_a_cable_was_not_read_nothing_is_known_of_the_load() -> None:
    data = read_of()
    some = data.tensions.copy()
    some[:, 3] = np.nan
    partly = replace(data, tensions=some)
    assert not any(SAID in one for one in said_of(in_unit(partly, 9.80665)))


def test_without_pretension_any_cable_tells() -> None:
    robot = load_robot("planar_two_cable")
    data = measured(robot, points=3, sigma=SIGMA, tensions=True)
    some = data.tensions.copy()
    some[:, 1] = np.nan
    partly = replace(data, tensions=some)
    assert not any(SAID in one for one in said_of(partly, robot))
    (said,) = said_of(in_unit(partly, 4.44822), robot)
    assert "are they in lbf" in said


def test_where_cables_pull_against_each_other_their_resultant_says_nothing() -> None:
    """Two rows: a load of a tenth of the tensions, and one of a hundredth."""
    matrix = np.array([[1.0, -1.0, 0.0], [0.0, 0.0, 1.0]])
    pulls = Pulls(
        matrix=lambda rows: np.tile(matrix, (len(rows), 1, 1)),
        measured=np.array([[5.0, 5.0, 2.2], [5.0, 5.0, 0.2]]),
        expected=np.array([[5.0, 5.0, 1.1], [5.0, 5.0, 0.1]]),
        whole=np.ones(2, bool),
        free=False,
    )
    carried = pulls.carried()
    assert carried[0] == pytest.approx(2.0) and np.isnan(carried[1])
