"""Data that look wrong beside the model: of another robot, another unit or another convention.

For each kind of reading there is a table of what may have happened to it. If what one entry makes
of the readings is far nearer to what the model predicts than the readings as they stand, no effect
of a robot is to be sought in the difference: that is asked in a note, or, where the readings then
agree with the commands too, no verdict is passed. Exchanged columns are in
``exchanged``, cells that nobody read in ``unread``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.problem import ORIENTATION, POSITION, TENSION, Problem
from crosscheck.fit.reasons import Refusal, Unfit
from crosscheck.measurements.dwells import mean_rotation
from crosscheck.preparation.exchanged import Pulls, exchange_doubts
from crosscheck.preparation.unread import (
    LEAST_TURN,
    SEVERAL,
    is_frozen,
    mean_distances,
    rows_of_files,
)
from seecr.columns.plausible import turned_from
from seecr.counted import counted
from seecr.effects.base import Readings
from seecr.pose import (
    Array,
    quat_conjugate,
    quat_from_rotvec,
    quat_multiply,
    rotvec_from_quat,
    rxyz_from_quat,
)
from seecr.prediction.experiment import Prediction
from seecr.units import short

# Least number of rows from which a convention is known.
_LEAST_ROWS = 8
# Orientations: what four rows in five are off by counts: one in ten may be an outlier. Another
# convention brings that so many times nearer to what the model expects. If only rather nearer, that
# is asked and no more: where platforms turn little, conventions differ little.
_PART, _NEARER, _RATHER_NEARER = 0.8, 2.0, 1.5
# What is beyond noise, or beyond a platform that tilts to the other side, is so by this factor.
_FAR = 10.0
# Angles [rad] of less, or of less than so many times the stated noise, are not worth a word.
_LEAST, _NOISE = np.radians(0.01), 3.0
# Positions: a model is worse than none if it is so many times as far off as the commands are.
_WORSE = 3.0
# Units of other load cells [N]. Scales of load cells, masses and loads are wrong by less than a
# factor whose square is less than that between two units; within it is the middle half of the rows.
_UNITS, _AS_GOOD = {"kgf": 9.80665, "lbf": 4.44822, "grams (gf)": 9.80665e-3}, 1.4
# What differs by so much must have another cause than effects; radians are 57 times degrees.
_OTHER = 20.0


def suspicions(problem: Problem, at: Prediction) -> tuple[list[str], Refusal | None]:
    """Sentences that ask about what looks wrong, and why no verdict is passed, if so."""
    if is_frozen(problem):  # then whatever else looks odd follows from that
        return [], Refusal(Unfit.FROZEN_READINGS, int(problem.data.read.sum()))
    readings, pulls = at.readings, Pulls.of(problem, at)
    asked, refusal = misread_orientations(problem, readings)
    notes = [
        *asked,
        *_worse_than_commands(problem, readings),
        *_other_turns(problem, readings),
        *stuck_doubts(problem, at.pose[:, :3]),
        *(
            ([] if pulls is None else _other_units(problem, pulls))
            or _other_tensions(problem, readings)
        ),
        *exchange_doubts(problem, pulls),
    ]
    return notes, refusal


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


# orientations

_Meant = Callable[[Array], Array]


def _turns(order: str, columns: str, sign: float = 1.0) -> _Meant:
    """Quaternions of the same angles as turns about moving axes, "zyx", held by columns, "xyz"."""

    def read(quat: Array) -> Array:
        angles = sign * rxyz_from_quat(quat)
        out = np.tile([1.0, 0.0, 0.0, 0.0], (len(quat), 1))
        for axis, column in zip(order, columns, strict=True):
            turn = np.zeros_like(angles)
            turn[:, "xyz".index(axis)] = angles[:, "xyz".index(column)]
            out = quat_multiply(out, quat_from_rotvec(turn))
        return out

    return read


# How else orientations may be meant, in words that follow "if", and what that makes of them. These
# agree with the file's own to first order in the angles: where platforms turn little, by little.
_ALIKE: dict[str, _Meant] = {
    "the three angles are a rotation vector": lambda quat: quat_from_rotvec(rxyz_from_quat(quat)),
    **{
        "the angles are those of R = " + " ".join(f"R{axis}(r{axis})" for axis in order): _turns(
            order, order
        )
        for order in ("xzy", "yxz", "yzx", "zxy", "zyx")
    },
}
CONVENTIONS: dict[str, _Meant] = {
    "the last number of each quaternion is the scalar": lambda quat: np.roll(quat, 1, axis=1),
    "every rotation is inverted": quat_conjugate,
    "the last number of each quaternion is the scalar and every rotation is inverted": (
        lambda quat: quat_conjugate(np.roll(quat, 1, axis=1))
    ),
    "all three angles have the other sign": _turns("xyz", "xyz", -1.0),
    **_ALIKE,
    "rx holds yaw, ry pitch and rz roll, of R = Rz(yaw) Ry(pitch) Rx(roll)": _turns("zyx", "xyz"),
    "rx holds the angle about z and rz that about x, of R = Rx Ry Rz": _turns("xyz", "zyx"),
}


def misread_orientations(problem: Problem, readings: Readings) -> tuple[list[str], Refusal | None]:
    """Asks whether orientations of a file are of another convention; a refusal if they must be.

    Of several files the first one for which that is certain; if none is, the first one.
    """
    if problem.data.quat_wxyz is None:
        return [], None
    whole = problem.counted[:, ORIENTATION].all(axis=1)
    whole &= np.isfinite(readings.quat_wxyz).all(axis=1)
    asked = []
    for name, mine in rows_of_files(problem):
        rows = mine & whole
        found = _misread(problem, readings, rows) if rows.sum() >= _LEAST_ROWS else None
        if found is None:
            continue
        off, left, convention, ask = found
        if not ask:
            file = f" of {name.removesuffix(': ')}" if name else ""
            return [], Refusal(
                Unfit.OTHER_CONVENTION, problem.data.n_rows, off=off, left=left,
                convention=convention, file=file,
            )  # fmt: skip
        asked.append(
            f"{name}The measured orientations are {off} from those that the model expects, and "
            f"{left} if {convention}: {ask}"
        )
    return asked[:1], None


def _misread(
    problem: Problem, readings: Readings, rows: NDArray[np.bool_]
) -> tuple[str, str, str, str] | None:
    """How far some rows are off as they stand, and by which convention they seem to be written.

    Returns:
        Both angles in words, the convention, and the question to ask, "" if it is certain; None if
        it is the file's.
    """
    assert problem.data.quat_wxyz is not None
    read, expected = problem.data.quat_wxyz[rows], readings.quat_wxyz[rows]
    least = _LEAST
    if problem.data.sigma.orientation_rad is not None:
        noise = problem.reading_sigma[rows][:, ORIENTATION]
        least = max(least, _NOISE * float(np.median(noise)))
    here = min(_off(read, other) for other in (expected, *_mounted(read, expected)))
    by = {words: meant(read) for words, meant in CONVENTIONS.items()}
    best = min(by, key=lambda words: _off(by[words], expected))
    near = _off(by[best], expected)
    if here < max(least, _RATHER_NEARER * near):
        return None
    ask = "" if here >= _NEARER * near else "is that how they are written?"
    if best not in _ALIKE and not _is_no_tilt(read, expected, _told(problem)[rows], by[best]):
        if here < _FAR * near:
            return None
        # where commands are level, both are the same rotations
        ask = "is that how they are written, or does the platform tilt to the other side?"
    off, left = (_deg(float(np.median(turned_from(x, expected)))) for x in (read, by[best]))
    return off, left, best, ask


def _deg(angle: float) -> str:
    return f"{short(np.degrees(angle))} deg"


def _off(read: Array, expected: Array) -> float:
    """The angle [rad] that four rows in five are off by less."""
    return float(np.quantile(turned_from(read, expected), _PART))


def _mounted(read: Array, expected: Array) -> Iterator[Array]:
    """What is expected if the target sits in another orientation, or the tracker stands in one."""
    target = mean_rotation(quat_multiply(quat_conjugate(expected), read))
    yield quat_multiply(expected, np.tile(target, (len(read), 1)))
    frame = mean_rotation(quat_multiply(read, quat_conjugate(expected)))
    yield quat_multiply(np.tile(frame, (len(read), 1)), expected)


def _is_no_tilt(read: Array, expected: Array, told: Array, meant: Array) -> bool:
    """Whether a convention agrees much better than a tilt to the other side would.

    That is with the commands, or, where the platform rests far from these, with the model.
    """
    if _off(read, told) >= _NEARER * _off(meant, told):
        return True
    back = quat_multiply(told, quat_multiply(quat_conjugate(expected), told))
    return min(_off(read, back), _off(read, expected)) > _FAR * _off(meant, expected)


def _told(problem: Problem) -> Array:
    """Commanded quaternions (n, 4); the reference pose's if lengths are commanded."""
    told, home = problem.data.command_pose, problem.robot.reference_pose[3:]
    return np.tile(home, (problem.data.n_rows, 1)) if told is None else told[:, 3:]


