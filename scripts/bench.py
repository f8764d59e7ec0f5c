"""How fast equilibria are found, beside other ways to find them: all in one run.

    python scripts/bench.py                             a page on the terminal; some minutes
    python scripts/bench.py --out docs/figures.json --page docs/performance.md
    python scripts/bench.py --before 2a123ab2           and how fast that commit is, compiled anew

Times are of one processor, the best of three, the ways in turns, with all that `seecr.solve` does.
Ratios are safer than times where other work goes on beside.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import bench_peers
import bench_rows
import numpy as np
from paper_search import search

import seecr
from crosscheck.settle.settler import Settler
from seecr.description.joints import pose_of_values, values_of_pose
from seecr.effects.setup import plain_setup
from seecr.files import write_text
from seecr.parallel import processors, undivided
from seecr.statics.batch import Brief, descend
from seecr.statics.tables import PORTION, assemble, one_by_one
from seecr.workspace.maps import default_axes

# Poses of each robot, values along the axes of a map, and poses for the slow ways.
POSES, VALUES, FEW = 20_000, 40, 40
DEMOBOTS = ("demobot_cogiro", "demobot_parallel")
SHIPPED = (
    ("demobot_cogiro", (300.0, 3e3, 1e5, 1e7)), ("demobot_parallel", (300.0, 3e3, 1e5, 1e7)),
    ("cogiro_large", (0.0,)), ("ipanema", (0.0,)), ("planar_vertical", (0.0,)),
    ("planar_horizontal", (0.0,)), ("planar_two_cable", (0.0,)), ("camera", (0.0,)),
)  # fmt: skip
PAGE = """# Performance

`make bench` writes this page from `docs/figures.json`, on {count}. "One by one" is the compiled
descent of a single pose, which small batches still take; "abreast" is the same descent for sixteen
poses at once, which batches from 256 poses on take. Both are the whole of `seecr.solve`, in
microseconds a pose on one processor. "Left" are poses that lanes leave to the descent of one:
falls, saddles, and rests within rounding of a cable's rest length. The "floor" of one by one is the
number of evaluations times what one costs.

{table}

Maps, and lengths for wanted poses, in microseconds a pose, and of all processors together:

{maps}

Other ways to the same equilibria, in the same run, and how many times longer they take a pose than
`seecr.solve` of {poses} poses. "The paper's search" is SciPy's `fsolve` on its equations in NumPy,
as it is printed; "compiled" is the same search on the equations compiled and scaled
(`seecr.solve(..., method="fsolve")`); "in MuJoCo" is the settling of `crosscheck`{before}.

{ratios}

## Other programs

At {few} poses of each robot: how many searches say that they have converged, and how many of these
are wrong, with more than a thousandth of the load unbalanced where they end. `fsolve` and
`least_squares` are the paper's searches as printed. [MoorPy](https://github.com/NREL/MoorPy) solves
the same platform as a body on lines, with a tolerance of 1e-7 m; the weight of all cables is given
over that of the platform, and 1e-4 is as good as none. With cables that weigh something both solve
catenaries, and `seecr` takes poses one by one. MoorPy says that it is done where no step is larger
than its tolerance: if cables are stiff, forces are far from balanced there.

{peers}

## One pose and a million

`seecr.solve` by the clock, in microseconds a pose; a batch is divided from 256 poses on. The best
of some runs.

{counts}

Commands as a whole, in seconds of processor, against the rows of their data:
sweeps to and fro of a robot with one hidden effect. `import` reads twelve samples of each. What is
compiled is there. Of more than 1500 rows `diagnose` searches 750 to 1500, and those at reversals.

{rows}

## Maps of any size

A map of {large} poses in parts on disk (`seecr map --parts`) takes {store:.2f} µs of processor a
pose, and {memory:.2f} GB of memory at most. Time is proportional to the number of poses, and memory
is not; measured once, with `seecr map demobot_cogiro --parts --grid` and ever finer axes:

| poses | processor (s) | a pose (µs) | memory (GB) | on disk (GB) |
| ---: | ---: | ---: | ---: | ---: |
| 1,000,000 | 6.2 | 6.2 | 0.55 | 0.07 |
| 10,000,000 | 48.3 | 4.8 | 0.58 | 0.7 |
| 100,000,000 | 459.9 | 4.6 | 0.59 | 7.4 |

## Starting

