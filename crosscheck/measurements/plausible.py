"""Readings that are implausible beside their commands: units, signs, orders, numbers nobody read.

Commands foretell readings roughly. What cannot be a reading, or follows the commands only in
another unit or order, is refused with its remedy; what may be right is noted. What only a model of
the robot shows is looked for later, in ``crosscheck.preparation.suspect``.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from crosscheck.measurements.data import Measurements
from crosscheck.measurements.dwells import mean_rotation
from seecr.columns.known import ANGLES, POSITION, Column, Columns
from seecr.columns.plausible import away_from, scalar_may_be_last, turned_from
from seecr.errors import Faults, InputFileError
from seecr.pose import Array, quat_conjugate, quat_from_rxyz, quat_multiply, rxyz_from_quat

if TYPE_CHECKING:
    from seecr.description.robot import Robot

_PARTS = (*POSITION, *ANGLES)
# A spread, a rate or a number that every row repeats is known from so many rows.
_LEAST_ROWS = 4
# Sizes, in frames: positions farther away are no readings, even in the coordinates of a hall; odd
# commands; those away from where they should be; axes along which commands are meant to move.
_NOWHERE, _FAR, _OFF, _MOVED = 100.0, 2.5, 0.05, 0.02
# Angles [rad]: more are no readings; axes about which commands are meant to turn; a platform that
# cables hold is not off by so much, and one that follows its commands is off by less (rms).
_TURNS, _TURNED, _SCATTERED, _FOLLOWED = 20.0 * np.pi, np.radians(0.5), 0.5, 0.1
# Units of lengths differ by 10 or 1000: spreads that differ by more are in another unit.
_OTHER_UNIT = 100.0
# How closely readings follow the commands (correlation), and how near their rate is to that of
# another unit, or to -1; platforms that hang on few cables do not move as far as they are told.
_FOLLOWS, _AGAINST, _RATE_OFF, _AS_FAR = 0.9, 0.95, 0.25, 0.5
# Positions do not follow the commands beyond this part of their spread; in another order of axes
# they do if they are so many times nearer.
_ASTRAY, _NEARER = 0.5, 4.0
# At least so many nines, such as 999 or -99999, and nothing else, mean "not read" in every row.
_NINES = 3

_REMEDY = "leave the cells empty where nothing was read"
_SURVEY = ", and subtract a constant from coordinates in a survey's grid"


def check_readings(columns: Columns, robot: Robot, data: Measurements) -> list[str]:
    """Notes that a reader should see.

    Raises:
        InputFileError: commands or readings that must be in another unit or order, or are none.
    """
    _refuse_unread(columns, robot)
    placed, turned = list[str](), list[str]()
    if data.command_pose is not None:
        pairs = _Pairs.of(columns, robot, data.command_pose)
        _refuse_lengths(pairs)
        turned = _check_angles(pairs)
        _refuse_zeros(pairs)
        if "tracker_frame" not in data.free:  # else positions are in a frame of their own
            placed = _mirrored(pairs) or _elsewhere(pairs)
    return [
        *_far(robot, data),
        *placed,
        *turned,
        *_other_order(columns, robot, data),
    ]


# numbers that no instrument reads


def _refuse_unread(columns: Columns, robot: Robot) -> None:
    """Refuse numbers that are absurd, or that stand for "not read"."""
    far = _NOWHERE * robot.reach
    near = f"within {far:.3g} m of the robot"
    faults = Faults()
    for axis, home in zip(POSITION, robot.reference_pose[:3], strict=True):
        faults.of(_refuse_beyond, columns, f"meas_{axis}", float(home), far, near, _SURVEY)
    for angle in ANGLES:
        faults.of(_refuse_beyond, columns, f"meas_{angle}", 0.0, _TURNS, "of at most ten turns")
    parts = [f"meas_{part}" for part in _PARTS]
    for quantity in (*parts, *(f"tension_{i + 1}" for i in range(robot.n_cables))):
        if quantity in columns.known:
            faults.of(_refuse_nines, columns, quantity)
    faults.check()


def _refuse_beyond(
    columns: Columns, quantity: str, home: float, most: float, where: str, more: str = ""
) -> None:
    if quantity not in columns.known:
        return
    column, values = columns.known[quantity], columns.numbers(quantity, blank_is_nan=True)
    given = columns.table.numbers(column.index, blank_is_nan=True)

    def said(row: int) -> str:
        text = f"expected a reading {where}, got {given[row]:.10g} {column.unit.suffix}; "
        if column.unit.suffix == "m" and abs(1e-3 * values[row] - home) <= most / _NOWHERE:
            text += f"if it is in mm, name the column {quantity}_mm; "
        return f"{text}{_REMEDY}{more}"

    columns.refuse(np.abs(values - home) > most, quantity, said)


def _refuse_nines(columns: Columns, quantity: str) -> None:
    """Refuse a column that says the same number of nines in every row that it has."""
    given = columns.table.numbers(columns.known[quantity].index, blank_is_nan=True)
    read = given[np.isfinite(given)]
    if len(read) < _LEAST_ROWS or np.ptp(read) > 0.0 or not is_nines(float(read[0])):
        return
    columns.refuse(
        np.isfinite(given),
        quantity,
        lambda row: f"expected readings, got {given[row]:g} in every row; {_REMEDY}",
    )


def is_nines(value: float) -> bool:
    """Whether a number is what programs write for "not read"."""
    digits = f"{abs(value):.12g}"
    return len(digits) >= _NINES and set(digits) == {"9"}


# readings beside commands


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Readings x y z [m] and rx ry rz [rad] beside commanded ones.

    Attributes:
        columns: the file's. known: those in which something was read, by their place in the six.
        robot: the robot. quat: (n, 4) commanded orientations.
        read, told: (n, 6); NaN where nothing was read.
    """

    columns: Columns
    known: dict[int, Column]
    robot: Robot
    quat: Array
    read: Array
    told: Array

    @classmethod
    def of(cls, columns: Columns, robot: Robot, pose: Array) -> _Pairs:
        """Of commanded poses (n, 7)."""
        told = np.concatenate([pose[:, :3], rxyz_from_quat(pose[:, 3:])], axis=1)
        read, known = np.full_like(told, np.nan), dict[int, Column]()
        for k, part in enumerate(_PARTS):
            if (column := columns.known.get(f"meas_{part}")) is not None:
                read[:, k] = columns.numbers(f"meas_{part}", blank_is_nan=True)
                known |= {k: column} if np.isfinite(read[:, k]).any() else {}
        return cls(columns, known, robot, pose[:, 3:], read, told)

    @property
    def axes(self) -> list[int]:
        """Coordinates of positions that were read."""
        return [k for k in self.known if k < 3]

    def both(self, k: int) -> Array:
        """(2, j) readings and commands about their means, where there are readings."""
        both = np.stack([self.read[:, k], self.told[:, k]])[:, np.isfinite(self.read[:, k])]
        return np.asarray(both - both.mean(axis=1, keepdims=True))

    def spreads(self, k: int) -> tuple[float, float]:
        """Mean distances from the median; an outlier can only make them larger."""
        both = self.both(k)
        if both.shape[1] < _LEAST_ROWS:
            return 0.0, 0.0
        read, told = np.abs(both - np.median(both, axis=1, keepdims=True)).mean(axis=1).tolist()
        return read, told

    def follows(self, k: int) -> tuple[float, float]:
        """Correlation of readings with commands, and rate; 0, 0 if one of them hardly moves."""
        read, told = self.spreads(k)
        if read == 0.0 or not self.moves(k):
            return 0.0, 0.0
        (read, cross), (_, told) = (self.both(k) @ self.both(k).T).tolist()
        return cross / float(np.sqrt(read * told)), cross / told

    def moves(self, k: int) -> bool:
        """Whether commands are meant to move along or about an axis."""
        return self.spreads(k)[1] > (_MOVED * self.robot.reach if k < 3 else _TURNED)

    def error(self, k: int, text: str) -> InputFileError:
        """The error about a column."""
        return self.columns.table.error(text, column=self.known[k].name)


