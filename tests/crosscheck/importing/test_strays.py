"""Dwells at which the platform is nowhere near its command are left out, and said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import made_recordings as made_of
import numpy as np
import pytest
from made_data import soft_cogiro

from crosscheck.importing import import_case
from crosscheck.importing.case import Imported
from crosscheck.importing.strays import without_strays

ROBOT = soft_cogiro()
MADE = made_of.recording(ROBOT)


def imported(folder: Path, last: int, off: float = 0.0) -> Imported:
    """What a platform that moves no more from the command ``last`` on reads, ``off`` [m] aside."""
    stops = np.searchsorted(MADE.t_s, MADE.sent_s[last])
    position, quat = MADE.position.copy(), MADE.quat.copy()
    position[stops:], quat[stops:] = position[stops - 1] + [off, 0.0, 0.0], quat[stops - 1]
    stopped = replace(MADE, position=position, quat=quat)
    commands = made_of.commands_csv(folder / "c.csv", MADE)
    return import_case("poses", [made_of.poses_csv(folder / "a.csv", stopped)], ROBOT, [commands])


def test_a_dwell_far_from_its_command_is_left_out_and_said(tmp_path: Path) -> None:
    n = len(MADE.sent_s)
    found = imported(tmp_path, n - 1, 0.3)
    assert found.measured.n_rows == n - 1 and len(found.records()) == n - 1
    note = next(note for note in found.notes if "left out, from line" in note)
    assert note.startswith("a.csv: 1 dwell left out") and "(--clock)?" in note
    line = int(note.split("from line ")[1].split()[0])
    assert abs(MADE.t_s[line - 2] - MADE.sent_s[n - 1]) < 0.2
    # the frames are those of all other dwells
    log = made_of.poses_csv(tmp_path / "b.csv", MADE)
    whole = import_case("poses", [log], ROBOT, [tmp_path / "c.csv"])
    frames, others = found.frames, whole.frames
    assert frames.shift == pytest.approx(others.shift, abs=2e-3)
    assert abs(frames.turn @ others.turn) == pytest.approx(1.0, abs=1e-6)
    assert abs(frames.target_turn @ others.target_turn) == pytest.approx(1.0, abs=1e-6)
    assert not any("left out, from line" in note for note in whole.notes)


def test_if_all_are_far_it_is_no_matter_of_single_dwells(tmp_path: Path) -> None:
    found = imported(tmp_path, len(MADE.sent_s) - 1)
    frames, (take,) = found.frames, found.takes
    moved = replace(frames, shift=frames.shift + np.array([0.5, 0.0, 0.0]))
    takes, notes = without_strays(ROBOT, [take], moved)
    assert not notes and takes[0].number.tolist() == take.number.tolist()
