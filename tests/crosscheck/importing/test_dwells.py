"""Where a body rests, which commands it rests at, which rests are left out, and their noise."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import made_recordings as made_of
import numpy as np
import pytest
from made_data import soft_cogiro
from numpy.typing import NDArray

from crosscheck.importing import import_case
from crosscheck.importing.align import as_they_are, unturned
from crosscheck.importing.case import Imported, repeated, without_strays
from crosscheck.importing.choices import ImportChoices
from crosscheck.importing.dwells import find_dwells, held_commands, joined, sample_noise
from crosscheck.importing.logs import Logged, Stream
from crosscheck.importing.take import refuse_still
from crosscheck.measurements.data import Measurements, Sigma
from seecr.commands import Loads
from seecr.errors import InputFileError
from seecr.pose import quat_from_rotvec, quat_multiply, rotvec_from_quat

T_S = np.arange(0.0, 10.0, 0.02)
STEPS = np.repeat(np.arange(5.0), 100)[:, None] * [0.1, 0.0, 0.0]
NOISE = 1e-4 * np.random.default_rng(0).standard_normal((len(T_S), 3))
HERE = np.array([0.1, 0.02, 0.03])


def log(**commands: NDArray[np.float64]) -> Measurements:
    return Measurements(Path("cmd.csv"), 2, np.array(["a"] * 5), t_s=2.0 * np.arange(5), **commands)


def poses(step: float) -> NDArray[np.float64]:
    place = step * np.arange(5.0)[:, None] * [1.0, 0.0, 0.0]
    return np.concatenate([place, np.tile([1.0, 0.0, 0.0, 0.0], (5, 1))], axis=1)


def refused(place: NDArray[np.float64], commands: Measurements, body: str | None = "base") -> None:
    bodies = {"platform": (STEPS + NOISE, None), "base": (place, None)}
    line = np.arange(len(T_S))
    export = Logged(Path("take.csv"), T_S, line, bodies, {})
    stream = Stream(export.path, T_S, line, place)
    refuse_still(stream, export, commands, ImportChoices(body=body))


@pytest.mark.parametrize("noise", [0.0, 1.0])
@pytest.mark.parametrize("told", [{"command_pose": poses(0.1)},
                                  {"command_lengths": 1.0 + poses(0.1)[:, :2]}])  # fmt: skip
def test_a_body_that_never_moves_is_named_and_so_are_the_others(
    noise: float, told: dict[str, NDArray[np.float64]]
) -> None:
    """Its speed was "0 mm/s or less" and rest "below 0 mm/s", which nobody understands."""
    within = r"0\.1\d" if noise else "0"
    expected = (
        rf"take.csv: the body base never moves: it stays within {within} mm \(rms\), while the "
        r"commands of cmd.csv move the platform; .* \(--body\)\? The file also has platform.$"
    )
    with pytest.raises(InputFileError, match=expected):
        refused(HERE + noise * NOISE, log(**told))


def test_a_body_that_moves_or_should_not_is_none() -> None:
    refused(STEPS + NOISE, log(command_pose=poses(0.1)))
    refused(1e-2 * STEPS + NOISE, log(command_pose=poses(0.1)))
    refused(HERE + NOISE, log(command_pose=poses(0.0)))
    refused(HERE + NOISE, log(command_pose=poses(1e-4)))


def test_a_reading_that_never_changes_is_a_rest() -> None:
    """Nothing was slower than not at all."""
    line = np.arange(len(T_S))
    dwells = find_dwells(Stream(Path("a"), T_S, line, np.tile(HERE, (len(T_S), 1))), np.zeros(0))
    assert len(dwells) == 1 and dwells.samples.tolist() == [len(T_S)]


def test_noise_is_known_where_no_three_samples_follow_each_other() -> None:
    """It was NaN, with a warning, and nothing moved."""
    place = NOISE.copy()
    place[1::2] = np.nan
    found = sample_noise(Stream(Path("take.csv"), T_S, np.arange(len(T_S)), place))
    assert found == pytest.approx(1e-4 * np.sqrt(3.0), rel=0.3)


ROBOT = soft_cogiro()
MADE = made_of.recording(ROBOT)


def recorded(last: int, off: float = 0.0) -> made_of.Recording:
    """Of a platform that moves no more from the command ``last`` on, where it is ``off`` [m]."""
    stops = np.searchsorted(MADE.t_s, MADE.sent_s[last])
    position, quat = MADE.position.copy(), MADE.quat.copy()
    position[stops:], quat[stops:] = position[stops - 1] + [off, 0.0, 0.0], quat[stops - 1]
    return replace(MADE, position=position, quat=quat)


def imported(folder: Path, made: made_of.Recording, times: bool = True) -> Imported:
    commands = made_of.commands_csv(folder / "c.csv", made, times=times)
    return import_case("poses", [made_of.poses_csv(folder / "a.csv", made)], ROBOT, [commands])


def test_a_dwell_that_did_not_follow_its_command_is_left_out_and_said(tmp_path: Path) -> None:
    n = len(MADE.sent_s)
    told = MADE.truth.command_pose[:, :3]
    # the way back to the first pose is the longest
    far = int(np.argmax(np.linalg.norm(np.diff(told, axis=0), axis=1))) + 1
    stops, goes = np.searchsorted(MADE.t_s, [MADE.sent_s[far], MADE.sent_s[far] + 1.9])
    position, quat = MADE.position.copy(), MADE.quat.copy()
    position[stops:goes], quat[stops:goes] = position[stops - 1], quat[stops - 1]
    found = imported(tmp_path, replace(MADE, position=position, quat=quat))
    note = next(note for note in found.notes if "left out, from line" in note)
    assert note.startswith("a.csv: 1 dwell left out") and "(--clock)?" in note
    assert len(found.records()) == n - 1 and not found.measured.read[far]
    assert found.measured.t_s is not None and np.all(np.diff(found.measured.t_s) > 0.0)
    # the frames are those of all other dwells
    whole = imported(tmp_path, MADE)
    frames, others = found.frames, whole.frames
    assert frames.shift == pytest.approx(others.shift, abs=2e-3)
    assert abs(frames.turn @ others.turn) == pytest.approx(1.0, abs=1e-6)
    assert abs(frames.target_turn @ others.target_turn) == pytest.approx(1.0, abs=1e-6)
    assert not any("left out, from line" in note for note in whole.notes)


def test_without_times_of_commands_a_dwell_left_out_is_between_its_neighbours(
    tmp_path: Path,
) -> None:
    """It had the time of the last one."""
    commands = made_of.commands_csv(tmp_path / "c.csv", MADE, times=False)
    log = made_of.poses_csv(tmp_path / "a.csv", MADE)
    (take,) = import_case("poses", [log], ROBOT, [commands]).takes
    number = take.number.copy()
    whole = joined(take.held, take.dwells, number)[0].t_s
    number[3] = -1
    rows, _noise = joined(take.held, take.dwells, number)
    assert whole is not None and rows.t_s is not None
    assert np.delete(rows.t_s, 3) == pytest.approx(np.delete(whole, 3))
    assert rows.t_s[3] == pytest.approx(0.5 * (whole[2] + whole[4]))


def test_only_a_dwell_much_farther_than_most_and_than_commands_spread_is_left_out(
    tmp_path: Path,
) -> None:
    found = imported(tmp_path, MADE)
    (take,) = found.takes
    step = np.linalg.norm(np.diff(MADE.truth.command_pose[:, :3], axis=0), axis=1)
    far, near = int(np.argmax(step)), int(np.argmin(np.where(step > 1e-6, step, np.inf)))

    def notes(before: int, away: float = 0.0) -> list[str]:
        """With the next dwell where the one before was, and all frames off by ``away`` [m]."""
        place = take.dwells.position.copy()
        place[take.used[before + 1]] = place[take.used[before]]
        stopped = replace(take, dwells=replace(take.dwells, position=place))
        frames = replace(found.frames, shift=found.frames.shift + np.array([away, 0.0, 0.0]))
        return without_strays(ROBOT, [stopped], frames)[1]

    assert len(notes(far)) == 1 and notes(near) == [] == notes(far, 1.0)


def test_a_dwell_elsewhere_to_which_the_platform_moved_stays(tmp_path: Path) -> None:
    """A payload lets it sag: that is what data are for."""
    found = imported(tmp_path, recorded(len(MADE.sent_s) - 1, 0.3))
    assert found.measured.n_rows == len(MADE.sent_s)


def test_if_many_did_not_follow_it_is_no_matter_of_single_dwells(tmp_path: Path) -> None:
    found = imported(tmp_path, MADE)
    frames, (take,) = found.frames, found.takes
    still = take.dwells.position.copy()
    still[3:9] = still[3]
    stopped = replace(take, dwells=replace(take.dwells, position=still))
    takes, notes = without_strays(ROBOT, [stopped], frames)
    assert not notes and takes[0].number.tolist() == take.number.tolist()
    assert without_strays(ROBOT, [take], frames) == ([take], [])


ROWS = 4
PULL = np.array([[0.0] * 6, [0.0] * 6, [5.0, 0, 0, 0, 0, 0], [0.0] * 6])
ASIDE = np.array([[0.0] * 3, [0.0] * 3, [0.1, 0.0, 0.0], [0.0] * 3])


@pytest.mark.parametrize(
    ("loads", "rows"),
    [
        (None, [0]),
        (Loads.of(ROWS, wrench=PULL), [0, 2, 3]),
        (Loads.of(ROWS, mass=np.full(ROWS, 2.0), centre=ASIDE), [0, 2, 3]),
        (Loads.of(ROWS, mass=np.array([0.0, 0.0, 2.0, 0.0])), [0, 2, 3]),
        (Loads.of(ROWS, centre=ASIDE), [0]),  # where nothing hangs
    ],
)
@pytest.mark.parametrize("timed", [False, True])
def test_another_load_is_another_command(
    tmp_path: Path, loads: Loads | None, rows: list[int], timed: bool
) -> None:
    """Only masses were compared: rows that differ in force or centre were one command."""
    log = Measurements(
        path=tmp_path, n_cables=2, run=np.full(ROWS, "a"), loads=loads,
        command_pose=np.tile([0.1, 0.2, 0.3, 1.0, 0.0, 0.0, 0.0], (ROWS, 1)),
        t_s=np.arange(float(ROWS)) if timed else None,
    )  # fmt: skip
    assert held_commands(log, 0.5, 0.0, float(ROWS)).row.tolist() == rows


@pytest.mark.parametrize("begin", [0.0, 1234.5, 1.7e9])
def test_a_command_held_just_long_enough_counts_though_times_are_rounded(begin: float) -> None:
    rows = 40
    pose = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (rows, 1))
    pose[:, 0] = np.arange(rows)
    log = Measurements(
        path=Path("log.csv"), n_cables=2, run=np.full(rows, "a"), command_pose=pose,
        t_s=begin + 0.1 * np.arange(rows),
    )  # fmt: skip
    end = float(log.t_s[-1]) + 1.0
    assert held_commands(log, 0.1, 0.0, end).row.tolist() == list(range(rows))
    assert held_commands(log, 0.11, 0.0, end).row.tolist() == [rows - 1]


def test_a_swing_that_dies_out_is_no_rest():
    t = np.arange(0.0, 10.0, 0.01)
    swing = 0.05 * np.exp(-t / 0.8) * np.cos(8.0 * t)
    rng = np.random.default_rng(0)
    position = np.stack([swing, 0 * t, 0 * t], axis=1) + 1e-5 * rng.standard_normal((len(t), 3))
    dwells = find_dwells(Stream(None, t, np.arange(len(t)), position), np.zeros(0))
    assert len(dwells) == 1 and 2.5 < dwells.begin_s[0] < 7.0
    assert np.abs(dwells.position).max() < 1e-4


@pytest.mark.parametrize("begin", [0.0, 1234.5, 1.7e9])
def test_rounded_times_do_not_make_an_interval_longer(begin: float) -> None:
    """Differences of 0.1 s were a little more or less, and with it five of them than 0.5 s."""
    t = begin + np.round(np.arange(0.0, 30.0, 0.1), 6)
    place = np.stack([np.repeat(np.arange(10.0), 30), 0 * t, 0 * t], axis=1)
    place[[29, 59, 89]] += 0.5
    dwells = find_dwells(Stream(None, t, np.arange(len(t)), place), np.zeros(0))
    assert len(dwells) == 10
    with pytest.raises(InputFileError, match=r"got one every 0.11 s; log faster, give --rest-for"):
        find_dwells(Stream(Path("log"), 1.1 * t, np.arange(len(t)), place), np.zeros(0))


@pytest.mark.parametrize("rate", [10, 100])
def test_samples_that_are_lost_do_not_end_a_rest(rate: int) -> None:
    """Nor do they turn a move into one: between two rests a second of it is lost."""
    t = np.arange(0.0, 20.0, 1.0 / rate)
    rng = np.random.default_rng(0)
    moved = np.clip((t - 9.0) / 2.0, 0.0, 1.0)
    position = np.stack([moved, 0 * t, 0 * t], axis=1) + 1e-4 * rng.standard_normal((len(t), 3))
    whole = find_dwells(Stream(None, t, np.arange(len(t)), position), np.zeros(0))
    lost = position.copy()
    lost[[3 * rate, 5 * rate, 5 * rate + 1, 14 * rate]] = np.nan
    lost[(t > 9.5) & (t < 10.5)] = np.nan
    lost[(t > 16.0) & (t < 16.4)] = np.nan
    found = find_dwells(Stream(None, t, np.arange(len(t)), lost), np.zeros(0))
    assert len(found) == len(whole) == 2
    assert found.begin_s == pytest.approx(whole.begin_s, abs=0.3)
    assert found.end_s == pytest.approx(whole.end_s, abs=0.3)
    assert found.position == pytest.approx(whole.position, abs=2e-4)
    assert np.all(found.samples <= whole.samples)


SCATTER = Sigma(position_m=6e-6, orientation_rad=1e-5)


def visits(runs: int, poses: int = 30) -> Measurements:
    """Poses visited in each of several runs, off by 0.02 mm and 0.1 mrad in each visit anew."""
    rng = np.random.default_rng(3)
    place = rng.uniform(-1.0, 1.0, (poses, 3))
    turn = quat_from_rotvec(rng.uniform(-0.3, 0.3, (poses, 3)))
    pose = np.tile(np.column_stack([place, turn]), (runs, 1))
    n = len(pose)
    shake = quat_from_rotvec(rng.normal(0.0, 1e-4, (n, 3)))
    return Measurements(
        Path("m.csv"), 4, np.repeat([f"r{k}" for k in range(runs)], poses), command_pose=pose,
        position=pose[:, :3] + 0.01 + rng.normal(0.0, 2e-5, (n, 3)),
        quat_wxyz=quat_multiply(shake, pose[:, 3:]),
    )  # fmt: skip


def test_revisited_poses_tell_what_repeats() -> None:
    sigma, source, said = repeated(visits(runs=5), SCATTER)
    # 120 further visits of three coordinates: known to 1 / sqrt(720), 4 %
    assert sigma.position_m == pytest.approx(2e-5, rel=0.12)
    assert sigma.orientation_rad == pytest.approx(1e-4, rel=0.12)
    assert source == "revisited"
    assert said.startswith("revisited poses (120 further visits) repeat to 0.02 mm and 0.005")


def test_poses_visited_once_tell_a_lower_bound() -> None:
    sigma, source, said = repeated(visits(runs=1), SCATTER)
    assert (sigma, source) == (SCATTER, "dwell_scatter")
    assert "the true noise may be larger" in said


def test_the_larger_noise_is_stated() -> None:
    sigma, source, _said = repeated(visits(runs=2), Sigma(position_m=1e-3))
    assert sigma.position_m == 1e-3 and source == "revisited"


def test_what_depends_on_the_way_there_is_no_noise() -> None:
    """Backlash: a pose that is reached from both sides is two poses."""
    data = visits(runs=6)
    back = np.arange(data.n_rows).reshape(6, -1)
    back[1::2] = back[1::2, ::-1]  # every second run goes back
    order = back.ravel()
    turned = data.rows(order)
    turned = replace(turned, run=np.sort(turned.run))
    backwards = np.repeat([False, True] * 3, 30)
    off = replace(turned, position=turned.position + 1e-3 * backwards[:, None])
    sigma, source, _said = repeated(off, SCATTER)
    assert source == "revisited" and sigma.position_m == pytest.approx(2e-5, rel=0.12)


def test_a_platform_that_turns_while_commands_do_not_is_asked_about() -> None:
    data = visits(runs=1)
    level = data.command_pose.copy()
    level[:, 3:] = [1.0, 0.0, 0.0, 0.0]
    (said,) = unturned(as_they_are(None), data.position, data.quat_wxyz, level)
    # turns of less than 0.5 rad are nearly vectors
    vectors = rotvec_from_quat(data.quat_wxyz)
    off = np.linalg.norm(vectors - vectors.mean(axis=0), axis=1)
    turned = float(said.partition("turns by ")[2].partition(" deg")[0])
    assert turned == pytest.approx(np.degrees(np.sqrt(np.mean(off**2))), rel=0.02)
    assert "is the orientation missing in the log of commands? Add cmd_qw" in said
    assert unturned(as_they_are(None), data.position, data.quat_wxyz, data.command_pose) == []
    assert unturned(as_they_are(None), data.position, None, level) == []