def _usual(off: Array) -> float:
    """Median size of rows (n, k), without NaN; 0 of a few."""
    sizes = np.linalg.norm(off[np.isfinite(off).all(axis=1)], axis=1)
    return float(np.median(sizes)) if len(sizes) >= _LEAST_ROWS else 0.0


def _usual_spread(places: Array) -> float:
    """Median distance of places (n, k), without NaN, from their median; 0 of a few."""
    known = np.isfinite(places).all(axis=1)
    return _usual(places - np.median(places[known], axis=0)) if known.any() else 0.0


def _refuse_zeros(pairs: _Pairs) -> None:
    """Refuse positions of exactly 0 0 0 far from the command, which stand for "not seen"."""
    which = pairs.axes
    if len(which) < 2:
        return
    off = np.linalg.norm(pairs.told[:, which], axis=1)
    pairs.columns.refuse(
        np.all(pairs.read[:, which] == 0.0, axis=1) & (off > _OFF * pairs.robot.reach),
        f"meas_{_PARTS[which[0]]}",
        lambda row: (
            f"expected a position near its command, got exactly {' '.join('0' * len(which))}, "
            f"{off[row]:.3g} m from it; {_REMEDY}"
        ),
    )


def _refuse_lengths(pairs: _Pairs) -> None:
    """Refuse positions in another unit than their columns state, all of them or one."""
    which = pairs.axes
    if not which:
        return
    read, told = (_usual_spread(places[:, which]) for places in (pairs.read, pairs.told))
    if read > 0.0 and told > 0.0 and not 1.0 / _OTHER_UNIT < read / told < _OTHER_UNIT:
        raise _other_unit(pairs, which[0], read, told)
    for k in which:
        read, told = pairs.spreads(k)
        if pairs.moves(k) and 0.0 < read < told / _OTHER_UNIT:
            raise _other_unit(pairs, k, read, told)


