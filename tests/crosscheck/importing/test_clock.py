"""Two clocks: the shift between them is found from where the platform rests, or left alone."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from pathlib import Path

import made_recordings as made_of
import numpy as np
import pytest
from made_data import soft_cogiro

from crosscheck.importing import ImportChoices, import_case, take
from crosscheck.importing.dwells import HeldCommands, find_dwells
from crosscheck.importing.logs import Stream
from crosscheck.importing.take import find_clock
from seecr.errors import SeecrError

ROBOT = soft_cogiro()


@pytest.fixture(scope="module")
def made():
    return made_of.recording(ROBOT)


def taken(made, folder, clock, choices=None):
    """The tracker's clock shows so much more than that of the commands."""
    commands = made_of.commands_csv(folder / "c.csv", made, clock=clock)
    return import_case(
        "poses", [made_of.poses_csv(folder / "a.csv", made)], ROBOT, [commands], choices
    )


@pytest.mark.parametrize("clock", [37.3, -5.2, 2.0, -1000.0])
def test_the_shift_is_found_and_said(made, tmp_path, clock):
    found = taken(made, tmp_path, clock)
    truth, measured = made.truth, found.measured
    assert measured.command_pose == pytest.approx(truth.command_pose, abs=1e-8)
    assert found.takes[0].held.clock == pytest.approx(clock, abs=0.3)  # as soon as it moves
    alone = taken(made, tmp_path, clock, ImportChoices(clock=clock))
    assert measured.position == pytest.approx(alone.measured.position, abs=3e-5)
    assert f"{abs(found.takes[0].held.clock):.3f} s {'more' if clock > 0 else 'less'}" in str(found)


def test_of_many_commands_some_tell_the_shift(made, tmp_path, monkeypatch):
    monkeypatch.setattr(take, "_MOST_ASKED", 10)
    for clock in (37.3, -5.2):
        found = taken(made, tmp_path, clock)
        assert found.takes[0].held.clock == pytest.approx(clock, abs=0.3)
    assert taken(made, tmp_path, 0.0).takes[0].held.clock == 0.0


def test_one_clock_stays_one(made, tmp_path):
    found = taken(made, tmp_path, 0.0)
    assert found.takes[0].held.clock == 0.0 and "clock shows" not in str(found)


@pytest.mark.parametrize("clock", [0.5, -0.5])
def test_a_shift_that_may_be_the_robots_is_said_and_left_alone(made, tmp_path, clock):
    """Most rests are with their commands; a robot that waits, or starts slowly, does the same."""
    found = taken(made, tmp_path, clock)
    assert found.takes[0].held.clock == 0.0
    (note,) = (note for note in found.notes if "moves begin about" in note)
    assert ("after" if clock > 0.0 else "before") in note and "give --clock " in note
    assert float(note.rpartition(" ")[2]) == pytest.approx(clock, abs=0.3)


def test_only_a_steady_and_large_shift_is_said():
    told = np.random.default_rng(1).uniform(0.0, 1.0, (12, 3))
    held, rests = going_round(told, 0.4)
    assert find_clock(held, told, rests).said and find_clock(held, told, rests).shift == 0.0
    assert not find_clock(held, told, rests, least=0.6).said
    held, rests = going_round(told, 0.0)
    begin = held.begin_s - np.tile([0.1, 0.5], 6)
    late = replace(held, begin_s=begin, end_s=np.append(begin[1:], np.inf))
    assert not find_clock(late, told, rests).said, "as late as it happens"


def test_where_no_two_commands_in_a_row_have_a_rest_nothing_is_known():
    told = np.random.default_rng(1).uniform(0.0, 1.0, (12, 3))
    held, rests = going_round(told, 0.0)
    some = np.arange(len(rests)) % 2 == 0
    few = replace(
        rests, begin_s=rests.begin_s[some], end_s=rests.end_s[some], position=rests.position[some],
        start=rests.start[some],
    )  # fmt: skip
    assert find_clock(held, told, few).shift == 0.0
    aside = find_clock(held.shifted(-7.0), told, few)
    assert aside.shift == pytest.approx(7.0, abs=1.0) and "from where the platform" in aside.said[0]


def test_times_of_day_are_one_clock(made, tmp_path):
    """Times count from each file's first row, and the files begin 8 s apart; one is 7.5 s wrong."""
    there = datetime(2025, 11, 3, 10)
    tracked = made_of.poses_csv(tmp_path / "log.csv", made, began=there)
    told = made_of.commands_csv(tmp_path / "told.csv", made, clock=-7.5, began=there)
    given = import_case("poses", [tracked], ROBOT, [told], ImportChoices(clock=-7.5))
    assert given.takes[0].held.begin_s == pytest.approx(made.sent_s, abs=1e-6)
    plain = taken(made, tmp_path, 0.0).measured
    assert given.measured.position == pytest.approx(plain.position, abs=3e-5)
    assert "clock shows 7.520 s less" in str(import_case("poses", [tracked], ROBOT, [told]))


def test_a_wrong_clock_that_is_given_is_refused(made, tmp_path):
    for wrong in (2.0, -2.0):
        with pytest.raises(SeecrError, match=r"cannot be aligned: .*\(--clock\)"):
            taken(made, tmp_path, 0.0, ImportChoices(clock=wrong))
    with pytest.raises(SeecrError, match="cannot be aligned by 1 dwell: expected 3 or more"):
        taken(made, tmp_path, 0.0, ImportChoices(clock=made.t_s[-1] - 1.4))


def going_round(told, clock):
    """The rests of a platform that goes from place to place (k, 3), and the commands."""
    sent = 2.0 * np.arange(len(told))
    t = np.arange(0.0, sent[-1] + 2.0, 0.02)
    number = np.searchsorted(sent, t, side="right") - 1
    part = np.clip((t - sent[number]) / 0.5, 0.0, 1.0)[:, None]
    before = told[np.maximum(number - 1, 0)]
    noise = 1e-4 * np.random.default_rng(0).standard_normal((len(t), 3))
    place = before + (told[number] - before) * part + noise
    rests = find_dwells(Stream(Path("a.csv"), t, np.arange(len(t)), place), np.zeros(0))
    begin = sent - clock
    held = HeldCommands(None, np.arange(len(told)), begin, np.append(begin[1:], np.inf), 0)
    return held, rests


def test_what_cannot_be_told_is_left_alone():
    """Round and round one square, with the first rounds not recorded: any round may be meant."""
    square = np.tile([[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1.0]], (10, 1))
    held, rests = going_round(square, 0.0)
    some = rests.begin_s > 20.0
    few = replace(
        rests, begin_s=rests.begin_s[some], end_s=rests.end_s[some], position=rests.position[some]
    )
    assert few.position.shape[0] < len(square) - 4
    assert find_clock(held.shifted(7.0), square, few).shift == 0.0
    uneven = np.random.default_rng(1).uniform(0.0, 1.0, (40, 3))
    held, rests = going_round(uneven, 7.0)
    assert find_clock(held, uneven, rests).shift == pytest.approx(7.0, abs=0.1)
