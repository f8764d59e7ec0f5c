"""How fast equilibria are found: many poses abreast beside one by one, in this process.

    python scripts/bench.py                            a table on the terminal; a minute
    python scripts/bench.py --page docs/performance.md  and as the page

Times are of one processor, the best of three, the two ways in turns, with all that `seecr.solve`
does. Ratios are safer than times where other work goes on beside.
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

import seecr
from seecr.description.joints import pose_of_values, values_of_pose
from seecr.parallel import processors, undivided
from seecr.statics.batch import Abreast
from seecr.statics.tables import one_by_one
from seecr.workspace.maps import default_axes

# Poses of each robot, and values along the axes of a map.
POSES, VALUES = 20_000, 60
SHIPPED = (
    ("demobot_cogiro", (300.0, 3e3, 1e5, 1e7)), ("demobot_parallel", (300.0, 3e3, 1e5, 1e7)),
    ("cogiro_large", (0.0,)), ("ipanema", (0.0,)), ("planar_vertical", (0.0,)),
    ("planar_horizontal", (0.0,)), ("planar_two_cable", (0.0,)), ("camera", (0.0,)),
)  # fmt: skip
PAGE = """# Performance

`make bench` writes this page, on {count}. "One by one" is the compiled descent of a single
pose, which small batches still take; "abreast" is the same descent for sixteen poses at once, which
batches from 64 poses on take. Both are the whole of `seecr.solve`, in microseconds a pose on one
processor. "Left" are poses that lanes leave to the descent of one: falls, saddles, and rests within
rounding of a cable's rest length.

{table}

Maps, and lengths for wanted poses, on all processors of that machine:

{others}
"""


def robots() -> Iterator[tuple[str, seecr.Robot]]:
    """The shipped robots with some stiffnesses, and suspended ones with six to twelve cables."""
    for name, stiffnesses in SHIPPED:
        robot = seecr.load_robot(seecr.model_path(name))
        for ea in stiffnesses:
            yield name, replace(robot, ea=np.full(robot.n_cables, ea)) if ea else robot
    for m in (6, 8, 10, 12):
        yield f"ring of {m}", ring(m)


def ring(m: int) -> seecr.Robot:
    """A platform of 0.4 kg that hangs on m cables from a circle; every other one is crossed."""
    around = 2.0 * np.pi * np.arange(m) / m
    exits = np.column_stack([0.5 * np.cos(around), 0.5 * np.sin(around), np.full(m, 0.5)])
    inner = around + np.where(np.arange(m) % 2 == 0, 0.8, -0.8)
    high = np.where(np.arange(m) % 2 == 0, 0.02, -0.02)
    anchors = np.column_stack([0.06 * np.cos(inner), 0.06 * np.sin(inner), high])
    home = np.array([0.0, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0])
    plain = seecr.Robot(
        name=f"ring_{m}", exit_points=exits, anchor_points=anchors, ea=np.full(m, 3e3),
        rest_lengths=np.ones(m), mass=0.4, centre_of_mass=np.zeros(3), reference_pose=home,
    )  # fmt: skip
    return replace(plain, rest_lengths=plain.nominal_lengths(home[None])[0])


def poses_of(robot: seecr.Robot) -> np.ndarray:
    """Poses about the middle of the frame; on joints, values about their middle."""
    rng = np.random.default_rng(0)
    points = np.concatenate([robot.exit_points, robot.reference_pose[None, :3]])
    low, high = points.min(axis=0), points.max(axis=0)
    if robot.joints:
        middle = values_of_pose(robot, robot.reference_pose[None])[0]
        reach = np.where(robot.hinges, 0.1, 0.2 * np.max(high - low))
        return pose_of_values(robot, middle + reach * rng.uniform(-1, 1, (POSES, robot.n_dof)))[0]
    places = low + rng.uniform(0.25, 0.75, (POSES, 3)) * (high - low)
    return np.column_stack([places, np.tile(robot.reference_pose[3:], (POSES, 1))])


def timed(run: Callable[[], object]) -> float:
    """Seconds of this thread."""
    start = time.thread_time()
    run()
    return time.thread_time() - start


def row(name: str, robot: seecr.Robot) -> list[str]:
    """One robot's line of the table."""
    poses = poses_of(robot)

    def run() -> seecr.Solution:
        return seecr.solve(robot, poses, threads=1)

    single = abreast = np.inf
    with undivided():
        found = run()
        for _ in range(3):
            with one_by_one():
                single = min(single, timed(run))
            abreast = min(abreast, timed(run))
    left = found.evaluation.alone.mean() if isinstance(found.evaluation, Abreast) else 1.0
    return [
        name, f"{robot.n_cables}", f"{robot.ea.mean():.3g}", f"{found.slack.sum(1).mean():.1f}",
        f"{found.iterations.mean():.1f}", f"{100 * left:.1f} %", f"{1e6 * single / POSES:.2f}",
        f"{1e6 * abreast / POSES:.2f}", f"{single / abreast:.1f}",
    ]  # fmt: skip


def others(name: str) -> list[str]:
    """Microseconds a pose of maps and corrections of one robot, on all processors."""
    robot = seecr.load_robot(seecr.model_path(name))
    axes = default_axes(robot, VALUES)
    poses = poses_of(robot)
    poses = poses[seecr.tension_margin(robot, poses) > 0.05 * robot.usual_load]
    runs = (
        (lambda: seecr.workspace_map(robot, *axes), VALUES**3),
        (lambda: seecr.workspace_map(robot, *axes, elastic=False), VALUES**3),
        (lambda: seecr.correct(robot, poses), len(poses)),
    )
    out = [name]
    for run, count in runs:
        best = np.inf
        for _ in range(3):
            start = time.perf_counter()
            run()
            best = min(best, time.perf_counter() - start)
        out.append(f"{1e6 * best / count:.2f}")
    return out


def table(head: str, rows: list[list[str]]) -> str:
    """A table of Markdown."""
    names = head.split(", ")
    lines = [names, ["---", *["---:"] * (len(names) - 1)], *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def main() -> None:
    """Measure, print, and write the page if asked."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--page", type=Path, help="write it as this page, too")
    given = parser.parse_args()
    head = "robot, cables, E S (N), slack, evaluations, left, one by one (µs), abreast (µs), ratio"
    first = table(head, [row(*each) for each in robots()])
    rows = [others(name) for name in ("demobot_cogiro", "demobot_parallel")]
    second = table("robot, elastic map (µs), static map (µs), correct (µs)", rows)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(
        first,
        second,
        f"{memory / (2**20 if sys.platform != 'darwin' else 2**30):.2f} GB",
        sep="\n\n",
    )
    if given.page:
        count = f"a machine with {processors()} processors"
        given.page.write_text(
            PAGE.format(count=count, table=first, others=second), encoding="utf-8"
        )


if __name__ == "__main__":
    main()
