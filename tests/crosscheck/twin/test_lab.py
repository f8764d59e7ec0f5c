"""How a twin is measured: its noise, what is read, and which commands are taken."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crosscheck.errors import CrosscheckError
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.twin.lab import (
    Lab,
    Measured,
    key_of,
    lacking_in,
    read_of,
    rest_of,
    sweeps,
)
from crosscheck.twin.measure import Truth
from seecr.commands import Loads
from seecr.description.mjcf import load_robot
from seecr.pose import pose_difference, quat_from_rotvec

ROBOT = load_robot("planar_vertical")
N = 4000


def commands(n: int = 2, **changes: Any) -> Measurements:
    poses = np.tile(ROBOT.reference_pose, (n, 1))
    given: dict[str, Any] = {"path": Path("mine.csv"), "n_cables": 4, "run": np.full(n, "a")}
    return Measurements(**(given | {"command_pose": poses} | changes))


def truth(n: int = 2, at_rest: Any = True) -> Truth:
    """A platform turned so far that noise makes the scalar negative now and then."""
    quat = np.tile(quat_from_rotvec(np.array([0.0, np.radians(179.9), 0.0])), (n, 1))
    pose = np.concatenate([np.tile([1.0, 2.0, 3.0], (n, 1)), quat], axis=1)
    pulls = np.tile([1.0, 2.0, 3.0, 4.0], (n, 1))
    rest = np.broadcast_to(at_rest, (n,))
    return Truth(
        pose, pulls, rest, ~rest, np.zeros(n),
        position=pose[:, :3], quat_wxyz=quat, tension_readings=pulls, rest_lengths=pulls,
    )  # fmt: skip


def measured(case: Measurements, sigma: Sigma, at_rest: Any = True) -> Measured:
    found = truth(case.n_rows, at_rest)
    return Measured(case, found, found, sigma, [], found.at_rest, np.ones(3, dtype=bool))


def test_noise_is_as_large_as_stated_in_every_direction() -> None:
    sigma = Sigma(1e-3, 2e-3, 0.5)
    data = read_of(measured(commands(N), sigma), np.random.default_rng(0))
    exact = truth(N)
    turn = pose_difference(
        np.concatenate([exact.position, data.quat_wxyz], axis=1),
        np.concatenate([exact.position, exact.quat_wxyz], axis=1),
    )[:, 3:]
    for off, size in (
        (data.position - exact.position, 1e-3), (turn, 2e-3), (data.tensions - exact.tensions, 0.5),
    ):  # fmt: skip
        # the standard error of a standard deviation of n normal numbers is that over sqrt(2 n)
        assert np.std(off, axis=0) == pytest.approx(np.full(off.shape[1], size), rel=4 / N**0.5)
        assert np.abs(np.mean(off, axis=0)).max() < 4 * size / N**0.5
    both = np.concatenate([data.position, turn], axis=1)
    assert np.abs(np.corrcoef(both.T) - np.eye(6)).max() < 4 / N**0.5
    assert np.all(data.quat_wxyz[:, 0] >= 0.0) and data.sigma is sigma
    assert np.linalg.norm(data.quat_wxyz, axis=1) == pytest.approx(1.0)


def test_nothing_is_read_at_way_points_and_without_rest() -> None:
    position = np.zeros((4, 3))
    position[1] = np.nan  # a way point
    data = read_of(
        measured(commands(4, position=position), Sigma(1e-3, 1e-3, 0.1), [True, True, False, True]),
        np.random.default_rng(0),
    )
    assert data.read.tolist() == [True, False, False, True]
    for part in (data.position, data.quat_wxyz, data.tensions):
        assert np.isnan(part).all(axis=1).tolist() == [False, True, True, False]
    none = read_of(measured(commands(2), Sigma(1e-3, 1e-3)), np.random.default_rng(0))
    assert none.read.all() and np.isnan(none.tensions).all()


def test_commands_are_the_same_to_a_tenth_of_a_nanometre() -> None:
    case = commands()
    key = key_of(case)
    signs = np.where(case.command_pose == 0.0, -0.0, case.command_pose)
    assert key_of(replace(case, command_pose=signs)) == key
    assert key_of(replace(case, command_pose=case.command_pose + 1e-10)) == key
    assert key_of(replace(case, command_pose=case.command_pose + 2e-9)) != key
    hung = Loads.of(2, mass=np.array(0.1))
    mass = key_of(replace(case, loads=hung))
    assert mass != key
    there = Loads.of(2, mass=np.array(0.1), centre=np.array([0.0, 0.0, -0.1]))
    pushed = Loads.of(2, mass=np.array(0.1), wrench=np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0]))
    assert len({key, mass, *(key_of(replace(case, loads=one)) for one in (there, pushed))}) == 4
    nowhere = Loads.of(2, mass=np.array(0.1), centre=np.zeros(3), wrench=np.zeros(6))
    assert key_of(replace(case, loads=nowhere)) == mass
    assert len(key) == 4


def test_the_hall_warms_up_by_a_few_degrees_and_the_way_is_that_of_every_seed() -> None:
    one, other = (sweeps(ROBOT, 5, 1.0, seed) for seed in (1, 2))
    np.testing.assert_array_equal(one.command_pose, other.command_pose)
    for case in (one, other):
        warm = case.temperature_C
        assert warm is not None and abs(warm[0] - 20.0) < 0.5
        assert 2.0 < warm[-1] - warm[0] < 6.5 and np.all(np.round(warm, 2) == warm)
    assert np.abs(one.temperature_C - other.temperature_C).max() > 0.05


@dataclass(frozen=True, eq=False)
class Fake(Lab):
    """One in which MuJoCo rests at these parts of the rows, by the number of rows."""

    rests: Any = None

    def measure(self, case: Measurements, effects: Any, now: str) -> Truth:
        n = case.n_rows
        return truth(n, np.arange(n) < self.rests[n] * n)


def rested(rests: dict[int, float], tensions: bool = False) -> Measured:
    lab = Fake(ROBOT, 0, Sigma(length_m=1e-4), tensions, lambda _rows, _now: None, rests=rests)
    return rest_of(lab, [commands(n) for n in rests], [])


def test_the_first_commands_that_rest_nearly_everywhere_are_taken() -> None:
    found = rested({100: 0.94, 200: 0.95, 300: 1.0})
    assert found.case.n_rows == 200 and found.at_rest.sum() == 190 and found.truth is found.plain


def test_noise_that_is_not_stated_is_that_of_a_good_tracker_in_one_digit() -> None:
    sigma = rested({10: 1.0}, tensions=True).sigma
    length = ROBOT.reference_lengths.mean()
    assert sigma.position_m == pytest.approx(6e-5 * length, rel=0.5)
    assert float(f"{sigma.position_m:.0e}") == sigma.position_m
    assert (sigma.length_m, sigma.tension_N) == (1e-4, 0.05)  # 2 % of 2.5 N
    assert rested({10: 1.0}).sigma.tension_N is None


def test_where_nothing_rests_it_is_said_of_which_commands() -> None:
    with pytest.raises(CrosscheckError, match=r"no stable rest along the commands of mine\.csv;"):
        rested({10: 0.9})
    with pytest.raises(CrosscheckError, match="along the twin's commands, however close"):
        rested({10: 0.9, 20: 0.9})


def test_what_the_commands_lack_is_said() -> None:
    assert set(lacking_in(commands())) == {"time", "temperature"}
    lengths = np.ones((2, 4))
    whole = commands(
        command_pose=None, command_lengths=lengths, t_s=np.arange(2.0), temperature_C=np.zeros(2)
    )
    assert set(lacking_in(whole)) == {"poses"} and lacking_in(replace(whole, told=True)) == {}
