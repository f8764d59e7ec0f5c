"""How time grows: of `seecr.solve` with poses and threads, of commands with rows; see bench.py."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

import numpy as np

import seecr
from seecr.columns.csv import read_table
from seecr.parallel import undivided

POSES_HEAD = (
    "poses, demobot_cogiro: one thread (µs), all threads (µs), "
    "demobot_parallel: one thread (µs), all threads (µs)"
)
ROWS = (150, 1500, 15_000)
COMMANDS = {
    "import": "crosscheck import poses DIR/log.csv --robot DIR/robot.xml --commands DIR/told.csv "
    "--aligned --out DIR/imported",
    "compare": "crosscheck compare DIR/robot.xml DIR/measured.csv --out DIR/compared",
    "plan": "crosscheck plan DIR/robot.xml DIR/measured.csv --out DIR/planned",
    "diagnose": "crosscheck diagnose DIR/robot.xml DIR/measured.csv --out DIR/diagnosed",
}
ROWS_HEAD = ", ".join(["rows", *COMMANDS])
# A log has so many readings of each row, ten a second, of which the last ones are on the way.
_READINGS, _MOVING = 12, 2


def of_poses(
    names: tuple[str, ...], poses_of: Callable[[seecr.Robot], np.ndarray]
) -> list[list[str]]:
    """Microseconds a pose, from one to a million poses, by the clock: the best of some runs."""
    columns = []
    for name in names:
        robot = seecr.load_robot(seecr.model_path(name))
        poses = poses_of(robot)
        many = np.tile(poses, (50, 1))
        for alone in (True, False):
            counts = [10**k for k in range(7)]
            columns.append([f"{_clocked(robot, many[:n], alone):.3g}" for n in counts])
    return [[f"{10**k:,}", *row] for k, row in enumerate(zip(*columns, strict=True))]


def _clocked(robot: seecr.Robot, poses: np.ndarray, alone: bool) -> float:
    best = np.inf
    with undivided() if alone else nullcontext():
        for _ in range(4 if len(poses) > 1000 else 40):
            start = time.perf_counter()
            seecr.solve(robot, poses)
            best = min(best, time.perf_counter() - start)
    return 1e6 * best / len(poses)


def of_rows(spent_by: Callable[[str, str], float]) -> list[list[str]]:
    """Seconds of processor of each command, once, with numbers of rows; nothing is compiled."""
    out = []
    for n in (min(ROWS), *ROWS):  # the first time loads and compiles
        with tempfile.TemporaryDirectory() as folder:
            _write_data(Path(folder), n, spent_by)
            out.append(
                [f"{n:,}", *(f"{spent_by(words, folder):.1f}" for words in COMMANDS.values())]
            )
    return out[1:]


def _write_data(folder: Path, n: int, spent_by: Callable[[str, str], float]) -> None:
    """What a robot with a hidden effect reads on its way to and fro, and the log that says so."""
    way = np.linspace(0.0, 2.0 * np.pi, n)
    places = seecr.load_robot(seecr.model_path("demobot_cogiro")).reference_pose[:3] + np.stack(
        [0.1 * np.sin(7 * way), 0.1 * np.cos(11 * way), 0.05 * np.sin(3 * way)], axis=1
    )
    _write(folder / "poses.csv", "cmd_x_m,cmd_y_m,cmd_z_m", places)
    twin = "crosscheck twin demobot_cogiro --hide 7 --effects 1 --poses DIR/poses.csv --out DIR"
    spent_by(twin, str(folder))
    table = read_table(folder / "measured.csv")
    names = [k for k, name in enumerate(table.names) if name.startswith("meas_")]
    read = np.stack([table.numbers(k, blank_is_nan=False) for k in names], axis=1)
    part = np.maximum(np.arange(_READINGS) - (_READINGS - 1 - _MOVING), 0) / (_MOVING + 1)
    after = np.concatenate([read[1:], read[-1:]])
    log = (read[:, None] + part[:, None] * (after - read)[:, None]).reshape(-1, read.shape[1])
    log += np.random.default_rng(0).normal(0.0, 1e-5, log.shape)
    t_s = 0.1 * np.arange(len(log))
    _write(folder / "log.csv", "t_s,x_m,y_m,z_m,qw,qx,qy,qz", np.column_stack([t_s, log]))
    told = np.column_stack([t_s[::_READINGS], places])
    _write(folder / "told.csv", "t_s,cmd_x_m,cmd_y_m,cmd_z_m", told)


def _write(path: Path, names: str, table: np.ndarray) -> None:
    np.savetxt(path, table, "%.9g", ",", header=names, comments="")
