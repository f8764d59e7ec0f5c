"""The bench: whose answers are wrong of other programs, who is not there, what a start takes."""

from __future__ import annotations

from pathlib import Path
from subprocess import CalledProcessError

import bench
import bench_peers
import numpy as np
import pytest
from paper_search import equations

import seecr
from seecr.pose import quat_from_rotvec, quat_multiply


def test_a_peers_answer_is_wrong_where_our_own_equations_say_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A peer that is off by more at each pose, and does not converge at the last one."""
    robot = seecr.load_robot("demobot_parallel")
    poses = bench.poses_of(robot)[:6]
    given = seecr.solve(robot, poses).deviation
    given += np.array([0.0, 1e-9, 1e-8, 1e-6, 1e-2, 0.0])[:, None]
    left = [np.linalg.norm(equations(robot, pose)(by)) / robot.weight
            for pose, by in zip(poses, given, strict=True)]  # fmt: skip
    assert [size > bench_peers.WRONG for size in left] == [False, False, False, True, True, False]
    turned = quat_multiply(quat_from_rotvec(given[:, 3:]), poses[:, 3:])
    answers = iter(np.concatenate([poses[:, :3] + given[:, :3], turned], axis=1))
    monkeypatch.setattr(bench_peers, "find_spec", lambda _: True)
    monkeypatch.setattr(bench_peers, "built", lambda _robot, pose, _weight: pose)
    monkeypatch.setattr(bench_peers, "at_of", lambda _pose: next(answers))
    claims = iter([True] * 5 + [False])
    monkeypatch.setattr(bench_peers, "solved", lambda _pose: next(claims))
    said, spent = bench_peers.moorpy_of(robot, poses, 0.0, [])
    assert said == "5 of 6, 2 wrong" and spent > 0.0


def test_where_a_peer_is_not_installed_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_peers, "find_spec", lambda _: None)
    name, robot, heavy = next(bench_peers.cases())
    cells = bench_peers.row(name, robot, heavy, bench.poses_of(robot)[:80], 2)
    assert cells[4:] == ["2 of 2", "2 of 2", "not installed", "nan", "nan"]


@pytest.mark.slow
def test_seconds_of_a_command_are_those_of_the_processor(tmp_path: Path) -> None:
    once = "timeit -n 1 -r 1"
    busy = bench.spent_by(f"{once} sum(range(20_000_000))", str(tmp_path))
    idle = bench.spent_by(f"{once} __import__('time').sleep(1.0)", str(tmp_path))
    assert idle < busy and idle < 0.5
    with pytest.raises(CalledProcessError):
        bench.spent_by("seecr pose DIR/none.xml", str(tmp_path))