def _other_turns(problem: Problem, readings: Readings) -> list[str]:
    """Whether the platform turns far less than the model expects: radians that are called degrees.

    Only changes count, since the target may sit on the platform in any orientation.
    """
    quat, home = problem.data.quat_wxyz, quat_conjugate(problem.robot.reference_pose[3:])
    if quat is None:
        read, expected = problem.data.angles_rad, rxyz_from_quat(readings.quat_wxyz)
    else:
        both = np.stack([quat, readings.quat_wxyz])
        read, expected = rotvec_from_quat(quat_multiply(both, home))
    spreads = mean_distances(read, expected, problem.counted[:, ORIENTATION])
    spreads = spreads[:, np.isfinite(spreads[0])]
    if not spreads.size:
        return []
    small, large = np.sqrt(np.mean(spreads**2, axis=1)).tolist()
    if large < LEAST_TURN or small * _OTHER > large:
        return []
    return [
        f"Rotations change by {_deg(small)} where the model expects {_deg(large)} (mean distance "
        "from their median): are these radians in columns of degrees, or is this the file of "
        "another robot?"
    ]


# positions


def _worse_than_commands(problem: Problem, readings: Readings) -> Iterator[str]:
    """That the commands themselves explain the positions of a file, and the model does not."""
    read, told = problem.data.position, problem.data.command_pose
    if told is None:
        return
    off, noise = read - readings.position, problem.reading_sigma[:, POSITION]
    for name, mine in rows_of_files(problem):
        rows = problem.counted[:, POSITION] & mine[:, None]
        if rows.any(axis=1).sum() < SEVERAL:
            continue
        model, plain = _rms(off[rows]), _rms((read - told[:, :3])[rows])
        if model > _WORSE * plain and _rms((off / noise)[rows]) > _FAR:
            yield (
                f"{name}The model is {short(1e3 * model)} mm from the measured positions, the "
                f"commands themselves are only {short(1e3 * plain)} mm from them (rms): is this "
                "the file of another robot, or does the controller correct for elasticity already?"
            )


