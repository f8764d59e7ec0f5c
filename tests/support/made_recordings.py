"""Recordings made for tests: what a tracker logs of a robot that goes from pose to pose.

Written in the shape of other programs' exports, with known truth: the readings at rest, the frame
of the tracker, the body on the platform, the noise of single samples.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
from made_data import measured

from crosscheck.measurements.data import Measurements, Sigma
from seecr.description.robot import Robot
from seecr.effects import Term
from seecr.pose import (
    Array,
    quat_conjugate,
    quat_from_rotvec,
    quat_multiply,
    quat_rotate,
    rotvec_from_quat,
    rxyz_from_quat,
)

RATE, HOLD_S, WAY_S = 50.0, 1.2, 0.8
NOISE_M, NOISE_RAD = 1e-4, 5e-4
# The tracker's frame and the body on the platform.
TURN = quat_from_rotvec(np.array([0.02, -0.01, 0.6]))
SHIFT = np.array([1.5, -0.7, 0.2])
TARGET_TURN = quat_from_rotvec(np.array([0.0, 0.05, 0.3]))
TARGET = np.array([0.01, 0.0, 0.03])
MARKERS = np.array([[0.03, 0.0, 0.02], [-0.03, 0.03, 0.02], [-0.02, -0.04, 0.03], [0.0, 0.0, 0.06]])
_QUIET = Sigma(1e-15, 1e-15)


@dataclass(frozen=True, eq=False)
class Recording:
    """A stream and what it was made of.

    Attributes:
        truth: commands, and readings at rest without any noise, in the base frame.
        t_s: (n,). position, quat: (n, 3) and (n, 4) of the body in the tracker's frame, noisy.
        markers: (n, k, 3) in the tracker's frame, noisy.
        sent_s: (k,) when each command was sent.
    """

    truth: Measurements
    t_s: Array
    position: Array
    quat: Array
    markers: Array
    sent_s: Array


def recording(
    robot: Robot, terms: Sequence[Term] = (), *, points: int = 3, level: bool = False,
    at_home: bool = False, seed: int = 0,
) -> Recording:  # fmt: skip
    """What a tracker logs of a robot with these effects; ``at_home`` in the base frame itself."""
    truth = measured(robot, terms, points=points, sigma=_QUIET)
    if level:
        truth = truth.rows(truth.command_pose[:, 3] > 1.0 - 1e-9)
    k = np.arange(truth.n_rows)
    sent = 0.5 + k * (HOLD_S + WAY_S)
    t = np.arange(0.0, sent[-1] + WAY_S + HOLD_S, 1.0 / RATE)
    # the way to pose k lasts from sent[k] on, and is smooth at both ends
    number = np.clip(np.searchsorted(sent, t, side="right") - 1, 0, None)
    part = np.clip((t - sent[number]) / WAY_S, 0.0, 1.0)
    part = np.where(number == 0, 1.0, 10 * part**3 - 15 * part**4 + 6 * part**5)
    before = np.maximum(number - 1, 0)
    place = truth.position[before] + part[:, None] * (
        truth.position[number] - truth.position[before]
    )
    turn = truth.quat_wxyz[before] + part[:, None] * (
        truth.quat_wxyz[number] - truth.quat_wxyz[before]
    )
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    rng = np.random.default_rng(seed)
    base = np.array([1.0, 0.0, 0.0, 0.0]) if at_home else quat_conjugate(TURN)
    shift = np.zeros(3) if at_home else SHIFT
    body = place + (0.0 if at_home else quat_rotate(turn, np.tile(TARGET, (len(t), 1))))
    turned = turn if at_home else quat_multiply(turn, TARGET_TURN)
    position = quat_rotate(base, body - shift) + NOISE_M * rng.standard_normal((len(t), 3))
    shake = quat_from_rotvec(NOISE_RAD * rng.standard_normal((len(t), 3)))
    quat = quat_multiply(shake, quat_multiply(base, turned))
    points_there = np.stack(
        [
            quat_rotate(base, place + quat_rotate(turn, np.tile(m, (len(t), 1))) - shift)
            for m in MARKERS
        ],
        axis=1,
    )
    points_there += NOISE_M * rng.standard_normal(points_there.shape)
    return Recording(truth, t, position, quat, points_there, sent)


def _clock_cells(t_s: Array, began: datetime | None) -> list[str]:
    """Seconds, or the times of day where it began at one."""
    if began is None:
        return [f"{s:.6f}" for s in t_s]
    return [(began + timedelta(seconds=float(s))).isoformat() for s in t_s]


def commands_csv(
    path: Path, made: Recording, *, times: bool = True, clock: float = 0.0,
    began: datetime | None = None,
) -> Path:  # fmt: skip
    """The log of commands, one row each."""
    t = _clock_cells(made.sent_s - clock, began)
    head = "run,t_s" if times else "run"
    rows = [f"{head},cmd_x_m,cmd_y_m,cmd_z_m,cmd_qw,cmd_qx,cmd_qy,cmd_qz"]
    for k, pose in enumerate(made.truth.command_pose):
        first = [made.truth.run[k], t[k]] if times else [made.truth.run[k]]
        rows.append(",".join([*first, *(f"{v:.9f}" for v in pose)]))
    path.write_text("\n".join(rows) + "\n")
    return path


def _cells(values: Array) -> list[str]:
    return ["" if v != v else f"{v:.6f}" for v in values]


def y_up(vectors: Array) -> Array:
    """Coordinates with Y up of those with Z up."""
    return np.stack([vectors[..., 0], vectors[..., 2], -vectors[..., 1]], axis=-1)


def motive_csv(
    path: Path, made: Recording, *, version: str = "1.23", unit: str = "Meters", hidden: int = 0
) -> Path:
    """An export of Motive: the body ``platform`` and its markers, Y up, xyzw."""
    factor = {"Meters": 1.0, "Centimeters": 100.0, "Millimeters": 1000.0}[unit]
    n, k = len(made.t_s), made.markers.shape[1]
    kinds = ["Rigid Body"] * 8 + ["Marker"] * (3 * k)
    names = ["platform"] * 8 + [f"platform:{i + 1}" for i in range(k) for _ in "xyz"]
    ids = ['"9E20"'] * 8 + [f'"7A0{i}"' for i in range(k) for _ in "xyz"]
    what = ["Rotation"] * 4 + ["Position"] * 3 + ["Mean Marker Error"] + ["Position"] * (3 * k)
    axes = ["X", "Y", "Z", "W", "X", "Y", "Z", ""] + ["X", "Y", "Z"] * k
    labelled = version != "1.22"
    code = ["TimeCode"] if version == "1.24" else []
    blank = [""] * len(code)
    head = [
        f"Format Version,{version},Take Name,a take,Capture Frame Rate,{RATE:.6f},"
        f"Export Frame Rate,{RATE:.6f},Total Exported Frames,{n},"
        f"Rotation Type,Quaternion,Length Units,{unit},Coordinate Space,Global",
        "",
        ",".join(["", "Type" if labelled else "", *blank, *kinds]),
        ",".join(["", "Name" if labelled else "", *blank, *names]),
        ",".join(["", "ID", *blank, *ids]),
        *([",".join(["", "Parent", *blank, *([""] * len(ids))])] if version == "1.25" else []),
        ",".join(["", "", *blank, *what]),
        ",".join(["Frame", "Time (Seconds)", *code, *axes]),
    ]
    xyzw = np.column_stack([y_up(made.quat[:, 1:]), made.quat[:, 0]])
    marks = factor * y_up(made.markers).reshape(n, -1)
    rows = []
    for i in range(n):
        body = _cells(np.concatenate([xyzw[i], factor * y_up(made.position[i])]))
        body = [""] * 7 if hidden and i % hidden == 0 else body
        row = [str(i), f"{made.t_s[i]:.6f}", *["00:00:00:00"] * len(code), *body, "0.0001"]
        rows.append(",".join([*row, *_cells(marks[i])]))
    path.write_text("\n".join([*head, *rows]) + "\n")
    return path


def _table(sep: str, rows: Iterator[Sequence[str]]) -> list[str]:
    out = [sep.join(row) for row in rows]
    return [line.replace(".", ",") for line in out] if sep == ";" else out


def vicon_csv(path: Path, made: Recording, *, sep: str = ",", rotation: str = "vector") -> Path:
    """An export of Nexus: a block of devices, one of segments, one of trajectories; Z up."""
    n, k = len(made.t_s), made.markers.shape[1]
    frame = [[str(i + 1), "0"] for i in range(n)]
    mm = 1000.0 * made.position
    if rotation == "quaternion":
        labels, unit = ["RX", "RY", "RZ", "RW"], ["", "", "", ""]
        turn = np.column_stack([made.quat[:, 1:], made.quat[:, 0]])
    else:
        labels, unit = ["RX", "RY", "RZ"], ["deg"] * 3
        how = {"vector": rotvec_from_quat, "XYZ": rxyz_from_quat}[rotation]
        turn = np.degrees(how(made.quat))
    body = np.column_stack([turn, mm])
    points = 1000.0 * made.markers.reshape(n, -1)
    blank = [""] * (3 - 1)
    segments = [
        ["Segments"], [f"{RATE:g}"], ["", "", "a:platform", *[""] * (len(labels) + 2)],
        ["Frame", "Sub Frame", *labels, "TX", "TY", "TZ"], ["", "", *unit, "mm", "mm", "mm"],
    ]  # fmt: skip
    names = [cell for i in range(k) for cell in (f"platform:points{i + 1}", *blank)]
    trajectories = [
        ["Trajectories"], [f"{RATE:g}"], ["", "", *names],
        ["Frame", "Sub Frame", *["X", "Y", "Z"] * k], ["", "", *["mm"] * (3 * k)],
    ]  # fmt: skip
    devices = [
        ["Devices"], ["1000"], ["", "", "force"], ["Frame", "Sub Frame", "Fx"], ["", "", "N"],
        ["1", "0", "3.5"], ["1", "1", "3.5"],
    ]  # fmt: skip
    lines = ["", ""]
    lines += [sep.join(row) for row in devices] + [""]
    for head, values in ((segments, body), (trajectories, points)):
        lines += [sep.join(row) for row in head]
        rows = ([*frame[i], *_cells(values[i])] for i in range(n))
        lines += [*_table(sep, rows), ""]
    path.write_text("\n".join(lines) + "\n")
    return path


def poses_csv(
    path: Path, made: Recording, *, labels: str = "", turned: bool = True,
    began: datetime | None = None,
) -> Path:  # fmt: skip
    """A plain log in metres with a scalar-first quaternion."""
    head = labels or "time_s,x_m,y_m,z_m" + (",qw,qx,qy,qz" if turned else "")
    values = np.column_stack([made.position, *([made.quat] if turned else [])])
    rows = zip(_clock_cells(made.t_s, began), values, strict=True)
    path.write_text("\n".join([head, *(",".join([t, *_cells(v)]) for t, v in rows)]) + "\n")
    return path
