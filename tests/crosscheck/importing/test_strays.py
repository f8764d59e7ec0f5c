"""Dwells at which the platform is nowhere near its command are left out, and said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import made_recordings as made_of
import numpy as np
import pytest
from made_data import soft_cogiro

from crosscheck.importing import import_case
from crosscheck.importing.case import Imported, without_strays
from crosscheck.importing.join import joined

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
