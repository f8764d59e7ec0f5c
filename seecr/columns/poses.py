"""Poses and lengths in a file: commanded poses, wanted poses, and measured orientations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from seecr.columns.cells import decimals
from seecr.columns.known import ANGLES, POSITION, QUATERNION, Columns
from seecr.columns.plausible import refuse_degrees
from seecr.counted import counted
from seecr.description.joints import (
    OFF_MANIFOLD,
    changeable,
    determined,
    off_joints,
    projected,
)
from seecr.errors import Faults
from seecr.files import toml_path
from seecr.pose import NORM_TOLERANCE, SMALLEST, Array, quat_from_rxyz, rxyz_from_quat
from seecr.units import millimetres

if TYPE_CHECKING:
    from seecr.description.robot import Robot


def command_lengths(columns: Columns, robot: Robot) -> Array | None:
    """Commanded rest lengths (n, m) [m], or None if the file has no such columns.

    Those of passive lines, which have no column, are as the robot is described.

    Raises:
        InputFileError: a cable without a column, a passive line with one, or no length.
    """
    given = columns.cables("length")
    if not given:
        return None
    _refuse_passive(columns, robot, given)
    driven = (np.flatnonzero(robot.driven) + 1).tolist()
    missing = [f"length_{i}_m" for i in driven if i not in given]
    if missing:
        every = "" if robot.all_driven else " that a winch drives"
        raise columns.half_there(
            "length", missing, f"all {counted(len(driven), 'cable')} of the robot{every}"
        )
    lengths, faults = np.tile(robot.rest_lengths, (columns.n_rows, 1)), Faults()
    lengths[:, robot.driven] = columns.all_numbers([f"length_{i}" for i in driven])
    for i in driven:
        rest = float(robot.rest_lengths[i - 1])
        faults.of(_check_length, columns, f"length_{i}", lengths[:, i - 1], rest)
    faults.check()
    return lengths


def _refuse_passive(columns: Columns, robot: Robot, given: Sequence[int]) -> None:
    """Refuse columns of lengths of lines that no winch drives, all at once."""
    odd = [i for i in given if not robot.driven[i - 1]]
    if odd:
        one, names = len(odd) == 1, ", ".join(robot.cable_names[i - 1] for i in odd)
        raise columns.table.error(
            f"no winch drives {names}: expected no length of {'it' if one else 'them'}, leave out "
            f"{' '.join(columns.known[f'length_{i}'].name for i in odd)}"
        )


def _check_length(columns: Columns, quantity: str, length: Array, rest: float) -> None:
    """Refuse lengths (n,) [m] of a column that are none; ``rest`` [m] is that at the reference."""
    unit = columns.known[quantity].unit
    one = unit.to_si(1.0)
    toml = toml_path(columns.table.path).name
    columns.refuse(
        length < SMALLEST,
        quantity,
        lambda row: (
            f"expected a length above zero, got {length[row] / one:.6g} {unit.suffix}: it is all "
            "of the cable from its exit point on; to changes since the reference pose add its rest "
            f'length there, {rest / one:.6g} {unit.suffix}, and put lengths = "told" into {toml}'
        ),
    )


def command_poses(columns: Columns, robot: Robot) -> Array:
    """Commanded poses (n, 7); coordinates that the robot cannot change may be missing in the file.

    Raises:
        InputFileError: there is no command, or an incomplete one.
    """
    poses = poses_of(columns, robot, "cmd", "commanded")
    if poses is None:
        raise columns.table.error(
            "no command; expected columns cmd_x_m cmd_y_m cmd_z_m, or length_1_m to "
            f"length_{robot.n_cables}_m{columns.near_misses()}; if they have other names, say so "
            "with --columns THEIRS=cmd_x_m,... or [columns] in the TOML"
        )
    return poses


def poses_of(columns: Columns, robot: Robot, prefix: str, word: str) -> Array | None:
    """Poses (n, 7) of columns with a prefix; None if there are none. ``word`` is for notes.

    Raises:
        InputFileError: a pose is incomplete.
    """
    present = columns.present
    if not present(prefix, POSITION + QUATERNION + ANGLES):
        return None
    free, reference = changeable(robot), robot.reference_pose
    # joints may determine what is left out, which is found when all is read
    needed = free & (not robot.joints)
    noted = not robot.joints
    of = (prefix, word, "m")
    position = _group(columns, of, POSITION, needed[:3], reference[:3], noted=noted)
    if present(prefix, QUATERNION):
        orientation = _quaternions(columns, prefix, blank_is_nan=False)
    elif present(prefix, ANGLES):
        rxyz = rxyz_from_quat(reference[3:])
        of = (prefix, word, "deg")
        angles = _group(columns, of, ANGLES, needed[3:], rxyz, noted=noted)
        orientation = quat_from_rxyz(angles)
    else:
        orientation = np.tile(reference[3:], (columns.n_rows, 1))
    poses = np.concatenate([position, orientation], axis=1)
    turned = False
    if robot.joints:
        poses, turned = _on_joints(columns, robot, (prefix, word), poses, free)
    if not present(prefix, QUATERNION + ANGLES):
        why = "the joints determine it" if turned else "that of the reference pose is used"
        columns.notes.append(f"No {word} orientation: {why}.")
    return poses


# Nobody who commands a robot rounds to more than this part of its size, or of a radian.
_COARSEST = 1e-3


def _on_joints(
    columns: Columns, robot: Robot, of: tuple[str, str], poses: Array, free: NDArray[np.bool_]
) -> tuple[Array, bool]:
    """The poses (n, 7) that joints reach nearest to those of a file, and whether they turn them.

    What the file leaves out of a pose must follow from the rest, or from the orientation of the
    reference pose. What it states may be as rounded as its digits: then the true pose, which the
    joints reach, is at most half a unit of the last digit away in each part, and the nearest one
    no farther than that one.

    Raises:
        InputFileError: parts are missing, or a pose is farther from the joints than rounding.
    """
    prefix, word = of
    given = np.array([f"{prefix}_{part}" in columns.known for part in POSITION + ANGLES])
    given[3:] |= bool(columns.present(prefix, QUATERNION))
    stated = given.copy()
    turned = bool(given[3:].any()) or determined(robot, stated)
    # angles that cannot change are as good as given; without any, those of the reference pose are
    stated[3:] |= (given[3:].any() and not (free & ~given)[3:].any()) or not turned
    turns = turned and bool(free[3:].any())
    names = [f"{prefix}_{part}_{'m' if part in POSITION else 'deg'}" for part in POSITION + ANGLES]
    parts = range(6 if given[3:].any() else 3)
    missing = [names[k] for k in parts if free[k] and not given[k]]
    need = " ".join(names[k] for k in parts if free[k])
    if not determined(robot, stated):
        raise columns.half_there(f"{word} pose", missing, need)
    if (stated | ~free).all() and off_joints(robot, poses) is None:
        _absent_notes(columns, prefix, given, free)
        return poses, turns
    reached, off, other = projected(robot, poses, stated)
    if not stated.all() and other.any():
        raise columns.half_there(f"{word} pose", missing, need)
    _absent_notes(columns, prefix, given, free)
    allowed = _rounding(columns, robot, prefix)
    size = np.repeat([robot.length, 1.0], 3)
    far = np.linalg.norm(off / size, axis=1)
    row = int(np.argmax(far))
    if far[row] > np.linalg.norm(allowed / size) + OFF_MANIFOLD:
        raise columns.table.error(_too_far(robot, off[row], allowed), row=row)
    if far[row] > OFF_MANIFOLD:
        moved = _distance(off[np.argmax(far)])
        columns.notes.append(
            f"Poses {word} are rounded: those that the joints reach are up to {moved} away, "
            "and are taken."
        )
    return reached, turns


def _absent_notes(
    columns: Columns, prefix: str, given: NDArray[np.bool_], free: NDArray[np.bool_]
) -> None:
    """Notes on coordinates that were left out, and on angles if some are given."""
    for parts in (range(3), range(3, 6) if given[3:].any() else ()):
        for stays in (True, False):
            lost = [k for k in parts if not given[k] and free[k] != stays]
            if lost:
                names = " ".join(f"{prefix}_{(POSITION + ANGLES)[k]}" for k in lost)
                why = "the robot cannot move there, the reference pose's value is used"
                columns.notes.append(f"No {names}: {why if stays else 'the joints determine it'}.")


def _rounding(columns: Columns, robot: Robot, prefix: str) -> Array:
    """(6,) half a unit of the last digit [m, rad]; the finest of the positions, and of the angles.

    A quaternion that is off by d is off by an angle of 2 d.
    """
    out = np.repeat([_COARSEST * robot.reach, _COARSEST], 3)
    for parts, where, factor in (
        (POSITION, slice(0, 3), 1.0), (ANGLES, slice(3, 6), 1.0), (QUATERNION, slice(3, 6), 2.0)
    ):  # fmt: skip
        for part in columns.present(prefix, parts):
            column = columns.known[f"{prefix}_{part}"]
            half = 0.5 * 10.0 ** -max(map(decimals, columns.table.cells[column.index]))
            out[where] = np.minimum(out[where], factor * column.unit.to_si(half))
    return out


def _distance(off: Array) -> str:
    """Parts (6,) [m, rad] of a distance in words."""
    size, turn = float(np.linalg.norm(off[:3])), float(np.degrees(np.linalg.norm(off[3:])))
    words = [millimetres(size, 3)] if size > 0.0 else []
    return " and ".join([*words, *([f"{turn:.3g} deg"] if turn > np.degrees(OFF_MANIFOLD) else [])])


def _too_far(robot: Robot, off: Array, allowed: Array) -> str:
    part = int(np.argmax(np.abs(off) / np.repeat([robot.length, 1.0], 3)))
    unit = "m" if part < 3 else "rad"
    coarse = f", where rounding of its digits explains {allowed[part]:.2g} {unit}"
    return (
        f"the joints of robot {robot.name} cannot reach the commanded pose: it is off by "
        f"{abs(off[part]):.3g} {unit} in {'xyz'[part % 3]}"
        f"{coarse if allowed[part] > OFF_MANIFOLD else ''}; expected a pose that they can reach; "
        "are these the commands of another robot?"
    )


def wanted_poses(columns: Columns, robot: Robot) -> Array | None:
    """Poses (n, 7) of columns ``want_*``, for what was measured; None if there are none.

    Any part of the pose may be wanted, as any part of it may be read: NaN where a coordinate has no
    column, or a row an empty cell.

    Raises:
        InputFileError: an orientation is incomplete.
    """
    present = columns.present
    if not present("want", POSITION + QUATERNION + ANGLES):
        return None
    wanted = np.full((columns.n_rows, 7), np.nan)
    for k, part in enumerate(POSITION):
        if present("want", (part,)):
            wanted[:, k] = columns.numbers(f"want_{part}", blank_is_nan=True)
    if present("want", QUATERNION):
        wanted[:, 3:] = _quaternions(columns, "want", blank_is_nan=True)
    elif present("want", ANGLES):
        rxyz = rxyz_from_quat(robot.reference_pose[3:])
        of, free = ("want", "wanted", "deg"), changeable(robot)[3:]
        angles = _group(columns, of, ANGLES, free, rxyz, blank_is_nan=True)
        given = np.isfinite(angles).all(axis=1)
        wanted[given, 3:] = quat_from_rxyz(angles[given])
    return wanted


def aimed_poses(columns: Columns, robot: Robot) -> tuple[Array, Array | None]:
    """Poses (n, 7) that lengths are for, and what is stated of them, if anything.

    Of several equilibria with the same lengths, one near the first is meant. What is not stated is
    as at the reference pose there. Unless every row states a pose it is NaN in the second, since
    nothing deviates from what nobody wanted.

    Raises:
        InputFileError: an orientation is incomplete.
    """
    if _all_stated(columns, robot):
        whole = poses_of(columns, robot, "want", "wanted")
        assert whole is not None
        return whole, whole
    reference = np.tile(robot.reference_pose, (columns.n_rows, 1))
    stated = wanted_poses(columns, robot)
    if stated is None:
        return reference, None
    columns.notes.append(
        "Columns want_* state no whole pose in every row: what is missing is taken from the "
        "reference pose where the search begins, and no deviations are given."
    )
    return np.where(np.isfinite(stated), stated, reference), stated


def _all_stated(columns: Columns, robot: Robot) -> bool:
    """Whether each row has a wanted position, and an orientation if there are columns for one."""
    given = columns.present("want", POSITION + QUATERNION + ANGLES)
    needed = {part for part, free in zip(POSITION, changeable(robot), strict=False) if free}
    cells = [columns.numbers(f"want_{part}", blank_is_nan=True) for part in given]
    return bool(given) and needed.issubset(given) and bool(np.isfinite(cells).all())


def _group(
    columns: Columns, of: tuple[str, str, str], parts: tuple[str, ...], free: NDArray[np.bool_],
    reference: Array, *, blank_is_nan: bool = False, noted: bool = True,
) -> Array:  # fmt: skip
    """Three coordinates or angles (n, 3); the reference pose's where they cannot change.

    ``of`` is the columns' prefix, the word for it, and a unit for errors; ``noted`` says whether
    missing columns are.

    Raises:
        InputFileError: a missing column, or radians that must be degrees.
    """
    prefix, word, unit = of
    absent = [k for k, part in enumerate(parts) if f"{prefix}_{part}" not in columns.known]
    missing = [f"{prefix}_{parts[k]}_{unit}" for k in absent if free[k]]
    if missing:
        need = " ".join(f"{prefix}_{parts[k]}_{unit}" for k in range(3) if free[k])
        raise columns.half_there(f"{word} pose", missing, need)
    if absent and noted:
        names = " ".join(f"{prefix}_{parts[k]}" for k in absent)
        columns.notes.append(
            f"No {names}: the robot cannot move there, the reference pose's value is used."
        )
    if parts == ANGLES:
        refuse_degrees(columns, prefix, parts)
    values = np.tile(np.asarray(reference, float), (columns.n_rows, 1))
    there = [k for k in range(len(parts)) if k not in absent]
    quantities = [f"{prefix}_{parts[k]}" for k in there]
    values[:, there] = columns.all_numbers(quantities, blank_is_nan=blank_is_nan)
    return values


def _quaternions(columns: Columns, prefix: str, *, blank_is_nan: bool) -> Array:
    """Unit quaternions (n, 4); rows of NaN where all four cells are empty."""
    given = columns.present(prefix, QUATERNION)
    missing = [f"{prefix}_{part}" for part in QUATERNION if part not in given]
    if missing:
        raise columns.half_there("quaternion", missing, "all four or none")
    parts = [f"{prefix}_{part}" for part in QUATERNION]
    quat = columns.all_numbers(parts, blank_is_nan=blank_is_nan)
    _check_whole(columns, prefix, np.isnan(quat))
    norm: Array = np.linalg.norm(quat, axis=1)
    _check_norm(columns, prefix, quat, norm)
    unit: Array = quat / norm[:, None]
    return unit


def _check_whole(columns: Columns, prefix: str, blank: NDArray[np.bool_]) -> None:
    text = "incomplete quaternion; expected all four cells filled or all four empty"
    for k, part in enumerate(QUATERNION):
        alone = blank[:, k] & ~np.all(blank, axis=1)
        columns.refuse(alone, f"{prefix}_{part}", lambda row: text)


def _check_norm(columns: Columns, prefix: str, quat: Array, norm: Array) -> None:
    def text(row: int) -> str:
        got = " ".join(f"{value:g}" for value in quat[row])
        return (
            f"expected a unit quaternion, scalar first, got {got} with norm {norm[row]:.6g}; "
            "check the order and the columns"
        )

    columns.refuse(np.abs(norm - 1.0) > NORM_TOLERANCE, f"{prefix}_qw", text)


def measured_orientation(columns: Columns) -> tuple[Array | None, Array]:
    """Quaternions (n, 4) or None, and angles (n, 3) [rad] of incomplete orientations.

    Raises:
        InputFileError: an incomplete quaternion, or radians that must be degrees.
    """
    refuse_degrees(columns, "meas", ANGLES)
    angles = columns.readings("meas", ANGLES)
    if columns.present("meas", QUATERNION):
        quat = _quaternions(columns, "meas", blank_is_nan=True)
        if np.all(np.isnan(quat)):
            columns.notes.append("Columns meas_qw to meas_qz are empty: not measured.")
            return None, angles
        return quat, angles
    blank = np.isnan(angles)
    if np.all(blank) or np.any(blank != blank[:, :1]):
        return None, angles
    # each row has all three angles or none, so they convert to quaternions without loss
    return quat_from_rxyz(angles), np.full_like(angles, np.nan)