# A run that crashes midway leaves readings of one place beside commands of many. No effect is like
# that, so a diagnosis would call it an unknown one.

# The position stands still if it moves by less than this part of the way it is predicted to move,
_STILL = 0.05
# which is more than this part of what all predicted positions spread by, over so many rows.
_FAR_WAY, _STUCK_ROWS = 0.1, 3
# Most stretches that are named, and most rows of a run that are looked at, evenly spaced.
_MOST_STRETCHES, _MOST_ROWS = 3, 400


def stuck_doubts(problem: Problem, predicted: Array) -> list[str]:
    """A sentence for each stretch of a run in which the position hardly changes but should.

    ``predicted`` (n, 3) [m] are positions by the model as it stands.
    """
    data = problem.data
    axes = np.flatnonzero(problem.counted[:, :3].any(axis=0))
    if not len(axes):
        return []
    read, there = data.position[:, axes], predicted[:, axes]
    whole = problem.use & np.isfinite(read).all(axis=1) & np.isfinite(there).all(axis=1)
    if not whole.any():
        return []
    least = _FAR_WAY * float(np.linalg.norm(np.ptp(there[whole], axis=0)))
    found = [
        (rows[first], rows[first + 1 : last + 1])
        for run in np.unique(data.run_index)
        for every in [np.flatnonzero(whole & (data.run_index == run))]
        for rows in [every[:: 1 + len(every) // _MOST_ROWS]]
        for first, last in _stretches(read[rows], there[rows], least)
    ]
    said = [_stuck_words(problem, read, there, at, rows) for at, rows in found[:_MOST_STRETCHES]]
    if (more := len(found) - _MOST_STRETCHES) > 0:
        said.append(f"The position also stays in {counted(more, 'other part')} of the data.")
    return said


def _stretches(read: Array, there: Array, least: float) -> list[tuple[int, int]]:
    """First and last rows between which positions read (n, k) stay, and those predicted do not.

    Rows at either end at which the platform should be where it is read are left out.
    """
    apart, expected = _distances(read), _distances(there)
    moved, should = (np.maximum.accumulate(table, axis=1) for table in (apart, expected))
    still = (expected > least) & (moved < _STILL * should)
    away = apart < _STILL * expected
    out, first = [], 0
    while first + _STUCK_ROWS < len(read):
        if still[first].any():
            start = int(np.argmax(away[first])) - 1
            last = int(np.flatnonzero(still[first])[-1])
            if last - start >= _STUCK_ROWS:
                out.append((start, last))
                first = last
        first += 1
    return out


def _distances(places: Array) -> Array:
    """(n, n) distances of places (n, k) from each other; zero from those before."""
    squares = ((axis[:, None] - axis) ** 2 for axis in places.T)
    return np.asarray(np.triu(np.sqrt(sum(squares))))


def _stuck_words(
    problem: Problem, read: Array, there: Array, at: np.intp, rows: NDArray[np.intp]
) -> str:
    data = problem.data
    moved, should = (
        1e3 * float(np.linalg.norm(table[rows] - table[at], axis=1).max())
        for table in (read, there)
    )
    return (
        f"Lines {data.place(int(rows[0]))} to {data.line[rows[-1]]}, run {data.run[at]}: the "
        f"position stays within {moved:.3g} mm of that at line {data.line[at]}, where the commands "
        f"should move it by {should:.4g} mm. Did the robot or its tracker stop? Then leave these "
        "rows out."
    )


# tensions


def _other_units(problem: Problem, pulls: Pulls) -> list[str]:
    """A sentence for each file whose tensions carry the load in another unit."""
    part, said = pulls.carried(), []
    for name, rows in rows_of_files(problem):
        mine = part[rows & np.isfinite(part)]
        unit = unit_of(mine)
        if unit is not None:
            said.append(
                f"{name}The measured tensions carry {short(float(np.median(mine)))} times the load "
                f"that the model puts on the cables, as if they were in {unit}, of "
                f"{_UNITS[unit]:.6g} N each. They are taken as they stand: are they in {unit}, or "
                "is the platform's mass in the MJCF so far off?"
            )
    return said


def unit_of(part: Array) -> str | None:
    """The unit in which tensions carry the load; None if that is newtons, or none that is known.

    ``part`` (k,) of the load is what they carry as newtons, row by row.
    """
    if len(part) < SEVERAL:
        return None
    low, high = np.quantile(part, [0.25, 0.75]).tolist()
    for name, newtons in _UNITS.items():
        if low * newtons > 1.0 / _AS_GOOD and high * newtons < _AS_GOOD:
            return name
    return None


def _other_tensions(problem: Problem, readings: Readings) -> list[str]:
    """That tensions are of another order than the model expects, for whatever reason."""
    seen = problem.counted[:, TENSION] & np.isfinite(readings.tensions)
    if seen.any(axis=1).sum() < SEVERAL:
        return []
    usual, there = _rms(problem.data.tensions[seen]), _rms(readings.tensions[seen])
    if usual <= 0.0 or there <= 0.0 or 1.0 / _OTHER < usual / there < _OTHER:
        return []
    return [
        f"Tensions of {short(usual)} N were measured where the model expects {short(there)} N "
        "(rms): is it another unit, the file of another robot, or a pretension that the model "
        "lacks?"
    ]
