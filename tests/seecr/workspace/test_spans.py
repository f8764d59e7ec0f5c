"""Zones of slack cables: against a much finer sweep, and against solves beside their edges."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from seecr.commands import Commands, Loads
from seecr.description.mjcf import load_robot
from seecr.effects import Term
from seecr.equilibrium.solving import solve
from seecr.errors import InputError
from seecr.pose import pose_add, pose_difference, quat_from_rotvec
from seecr.statics.solution import Status
from seecr.workspace.spans import slack_spans


def line(z: float, y: float, n: int, first: float = 0.17, last: float = 0.63) -> np.ndarray:
    poses = np.zeros((n, 7))
    poses[:, 0], poses[:, 1], poses[:, 2], poses[:, 3] = np.linspace(first, last, n), y, z, 1.0
    return poses


@pytest.mark.parametrize(
    ("name", "z", "y", "counts"),
    [
        ("planar_vertical", 0.2, 0.0, [2, 1, 0, 1, 2]),
        ("demobot_parallel", 0.1, 0.25, [4, 2, 0, 2, 4]),
        ("planar_horizontal", 0.2, 0.0, [0]),
    ],
)
@pytest.mark.parametrize("rows", [2, 24])
def test_zones_are_those_of_a_much_finer_sweep(
    name: str, z: float, y: float, counts: list[int], rows: int
) -> None:
    """Figs 7, 8 and 11; with two rows nothing but the search sees the middle."""
    robot = load_robot(name)
    if rows == 2:
        # half of it: from end to end the whole middle would be on the way between two rows
        poses, counts = line(z, y, 2, last=0.4), counts[: len(counts) // 2 + 1]
    else:
        poses = line(z, y, rows)
    spans = slack_spans(solve(robot, poses))
    assert [len(span.slack or ()) for span in spans] == counts
    fine = solve(robot, line(z, y, 4601))
    at = fine.command[:, 0]
    for span in spans:
        slack = np.isin(robot.cable_names, span.slack)
        inside = (at > span.first[0] + 1e-6) & (at < span.last[0] - 1e-6)
        assert inside.any() and np.all(fine.slack[inside] == slack)
        assert span.width == pytest.approx(span.last[0] - span.first[0], abs=1e-12)
    ends = [spans[0].first[0], *(span.last[0] for span in spans)]
    assert ends[1:-1] == [span.first[0] for span in spans[1:]]
    assert (ends[0], ends[-1]) == (poses[0, 0], poses[-1, 0])


def test_rows_at_which_a_search_gave_up_are_passed_by() -> None:
    """Each was a zone where nothing rests, a micrometre wide where the others are found again."""
    robot, poses = load_robot("demobot_parallel"), line(0.1, 0.25, 24)
    runs = Commands(poses, run=np.repeat([0, 1, 2], [3, 1, 20]))
    found = solve(robot, runs)
    status = found.status.copy()
    status[[1, 3, 5, 23]] = Status.GAVE_UP
    lost = slack_spans(replace(found, status=status), runs)
    whole = slack_spans(found, runs)
    assert [(s.run, s.slack) for s in lost] == [(s.run, s.slack) for s in whole if s.run != 1]
    assert [lost[0].rows, lost[-1].rows[1]] == [(0.0, 2.0), 22.0]
    assert lost[1].rows[0] == 4.0 and lost[1].first[0] == poses[4, 0]
    for one, same in zip(lost[1:-1], [s for s in whole if s.run == 2], strict=False):
        assert one.last == pytest.approx(same.last, abs=1e-6)
        assert one.rows == pytest.approx(same.rows, abs=1e-3)
    every = replace(found, status=np.full(24, Status.GAVE_UP, dtype=object))
    assert slack_spans(every, runs) == ()


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
def test_an_edge_is_as_near_as_it_is_told_to_be(tolerance: float) -> None:
    robot = load_robot("planar_vertical")
    spans = slack_spans(solve(robot, line(0.2, 0.0, 24)), tolerance=tolerance)
    for before, after in pairwise(spans):
        within = before.within[1]
        assert within == after.within[0] and 0.1 * tolerance < within <= 0.5 * tolerance
        beside = np.tile(after.first, (2, 1))
        beside[:, 0] += [-1.01 * within, 1.01 * within]
        slack = solve(robot, beside).slack
        assert [
            tuple(np.array(robot.cable_names)[row].tolist()) for row in slack
        ] == [before.slack, after.slack]  # fmt: skip
    assert spans[0].within[0] == spans[-1].within[1] == 0.0


def test_runs_are_apart_and_turning_alone_has_an_angle() -> None:
    robot = load_robot("demobot_parallel")
    poses = np.concatenate([line(0.1, 0.25, 3, 0.2, 0.4), line(0.1, 0.25, 3, 0.4, 0.2)])
    spans = slack_spans(solve(robot, poses), Commands(poses, run=np.repeat([5, 8], 3)))
    assert [span.run for span in spans] == [0, 0, 0, 1, 1, 1]
    assert [len(span.slack or ()) for span in spans] == [4, 2, 0, 0, 2, 4]
    assert spans[0].last[0] == pytest.approx(spans[5].first[0], abs=2e-6)
    assert spans[3].rows[0] == 3.0 and spans[2].rows[1] == 2.0
    turned = line(0.1, 0.25, 2, 0.4, 0.4)
    turned[1, 3:] = [np.cos(0.4), 0.0, np.sin(0.4), 0.0]
    spans = slack_spans(solve(robot, turned))
    assert len(spans) > 1 and sum(span.width for span in spans) == 0.0
    assert sum(span.turn for span in spans) == pytest.approx(0.8)


def test_a_load_hangs_on_the_way_to_its_row() -> None:
    """The one of the row before does not: with it the edge would be elsewhere."""
    robot = load_robot("planar_vertical")
    poses = line(0.2, 0.0, 2, 0.25, 0.4)
    aside = Loads.of(2, wrench=np.array([[0.0] * 6, [0.3, 0.0, 0.0, 0.0, 0.0, 0.0]]))
    commands = Commands(poses, loads=aside)
    spans = slack_spans(solve(robot, commands), commands)
    pushed = solve(robot, line(0.2, 0.0, 3001, 0.25, 0.4), wrench=aside.wrench[1])
    last = pushed.command[np.flatnonzero(pushed.slack.any(axis=1))[-1], 0]
    assert spans[-1].slack == () and spans[-1].first[0] == pytest.approx(last, abs=1e-4)


def test_what_remembers_is_told_half_way_between_rows() -> None:
    robot = load_robot("planar_vertical")
    poses = line(0.2, 0.0, 24)
    plain = slack_spans(solve(robot, poses))
    friction = [Term.of(robot, "hysteresis", amplitude_N=1e-3)]
    spans = slack_spans(solve(robot, poses, effects=friction), effects=friction)
    assert [len(span.slack or ()) for span in spans] == [2, 1, 0, 1, 2]
    for span, other in zip(spans[1:], plain[1:], strict=True):
        assert span.within[0] == pytest.approx(0.01)
        assert abs(span.first[0] - other.first[0]) <= 0.0101


def test_what_is_followed_has_the_same_zones_where_there_is_one_rest() -> None:
    robot = load_robot("planar_vertical")
    poses = line(0.2, 0.0, 24)
    plain, led = (slack_spans(solve(robot, poses, follow=way)) for way in (False, True))
    assert [span.slack for span in led] == [span.slack for span in plain]
    for span, other in zip(led, plain, strict=True):
        assert span.first == pytest.approx(other.first, abs=1.1e-6)


@pytest.mark.slow
def test_what_is_followed_changes_where_it_jumps() -> None:
    """Solved from the command alone the platform rests elsewhere than where the way leads it."""
    robot = load_robot("demobot_parallel")
    poses = np.tile(robot.reference_pose, (6, 1))
    turn = np.zeros((6, 3))
    turn[:, 0] = np.radians(np.linspace(140.0, 155.0, 6))
    poses[:, 3:] = quat_from_rotvec(turn)
    commands = Commands(poses, stands=np.ones(6, dtype=bool))
    found = solve(robot, commands, follow=True)
    assert found.jumps is not None
    (jump,) = [one for jumps in found.jumps for one in jumps]
    spans = slack_spans(found, commands)
    edges = [span.first for span in spans[1:]]
    off = [np.abs(pose_difference(edge, jump.command)).max() for edge in edges]
    near = int(np.argmin(off))
    assert off[near] * robot.length < 2e-6
    for k, pose, aside in ((near, jump.before, -1e-4), (near + 1, jump.after, 1e-4)):
        command = pose_add(jump.command[None], np.array([[0.0, 0, 0, aside, 0, 0]]))
        there = solve(robot, command, start=pose)
        assert spans[k].slack == tuple(np.array(robot.cable_names)[there.slack[0]].tolist())


def test_where_it_does_not_rest_is_a_zone_of_its_own() -> None:
    robot = load_robot("demobot_parallel")
    poses = line(0.1, 0.25, 2, 0.1, 0.17)
    poses[0, 1] = 0.1
    found = solve(robot, poses)
    assert found.converged.tolist() == [False, True]
    free, rests = slack_spans(found)
    assert free.slack is None and free.words == "not at rest, or free to move"
    assert free.as_json()["slack_cables"] is None
    assert rests.slack == ("cable2", "cable4", "cable5", "cable7")
    beside = np.tile(rests.first, (2, 1))
    beside[:, :3] += np.array([[-1.0], [1.0]]) * 1e-6 * (poses[1] - poses[0])[:3]
    beside[:, :3] += np.array([[-1.0], [1.0]]) * 5e-6
    assert solve(robot, beside).converged.tolist() == [False, True]


def test_nothing_and_one_pose() -> None:
    robot = load_robot("planar_vertical")
    assert slack_spans(solve(robot, np.zeros((0, 7)))) == ()
    (span,) = slack_spans(solve(robot, line(0.2, 0.0, 1)))
    assert span.slack == ("cable2", "cable3") and span.width == span.turn == 0.0
    assert span.rows == (0.0, 0.0) and span.first == pytest.approx(span.last)


def test_refusals() -> None:
    robot = load_robot("planar_vertical")
    found = solve(robot, line(0.2, 0.0, 3))
    with pytest.raises(InputError, match="tolerance must be one number above zero"):
        slack_spans(found, tolerance=0.0)
    with pytest.raises(InputError, match="expected the commands of the solution, got other poses"):
        slack_spans(found, line(0.1, 0.0, 3))
    lengths = Commands(found.command, lengths=found.rest_lengths)
    with pytest.raises(InputError, match="needs commanded poses"):
        slack_spans(found, lengths)
