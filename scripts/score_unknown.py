"""Hide effects that no catalogue has on the robots of others, and see what is said of them.

    python scripts/score_unknown.py ../shared/data/labs --seeds 0 80 --json unknown.jsonl
    python scripts/score_unknown.py --summary unknown.jsonl

Eight kinds by turns, 3 to 30 times the noise of the positions or so, MuJoCo as the truth of what
moves the platform; in two of three cases an effect of the catalogue is hidden beside it. Right is
``unknown_effect``, or ``many_effects`` with nothing false among the sure; an unknown effect of a
few times the noise at its largest may be missed, but nothing false may be named in its place.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from score_chances import NOISES, read
from score_made_labs import taken

from crosscheck.diagnosis.verdict import diagnose
from crosscheck.measurements.data import Measurements
from crosscheck.twin.hidden import choose
from crosscheck.twin.lab import random_of, sweeps
from crosscheck.twin.measure import measure
from seecr.commands.data import Commands
from seecr.commands.loads import Loads
from seecr.description.robot import Robot
from seecr.effects import Terms
from seecr.pose import quat_from_rotvec, quat_multiply

Array = NDArray[np.float64]
# Sizes in standard deviations of the position, drawn evenly in their logarithm.
_LEAST, _MOST = 3.0, 30.0


def crosstalk(robot: Robot, told: Commands, size: float) -> Commands:
    """Each winch turns a little with its neighbour."""
    change = robot.commanded_lengths(told.pose) - robot.commanded_lengths(
        robot.reference_pose[None]
    )
    return _lengthened(robot, told, 2.0 * size / robot.length * np.roll(change, 1, axis=1))


def kink(robot: Robot, told: Commands, size: float) -> Commands:
    """A cable lies on an edge and is bent on one side of the room: it is too short there."""
    x = told.pose[:, 0]
    more = np.zeros((len(told), robot.n_cables))
    more[:, 1] = 20.0 * size * np.maximum(x - np.median(x), 0.0) / np.ptp(x)
    return _lengthened(robot, told, more)


def hose(robot: Robot, told: Commands, size: float) -> Commands:
    """A soft spring between the platform and a point of the room pulls it."""
    away = (told.pose[:, :3] - told.pose[0, :3]) / robot.length - np.array([0.3, 0.0, 0.0])
    force = -robot.mass * 9.81 * size / robot.length * away
    return replace(told, loads=Loads.of(len(told), wrench=np.hstack([force, 0.0 * force])))


def _lengthened(robot: Robot, told: Commands, more: Array) -> Commands:
    lengths = robot.commanded_lengths(told.pose) + more
    return replace(told, lengths=lengths, told=True, passed=None)


def lens(_robot: Robot, data: Measurements, off: Array, size: float) -> Measurements:
    """The tracker's picture bends to one side."""
    return _moved(data, 2.0 * size * off[:, [1]] ** 2 * np.array([1.0, 0.0, 0.5]))


def radial(_robot: Robot, data: Measurements, off: Array, size: float) -> Measurements:
    """It widens towards its edges."""
    return _moved(data, 2.0 * size * off * (off**2).sum(axis=1, keepdims=True))


def drift(_robot: Robot, data: Measurements, off: Array, size: float) -> Measurements:
    """It moves through the session."""
    return _moved(data, 2.0 * size * np.linspace(0, 1, len(off))[:, None] * np.array([0.8, 0.6, 0]))


def wave(_robot: Robot, data: Measurements, off: Array, size: float) -> Measurements:
    """It reads a wave over the room."""
    return _moved(data, size * np.sin(6.0 * off[:, [0]]) * np.array([0.0, 1.0, 0.0]))


def yaw(robot: Robot, data: Measurements, off: Array, size: float) -> Measurements:
    """Its orientation goes with the place."""
    assert data.quat_wxyz is not None
    turn = 12.0 * size / robot.length * np.outer(off[:, 0] * off[:, 1], [0.0, 0.0, 1.0])
    return replace(data, quat_wxyz=quat_multiply(quat_from_rotvec(turn), data.quat_wxyz))