Seconds of processor, user and system: the best of three. The diagnosis is one run, with nothing
compiled yet. The data are those of `crosscheck twin demobot_cogiro --hide 7`, 144 rows.

{starting}

Two thirds of `pose` are the loading of NumPy, Numba, MuJoCo and of what is compiled. More than half
of `compare` is the loading of these with SciPy, Matplotlib and Rerun, and a third is the drawing of
its figures. Most of a first diagnosis is compilation, 28 s when it was last taken apart: LLVM takes
12 s, and what Numba does before, in Python, the rest. 10 s are the descent with its equilibria in
order, 6 s the law of a cable, 4 s the margins of the 46 poses of the advice, 3 s the change of a
path, and the rest some forty small functions.

A function is compiled by itself and again in all that call it, down to each function that Python
calls. So the descent is part of one function only, the law of a cable is called by its address, and
NumPy makes the scratch arrays. What was tried and left:

* **Shipping what is compiled.** The cache of a diagnosis is 6 MB, and works from another place. But
  an entry counts for one minor version of Python, one release of Numba, one name of processor with
  its features, and one state of the source: its time and size, in Numba 0.68 its contents. A wheel
  would need one for each, and with the next release of Numba none would count. For a common
  processor it could only be compiled by a setting of the whole process, which holds for users' own
  functions too: with `NUMBA_CPU_NAME=x86-64-v3` a descent takes 1.2 times as long, and lanes 1.2;
  with `generic` up to 1.3, and 1.9. `numba.pycc` is to be removed, and Python alone can call what
  it compiles. In an image of a container, one diagnosis while it is built does the same.
* **Less effort of LLVM for what is seldom called.** Numba has it for all functions (`NUMBA_OPT`);
  for one function there are only private options.
* **SciPy's linear programs for few margins.** They compile nothing, but HiGHS allows 1e-7 of
  infeasibility, where ours are right to 1e-12; so the answer at a limit would depend on how many
  poses are asked for.
"""
# Commands whose start is measured, by what the page calls them; DIR has what `twin` wrote.
STARTS = {
    "seecr --help": "seecr --help",
    "seecr pose demobot_cogiro 0.5 0.5 0.3 --out OUT":
        "seecr pose demobot_cogiro 0.5 0.5 0.3 --out DIR/pose",
    "crosscheck compare robot.xml measured.csv --out OUT":
        "crosscheck compare DIR/robot.xml DIR/measured.csv --out DIR/compared",
}  # fmt: skip
FIRST = "crosscheck diagnose robot.xml measured.csv"
# What an older commit is asked: microseconds a pose, the best of three.
OLDER = """
import sys, time, numpy as np, seecr
for name, poses in np.load(sys.argv[1]).items():
    robot, best = seecr.load_robot(seecr.model_path(name)), np.inf
    for _ in range(4):
        start = time.thread_time()
        seecr.solve(robot, poses, threads=1)
        best = min(best, time.thread_time() - start)
    print(name, 1e6 * best / len(poses))