def _other_unit(pairs: _Pairs, k: int, read: float, told: float) -> InputFileError:
    text = (
        f"positions were measured over {read:.3g} m, but commanded over {told:.3g} m; expected "
        f"about the same; are these really {pairs.known[k].unit.suffix}? Name the columns by their "
        f"unit, such as meas_{_PARTS[k]}_{'mm' if read > told else 'm'}"
    )
    return pairs.error(k, text)


def _check_angles(pairs: _Pairs) -> list[str]:
    """Refuse angles that follow the commands in the other unit only; note those far from them."""
    units = {k: column.unit.suffix for k, column in pairs.known.items() if k >= 3}
    for k, unit in units.items():
        follows, rate = pairs.follows(k)
        other, mistaken = ("rad", np.radians(1.0)) if unit == "deg" else ("deg", np.degrees(1.0))
        if follows > _FOLLOWS and abs(rate / mistaken - 1.0) < _RATE_OFF:
            raise pairs.error(
                k,
                f"the angles are {rate:.3g} times the commanded ones; expected about the same; are "
                f"these really {unit}? Name the column by its unit, such as "
                f"meas_{_PARTS[k]}_{other}",
            )
    radians = [k for k, unit in units.items() if unit == "rad"]
    # robots that hang on fewer cables than their degrees of freedom may tilt by so much
    if radians and pairs.robot.n_driven >= pairs.robot.n_dof:
        _refuse_degrees(pairs, radians)
    for k in radians:
        off = (pairs.read - pairs.told)[np.isfinite(pairs.read[:, k]), k]
        if len(off) >= _LEAST_ROWS and _rms(off) > _SCATTERED:
            return [
                f"Column {pairs.known[k].name} is {_rms(off):.3g} rad (rms) from the commanded "
                f"angles: are these degrees? Name the column by its unit, such as "
                f"meas_{_PARTS[k]}_deg."
            ]
    return []


def _refuse_degrees(pairs: _Pairs, radians: list[int]) -> None:
    """Refuse radians that scatter about the commands, and as degrees follow them.

    How the body is turned on the platform does not matter.
    """
    angles = [k for k in pairs.known if k >= 3]
    seen = np.isfinite(pairs.read[:, angles]).all(axis=1)
    if seen.sum() < _LEAST_ROWS:
        return
    read, told = pairs.told[seen], pairs.quat[seen]
    read[:, angles] = pairs.read[seen][:, angles]
    small = read.copy()
    small[:, radians] = np.radians(read[:, radians])
    inside = quat_multiply(quat_conjugate(told), quat_from_rxyz(read[:, 3:]))
    scatter = _rms(turned_from(inside, mean_rotation(inside)))
    off = _rms(turned_from(quat_from_rxyz(small[:, 3:]), told))
    if scatter < _SCATTERED or off > _FOLLOWED:
        return
    worst = max(radians, key=lambda k: float(np.std(read[:, k])))
    text = (
        f"expected radians, got angles that scatter by {scatter:.2g} rad (rms) about the commanded "
        f"ones and follow them to {np.degrees(off):.2g} deg if they are degrees; name the column "
        f"meas_{_PARTS[worst]}_deg"
    )
    raise pairs.error(worst, text)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