def _moved(data: Measurements, by: Array) -> Measurements:
    return replace(data, position=data.position + by)


MOVING: dict[str, Callable[[Robot, Commands, float], Commands]] = {
    "crosstalk": crosstalk, "kink": kink, "hose": hose,
}  # fmt: skip
SEEN: dict[str, Callable[[Robot, Measurements, Array, float], Measurements]] = {
    "lens": lens, "radial": radial, "drift": drift, "wave": wave, "yaw": yaw,
}  # fmt: skip
KINDS = (*MOVING, *SEEN)


def judged(folder: Path, seed: int) -> dict[str, Any]:
    """One case made and diagnosed."""
    robot, who, noise, sigma = taken(folder, seed)
    random = random_of(seed, 11)
    assert sigma.position_m is not None
    kind = KINDS[(seed + seed // 8) % len(KINDS)]
    times = float(np.exp(random.uniform(np.log(_LEAST), np.log(_MOST))))
    known = choose(robot, random_of(seed, 3), None, 1) if seed % 3 else []
    for extent in (0.75, 0.5, 0.35):
        rows = sweeps(robot, 18, extent, seed)
        told = rows.as_commands(robot)
        moved = MOVING[kind](robot, told, times * sigma.position_m) if kind in MOVING else told
        truth = measure(robot, moved, [one.effect() for one in Terms(known)])
        if truth.at_rest.mean() > 0.95:
            break
    runs: NDArray[Any] = rows.run
    data = read(rows, truth, sigma, NOISES[noise](random, rows.n_rows, 6, runs))
    if kind in SEEN:
        off = data.position - np.nanmean(data.position, axis=0)
        off = off / np.nanmax(np.linalg.norm(off, axis=1))
        data = SEEN[kind](robot, data, off, times * sigma.position_m)
    start = time.process_time()
    found = diagnose(robot, data)
    hidden = {one.name for one in known}
    named = [[m.effect, *(r.name for r in m.rivals)] for m in found.missing]
    beyond = {k: round(v / f, 2) for k, f in found.floor.items() if f and (v := found.before[k])}
    return {
        "seed": seed, "robot": who, "noise": noise, "kind": kind, "times": round(times, 1),
        "known": sorted(hidden), "verdict": str(found.verdict), "named": named,
        "false": [one[0] for one in named if hidden.isdisjoint(one)],
        "before": beyond, "seconds": round(time.process_time() - start, 1),
    }  # fmt: skip


def table(rows: list[dict[str, Any]]) -> list[str]:
    """Verdicts and false names of each kind."""
    out = ["| kind | cases | unknown | many, none false | missed, none false | false names |"]
    out.append("|---|---|---|---|---|---|")
    for kind in (*KINDS, "all"):
        some = [row for row in rows if kind in (row["kind"], "all")]
        false = [row for row in some if row["false"]]
        right = [row["verdict"] for row in some if not row["false"]]
        unknown, many = right.count("unknown_effect"), right.count("many_effects")
        cells = (kind, len(some), unknown, many, len(right) - unknown - many, len(false))
        out.append("| " + " | ".join(map(str, cells)) + " |")
    for row in rows:
        if row["false"]:
            out.append(f"false: {json.dumps(row)}")
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path, nargs="?", help="of laboratories, for their robots")
    parser.add_argument("--seeds", type=int, nargs=2, default=(0, 0), help="first, and one beyond")
    parser.add_argument("--json", type=Path, help="append a line for each case there")
    parser.add_argument("--summary", type=Path, nargs="*", default=[], help="files to sum up")
    chosen = parser.parse_args()
    if chosen.folder is None and range(*chosen.seeds):
        parser.error("--seeds needs the folder of laboratories whose robots are taken")
    rows = [json.loads(line) for path in chosen.summary for line in path.read_text().splitlines()]
    for seed in range(*chosen.seeds):
        rows.append(judged(chosen.folder, seed))
        print(json.dumps(rows[-1]), flush=True)
        if chosen.json:
            with chosen.json.open("a", encoding="utf-8") as file:
                file.write(json.dumps(rows[-1]) + "\n")
    print("\n".join(table(rows)))


if __name__ == "__main__":
    main()