"""


def robots(short: bool = False) -> Iterator[tuple[str, seecr.Robot]]:
    """The shipped robots with some stiffnesses, and suspended ones with six to twelve cables; in
    ``short`` the DemoBots alone.
    """
    for name, stiffnesses in SHIPPED[: len(DEMOBOTS)] if short else SHIPPED:
        robot = seecr.load_robot(seecr.model_path(name))
        for ea in stiffnesses:
            yield name, replace(robot, ea=np.full(robot.n_cables, ea)) if ea else robot
    for m in () if short else (6, 8, 10, 12):
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
                single = min(single, best_of(run, runs=1))
            abreast = min(abreast, best_of(run, runs=1))
    left = found.evaluation.alone.mean() if isinstance(found.evaluation, Brief) else 1.0
    floor = 1e6 * evaluation(robot, poses[:PORTION]) * found.iterations.mean()
    return [
        name, f"{robot.n_cables}", f"{robot.ea.mean():.3g}", f"{found.slack.sum(1).mean():.1f}",
        f"{found.iterations.mean():.1f}", f"{100 * left:.1f} %", f"{floor:.2f}",
        f"{1e6 * single / POSES:.2f}", f"{1e6 * abreast / POSES:.2f}", f"{single / abreast:.1f}",
    ]  # fmt: skip


def evaluation(robot: seecr.Robot, poses: np.ndarray) -> float:
    """Seconds of an evaluation in the descent of one pose: what two more of them add."""
    with one_by_one(), undivided():
        tables = assemble(plain_setup(robot, seecr.Commands(poses)))
        one, three = (
            best_of(lambda most=most: descend(tables, limit=most, staged=False))  # type: ignore[misc]
            for most in (1, 3)
        )
    return 0.5 * (three - one) / len(poses)


def maps(name: str) -> list[str]:
    """Microseconds of processor a pose of maps and corrections of one robot."""
    robot = seecr.load_robot(seecr.model_path(name))
    axes = default_axes(robot, VALUES)
    poses = poses_of(robot)
    poses = poses[seecr.tension_margin(robot, poses) > 0.05 * robot.usual_load]
    runs = (
        (lambda: seecr.workspace_map(robot, *axes), VALUES**3),
        (lambda: seecr.workspace_map(robot, *axes, elastic=False), VALUES**3),
        (lambda: seecr.correct(robot, poses), len(poses)),
    )
    return [name, *(f"{1e6 * best_of(run, time.process_time) / n:.2f}" for run, n in runs)]


def best_of(
    run: Callable[[], object], clock: Callable[[], float] = time.thread_time, runs: int = 4
) -> float:
    """Seconds of the fastest of some runs, of which the first loads what is needed."""
    times = []
    for _ in range(runs):
        start = clock()
        run()
        times.append(clock() - start)
    return min(times)


def ratios(name: str) -> dict[str, float]:
    """Microseconds a pose of one robot in several ways."""
    robot = seecr.load_robot(seecr.model_path(name))
    poses = poses_of(robot)
    some = poses[:: len(poses) // FEW]
    settler = Settler(seecr.model_path(name))
    lengths = settler.paid_out(some)

    def settle() -> None:
        for pose, paid in zip(some, lengths, strict=True):
            settler.settle(pose, paid)

    with undivided():
        out = {
            "seecr": best_of(lambda: seecr.solve(robot, poses, threads=1)) / len(poses),
            "paper": best_of(lambda: search(robot, some, "fsolve")) / len(some),
            "fsolve": best_of(lambda: seecr.solve(robot, some, method="fsolve")) / len(some),
            "mujoco": best_of(settle) / len(some),
        }
    return {way: 1e6 * seconds for way, seconds in out.items()}


def of_commit(commit: str) -> dict[str, float]:
    """Microseconds a pose of an older commit, compiled anew, on the same poses, by robot."""
    with tempfile.TemporaryDirectory() as folder:
        tree, file = Path(folder) / "tree", Path(folder) / "poses.npz"
        poses: dict[str, Any] = {name: poses_of(seecr.load_robot(name)) for name in DEMOBOTS}
        np.savez(file, **poses)
        subprocess.run(["git", "worktree", "add", "-q", "--detach", tree, commit], check=True)
        try:
            told = subprocess.run(
                [sys.executable, "-c", OLDER, file], cwd=tree, check=True, text=True,
                stdout=subprocess.PIPE, env=os.environ | {"PYTHONPATH": str(tree)},
            )  # fmt: skip
        finally:
            subprocess.run(["git", "worktree", "remove", "--force", tree], check=True)
    return {name: float(value) for name, value in map(str.split, told.stdout.splitlines())}


def stored() -> tuple[int, float, float]:
    """Poses of a map in parts, microseconds of processor a pose, and the memory at most [GB]."""
    code = (
        "import sys, time, resource, seecr; robot = seecr.load_robot('demobot_cogiro'); "
        "start = time.process_time(); "
        "poses = seecr.store_map(robot, *seecr.default_axes(robot, 100), sys.argv[1]).sum('poses');"
        "print(poses, 1e6 * (time.process_time() - start) / poses, "
        "resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)"
    )
    with tempfile.TemporaryDirectory() as folder:
        told = subprocess.run(
            [sys.executable, "-c", code, f"{folder}/map"], check=True, text=True,
            capture_output=True,
        )  # fmt: skip
    poses, each, memory = told.stdout.split()
    unit = 1e9 if sys.platform == "darwin" else 1024**2
    return int(poses), float(each), float(memory) / unit


def starting() -> dict[str, float]:
    """Seconds of processor of commands, with all that they load and write."""
    with tempfile.TemporaryDirectory() as folder:
        spent_by("crosscheck twin demobot_cogiro --hide 7 --out DIR", folder)
        found = {
            name: min(spent_by(words, folder) for _ in range(3)) for name, words in STARTS.items()
        }
        first = "crosscheck diagnose DIR/robot.xml DIR/measured.csv"
        return found | {FIRST: spent_by(first, folder, NUMBA_CACHE_DIR=f"{folder}/nothing")}


def spent_by(words: str, folder: str, **more: str) -> float:
    """Seconds of processor, user and system, of one command, in an environment with more."""
    import resource  # not on Windows

    def spent() -> float:
        children = resource.getrusage(resource.RUSAGE_CHILDREN)
        return children.ru_utime + children.ru_stime

    # Python keeps what it compiled, as it does for users
    environ = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"} | more
    command = words.replace("DIR", folder).split()
    before = spent()
    subprocess.run(
        [sys.executable, "-m", *command], check=True, env=environ, stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )  # fmt: skip
    return spent() - before


def table(head: str, rows: list[list[str]]) -> str:
    """A table of Markdown."""
    names = head.split(", ")
    lines = [names, ["---", *["---:"] * (len(names) - 1)], *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def figures(before: str | None, short: bool) -> dict[str, Any]:
    """What docs/figures.json has of the speed; in short only how robots compare."""
    times = {name: ratios(name) for name in DEMOBOTS}
    compared = {"ratios": times, "robots": [row(*robot) for robot in robots(short)]}
    if short:
        return compared
    poses, each, memory = stored()
    for name, older in (of_commit(before) if before else {}).items():
        times[name]["before"] = older
    peers = [bench_peers.row(*case, poses_of(case[1]), FEW) for case in bench_peers.cases()]
    return {
        "processors": processors(), "peers": peers, "poses": POSES, "before": before,
        **compared, "maps": [maps(name) for name in DEMOBOTS],
        "stored": {"poses": poses, "microseconds": each, "gigabytes": memory},
        "starting": starting(), "counts": bench_rows.of_poses(DEMOBOTS, poses_of),
        "rows": bench_rows.of_rows(spent_by),
    }  # fmt: skip


def page_of(found: dict[str, Any]) -> str:
    """docs/performance.md."""
    head = (
        "robot, cables, E S (N), slack, evaluations, left, floor (µs), one by one (µs), "
        "abreast (µs), ratio"
    )
    ways = {"paper": "the paper's search", "fsolve": "compiled", "mujoco": "in MuJoCo",
            "before": "before"}  # fmt: skip
    known = [way for way in ways if way in next(iter(found["ratios"].values()))]
    lines = [
        [name, f"{each['seecr']:.2f}", *(f"{each[way]:.4g} ({each[way] / each['seecr']:.0f} times)"
                                         for way in known)]
        for name, each in found["ratios"].items()
    ]  # fmt: skip
    commit = found["before"]
    return PAGE.format(
        count=f"a machine with {found['processors']} processors",
        table=table(head, found["robots"]),
        maps=table("robot, elastic map, static map, correct", found["maps"]),
        poses=found["poses"], few=FEW, peers=table(bench_peers.HEAD, found["peers"]),
        before=f', "before" is `seecr.solve` of commit {commit}' if commit else "",
        ratios=table(", ".join(["robot, seecr (µs)", *(f"{ways[w]} (µs)" for w in known)]), lines),
        large=found["stored"]["poses"], store=found["stored"]["microseconds"],
        memory=found["stored"]["gigabytes"],
        counts=table(bench_rows.POSES_HEAD, found["counts"]),
        rows=table(bench_rows.ROWS_HEAD, found["rows"]),
        starting=table("command, processor (s)", [
            [f"`{command}`", f"{seconds:.2f}"] for command, seconds in found["starting"].items()
        ]),
    )  # fmt: skip


def main() -> None:
    """Measure, print, and write the figures and the page if asked."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--out", type=Path, help="file of figures whose part `speed` is replaced")
    parser.add_argument("--page", type=Path, help="write it as this page, too")
    parser.add_argument("--before", help="a commit to compare with")
    parser.add_argument("--short", action="store_true", help="two robots, no maps and no page")
    given = parser.parse_args()
    found = figures(given.before, given.short)
    page = json.dumps(found, indent=1) if given.short else page_of(found)
    print(page)
    if given.out:
        every = json.loads(given.out.read_text(encoding="utf-8")) if given.out.exists() else {}
        write_text(given.out, json.dumps(every | {"speed": found}, indent=1) + "\n")
    if given.page and not given.short:
        write_text(given.page, page)


if __name__ == "__main__":
    main()