# notes


def _far(robot: Robot, data: Measurements) -> list[str]:
    reach = robot.reach
    away = np.max(away_from(robot, data.command_pose, data.command_lengths), axis=1)
    row = int(np.argmax(away))
    if away[row] <= _FAR * reach:
        return []
    return [
        f"Line {data.place(row)}: a command {away[row]:.3g} m away, where the frame is "
        f"{reach:.3g} m across: check its unit."
    ]


def _mirrored(pairs: _Pairs) -> list[str]:
    """A note about positions that run against the commands, along one axis or several."""
    rates = {k: pairs.follows(k) for k in pairs.axes}
    against = [k for k, (f, rate) in rates.items() if f < -_AGAINST and abs(rate + 1.0) < _AS_FAR]
    if not against:
        return []
    column, go, signs = "Column", "goes", "is its sign"
    if len(against) > 1:
        column, go, signs = "Columns", "go", "are their signs"
    return [
        f"{column} {' '.join(pairs.known[k].name for k in against)} {go} against the commands "
        f"along {' and '.join(_PARTS[k] for k in against)}: {signs} the other way round, or has "
        "the tracker's frame other axes than the robot's (crosscheck import aligns turned ones, "
        "not mirrored ones)?"
    ]


def _elsewhere(pairs: _Pairs) -> list[str]:
    """A note about positions that do not follow the commands, unless in another order of axes."""
    which = pairs.axes
    read, told = pairs.read[:, which], pairs.told[:, which]
    usual, spread = _usual(read - told), _usual_spread(told)
    if not which or usual <= max(_ASTRAY * spread, _OFF * pairs.robot.reach):
        return []
    if _usual_spread(read) == 0.0:  # a tracker that stood still, which is another matter
        return []
    said = ""
    for i, j in combinations(range(len(which)), 2):
        other = read.copy()
        other[:, [i, j]] = read[:, [j, i]]
        if _NEARER * (near := _usual(other - told)) < usual:
            names = f"meas_{_PARTS[which[i]]} and meas_{_PARTS[which[j]]}"
            said = f", but only {near:.3g} m if {names} are exchanged"
    return [
        f"The measured positions do not follow the commands: they are {usual:.3g} m from them, "
        f"which spread by {spread:.3g} m{said}. Are axes exchanged, is this the file of another "
        "robot, or is the tracker's frame not the robot's (crosscheck import aligns it)?"
    ]


def _other_order(columns: Columns, robot: Robot, data: Measurements) -> list[str]:
    """Find quaternions that are far off, unless their last number is the scalar."""
    told = np.tile(robot.reference_pose[3:], (data.n_rows, 1))
    if data.command_pose is not None:
        if "cmd_qw" in columns.known and scalar_may_be_last(data.command_pose[:, 3:], told):
            raise columns.table.error(
                "every command turns the platform by more than 90 deg from the reference pose, "
                "but none by 45 deg if the scalar is taken as last; expected the scalar first; "
                "put the right numbers into cmd_qw cmd_qx cmd_qy cmd_qz",
                column="cmd_qw",
            )
        told = data.command_pose[:, 3:]
    if data.quat_wxyz is None or "meas_qw" not in columns.known:
        return []
    rows = np.isfinite(data.quat_wxyz).all(axis=1)
    quat, told = data.quat_wxyz[rows], told[rows]
    if not scalar_may_be_last(quat, told, part=0.5):
        return []
    here, there = (
        np.degrees(np.median(turned_from(np.roll(quat, places, axis=1), told))) for places in (0, 1)
    )
    return [
        f"The measured quaternions are {here:.0f} deg from the commanded ones, and only "
        f"{there:.0f} deg if their last number is the scalar: are meas_qw meas_qx meas_qy meas_qz "
        "in the right order?"
    ]
