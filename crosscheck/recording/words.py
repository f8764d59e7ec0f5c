"""Texts of a case's recording, in Markdown: what to look at, and the numbers of one pose."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from crosscheck.fit.least_squares.problem import Kind
from crosscheck.measurements.data import Measurements
from seecr.counted import counted
from seecr.pose import Array, pose_difference, rxyz_from_quat
from seecr.recording.plots import DEG, MM
from seecr.units import short

_READ_ME = """# {name}
{sentence}

**Scene.** White edges: the commanded platform. Blue box: SEECR's answer. Orange edges: MuJoCo's. \
Blue inside orange means that both agree. A thick cable pulls, coloured by its tension; a grey \
dashed one hangs slack.

**Plots.** {marks} The lowest plot is their difference as a decimal logarithm: -9 is a billionth \
of a metre.

**Play.** The timeline `{along}` goes through the {n}.{settling}
{findings}
## Largest differences
{table}
"""
_SETTLING = """ The timeline `settling_time` (choose it at the bottom left) is MuJoCo alone: it \
lets go of the platform at command {watched}, which comes to rest on SEECR's answer. Seconds are \
simulated; the platform is stopped at each peak of its motion energy, so it swings less than a \
real one would."""
_NOTHING = "No pose could be compared: see the findings."
_LINES = "Lines are SEECR, dots MuJoCo."
_CROSSES = "Crosses are SEECR, the dots on them MuJoCo."


def pose_heading(k: int, count: int) -> str:
    """The heading for one of so many poses, counted from 0."""
    return f"## Pose {k}" + (f" (of 0 to {count - 1})" if count > 1 else "")


def row_heading(data: Measurements, k: int) -> str:
    """The heading for one row of measurements: which pose it is, and where it was read."""
    where = f"line {int(data.line[k])}, run {plain(data.run[k])}"
    return f"{pose_heading(k, data.n_rows)}\n{where}\n"


def plain(text: str) -> str:
    """A user's text, with the characters escaped that Markdown would interpret."""
    return "".join(f"\\{c}" if c in "\\`*_[]<>#|" else c for c in text)


def unused(data: Measurements, k: int) -> str:
    """Why nothing is shown for a row that does not count."""
    if data.read[k]:
        return "\nLeft out: see the notes."
    return "\nA way point: passed without a reading, not compared."


def read_me(
    name: str,
    sentence: str,
    count: int,
    watched: int | None,
    rows: Sequence[tuple[str, ...]],
    findings: Sequence[str],
    *,
    lines: bool = True,
    along: str = "pose",
) -> str:
    """What to look at in a case, and its worst numbers.

    Args:
        name: of the case.
        sentence: its robot, cable and poses.
        count: number of poses.
        watched: the pose, counted from 0, whose settling is shown; None for no settling.
        rows: quantity, largest difference, its pose, the allowance there.
        findings: sentences.
        lines: whether SEECR is drawn as lines in the plots.
        along: the timeline over the poses.
    """
    listed = "\n".join(["", "", "## Findings", *(f"- {text}" for text in findings), ""])
    return _READ_ME.format(
        name=name,
        sentence=sentence,
        n=counted(count, "command"),
        along=along,
        marks=_LINES if lines else _CROSSES,
        settling="" if watched is None else _SETTLING.format(watched=watched),
        table=table(rows, ("quantity", "largest", "pose", "allowed")) if rows else _NOTHING,
        findings=listed if findings else "\n",
    )


def table(rows: Sequence[tuple[str, ...]], head: tuple[str, ...] | None = None) -> str:
    """A Markdown table; without a head its first row is the head, as Markdown needs one."""
    if head is None:
        head, *rows = rows
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def errors(
    kinds: Iterable[Kind], values: Iterable[Sequence[float | None]], names: tuple[str, ...]
) -> str:
    """A table of rms errors, one row per kind of reading.

    Args:
        kinds: the kinds. values: for each, its errors, SI; None where there is none.
        names: what the columns are.
    """
    rows = [
        (
            f"{kind.name} [{kind.unit}]",
            *(short(None if v is None else kind.factor * v) for v in row),
        )
        for kind, row in zip(kinds, values, strict=True)
    ]
    return table(rows, ("rms error", *names))


def number(value: float, unit: str, digits: int = 3) -> str:
    """A number with its unit, or a dash if there is none."""
    return f"{value:.{digits}g} {unit}" if np.isfinite(value) else "–"


def position(pose: Array) -> str:
    """Position of a pose (7,) in millimetres."""
    x, y, z = pose[:3] * MM
    return f"x {x:.2f}, y {y:.2f}, z {z:.2f} mm"


def orientation(pose: Array) -> str:
    """Angles of a pose (7,) in degrees, R = Rx(rx) Ry(ry) Rz(rz)."""
    rx, ry, rz = rxyz_from_quat(pose[3:]) * DEG + 0.0
    return f"rx {rx:.2f}, ry {ry:.2f}, rz {rz:.2f}°"


def shift(pose: Array, command: Array) -> str:
    """Displacement of a pose (7,) from its command."""
    if not np.isfinite(pose).all():
        return "no answer"
    x, y, z = (pose[:3] - command[:3]) * MM
    return f"dx {x:+.2f}, dy {y:+.2f}, dz {z:+.2f} mm"


def turn(pose: Array, command: Array) -> str:
    """Angle between a pose (7,) and its command."""
    if not np.isfinite(pose).all():
        return "no answer"
    return f"{np.linalg.norm(pose_difference(pose, command)[3:]) * DEG:.2f}°"


def instant(t_s: float, kinetic: float, distance: Array, slack: str) -> str:
    """The numbers of one instant of a settling.

    Args:
        t_s: simulated time [s].
        kinetic: kinetic energy [J].
        distance: (2,) [m, rad] from SEECR's answer.
        slack: names of slack cables.
    """
    rows = [
        ("from SEECR's answer", number(distance[0] * MM, "mm")),
        ("rotation from it", number(distance[1] * DEG, "°")),
        ("kinetic energy", number(kinetic, "J")),
        ("slack cables", slack),
    ]
    return f"## Settling, {t_s:.3f} s\n" + table(rows)
