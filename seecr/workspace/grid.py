"""A workspace on a grid of poses, as arrays: extent, margins, slices, edges of cells."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seecr.counted import between, counted
from seecr.description.joints import locked, off_joints, shifts
from seecr.description.robot import Robot
from seecr.errors import InputError
from seecr.pose import Array, cross
from seecr.prediction.model import DataReach
from seecr.result import MOTION, Record, Result, rows_of
from seecr.statics.solution import Status
from seecr.units import millimetres
from seecr.workspace.margins import is_held

# How far a grid extends: over the exit points, as far below home as above, within the joints.
#
# Its axes are x, y and z. Where joints keep the platform in a plane or on a line that is oblique
# to these, they are directions of the platform's own, u, v and w, from the base frame's origin,
# too.

# Components of a unit vector below this are rounding.
_ROUNDING = 1e-12


def own_directions(robot: Robot) -> Array | None:
    """(3, 3) unit vectors u, v and w in rows, along which an oblique robot's grid extends.

    In a plane u is level, w is the steepest direction and v is normal to both, as x, z and y are in
    the plane of x and z. A line is along w if it climbs, else along u. Signs are such that u goes
    along +x, w along +z, and u, v, w are right-handed. None where x, y and z serve.
    """
    along, up = shifts(robot), np.array([0.0, 0.0, 1.0])
    if len(along) in (0, 3) or int(locked(robot)[:3].sum()) >= 3 - len(along):
        return None
    if len(along) == 2:
        normal = cross(along[0], along[1])
        level = cross(normal, up)
        steep = cross(level, normal)
    elif abs(along[0, 2]) > _ROUNDING:
        level, steep = cross(along[0], up), along[0]
    else:
        level, steep = along[0], up
    if np.linalg.norm(level) <= _ROUNDING:
        return None
    u, w = _unit(level), _unit(steep)
    u, w = u if u[np.argmax(u != 0.0)] > 0.0 else -u, w if w[2] > 0.0 else -w
    return np.asarray(np.stack([u, cross(w, u), w]) + 0.0)


def _unit(vector: Array) -> Array:
    """The unit vector, without rounding where it is zero."""
    unit = vector / np.linalg.norm(vector)
    unit = np.where(np.abs(unit) < _ROUNDING, 0.0, unit)
    return np.asarray(unit / np.linalg.norm(unit))


def _kept(robot: Robot, directions: Array | None) -> NDArray[np.bool_]:
    """(3,) along which axes of the grid joints keep the platform in place."""
    if directions is None:
        return locked(robot)[:3]
    return np.asarray(np.abs(shifts(robot) @ directions.T).max(axis=0) <= _ROUNDING)


def _home(robot: Robot, directions: Array | None) -> Array:
    """The reference position along the axes of the grid, (3,) [m]."""
    if directions is None:
        return robot.reference_pose[:3]
    home = directions @ robot.reference_pose[:3]
    return np.where(np.abs(home) <= _ROUNDING * robot.reach, 0.0, home)


def grid_ends(robot: Robot, turned: Array) -> tuple[Array, Array]:
    """Lowest and highest x, y, z (3,) [m] of a grid over the exit points, or of its own u, v, w,
    for poses that are ``turned`` (4,).

    It has room for exit points mirrored in the level plane through the reference position, that is,
    against gravity. It ends on the robot's floor, and does not leave the plane or line in which
    joints keep the platform.
    """
    home, directions = robot.reference_pose[:3], own_directions(robot)
    above = robot.exit_points[(robot.exit_points - home) @ robot.up > 0.0]
    # no rounding where gravity is along an axis
    twice = 2.0 * np.outer(robot.up, robot.up)
    mirrored = above @ (np.eye(3) - twice) + twice @ home
    points = np.concatenate([robot.exit_points, home[None], mirrored])
    floor = robot.standing_height(turned)
    if directions is not None:
        points, home = points @ directions.T, _home(robot, directions)
        # u is level, and v stays
        floor = (floor - home[1] * directions[1, 2]) / directions[2, 2]
    low, high = points.min(axis=0), points.max(axis=0)
    low[2] = np.clip(floor, low[2], home[2])
    kept = _kept(robot, directions)
    return np.where(kept, home, low), np.where(kept, home, high)


def refuse_other_joints(robot: Robot, axes: tuple[Array, ...]) -> None:
    """Refuse a default grid that joints cannot reach.

    Raises:
        InputError: the joints do not let the platform move without turning.
    """
    off = off_joints(robot, _corners(axes, robot.reference_pose[3:], own_directions(robot)))
    if off is not None:
        raise InputError(
            f"robot {robot.name}: its joints do not reach a grid of one orientation, it is off by "
            f"{off[1]}; expected joints that move the platform along a line, in a plane or in "
            "space without turning it, or poses of your own in place of a map (a sweep)"
        )


def refuse_unreached(
    robot: Robot, axes: tuple[Array, ...], turned: Array, directions: Array | None
) -> None:
    """Refuse a grid with a corner that joints cannot reach.

    Args:
        robot: as described.
        axes: of the grid [m]. turned: (4,) quaternion of its poses. directions: (3, 3) of its axes,
            see :func:`own_directions`.

    Raises:
        InputError: says which corner, and how far off it is.
    """
    poses = _corners(axes, turned, directions)
    off = off_joints(robot, poses)
    if off is not None:
        names, place = "xyz", poses[off[0], :3]
        if directions is not None:
            names, place = "uvw", directions @ place
        home, at = _home(robot, directions), " ".join(f"{value + 0.0:.6g}" for value in place)
        kept = np.flatnonzero(_kept(robot, directions))
        only = ", ".join(f"{names[k]} {home[k]:.6g} m" for k in kept)
        raise InputError(
            f"robot {robot.name}: its joints cannot reach {' '.join(names)} {at} m of the grid, "
            f"it is off by {off[1]}; expected a grid and an orientation that they can reach"
            + (f", here with {only}" if only else "")
            + ("" if directions is None else f" ({directions_words(directions)})")
        )


def directions_words(directions: Array) -> str:
    """Which way the axes of an oblique robot's grid go, in words."""
    each = (
        f"{name} along ({', '.join(f'{part + 0.0:.4g}' for part in row)})"
        for name, row in zip("uvw", directions, strict=True)
    )
    return f"{', '.join(each)} of x y z"


def _corners(axes: tuple[Array, ...], turned: Array, directions: Array | None) -> Array:
    """(8, 7) the poses at the corners of a grid."""
    places = np.array(list(product(*((axis[0], axis[-1]) for axis in axes))))
    places = places if directions is None else places @ directions
    return np.column_stack([places, np.tile(turned, (len(places), 1))])


# Marks the number of slack cables at a pose where the elastic robot does not come to rest.
NEVER = -1
STATUSES = tuple(Status)
"""What the codes of a map's statuses count: 0 is the first."""


def codes_of(status: NDArray[np.object_]) -> NDArray[np.int8]:
    """The code of each of some statuses (n,) of a solution, an index of :data:`STATUSES`."""
    out = np.zeros(len(status), np.int8)
    for one in set(status[status != STATUSES[0]]):
        out[status == one] = STATUSES.index(one)
    return out


def steps_of(axis: Array) -> Array:
    """How much of an axis belongs to each of its values [m]; 1 if it has a single one."""
    step = np.abs(np.diff(axis))
    return 0.5 * (np.r_[step, 0.0] + np.r_[0.0, step]) if len(step) else np.ones(1)


def size_unit(axes: Sequence[Array]) -> str:
    """The unit of a part of a grid, after a blank; "" of a single pose's grid."""
    return ("", " m", " m^2", " m^3")[sum(len(axis) > 1 for axis in axes)]


def region_words(
    robot: Robot, axes: Sequence[Array], orientation: Array, directions: Array | None
) -> str:
    """Where a grid is, in words; whether its lowest poses stand on the robot's floor."""
    ends = [(float(axis.min()), float(axis.max())) for axis in axes]
    names = "xyz" if directions is None else "uvw"
    parts = [f"{k} {between(*end)} m" for k, end in zip(names, ends, strict=True)]
    lowest = np.array([low for low, _ in ends])
    z = lowest[2] if directions is None else lowest @ directions[:, 2]
    stands = abs(float(z) - robot.standing_height(orientation)) <= 1e-9 * robot.length
    return f"region: {', '.join(parts)}{', down to the floor' if stands else ''}"


@dataclass(frozen=True, eq=False, repr=False)
class Workspace(Result):
    """The workspace on a grid of positions with one orientation; arrays are (nx, ny, nz).

    Joints may keep the platform in a plane that is oblique to x, y and z, or on such a line. Its
    grid has axes of its own, u, v and w; all else is by x, y and z, as always.

    Attributes:
        robot: as described.
        axes: the grid's x, y and z [m], or u, v and w.
        orientation: (4,) quaternion of all poses.
        margin: [N] how far inside their limits all tensions can stay; negative if the pose cannot
            be held. For robots with fewer cables than degrees of freedom it is that of the best
            orientation found in which the platform stays, and minus infinity if none was found.
        deviation: (..., 3) [m] from the command to the elastic robot's equilibrium; NaN where
            it does not come to rest or is free to move; float32.
        rotation: (..., 3) [rad] likewise.
        slack: number of slack cables; -1 where it does not come to rest or is free to move.
        stiffness: [N/m] smallest eigenvalue, with rotations times the robot's length.
        softest: (..., 6) [m, rad] its direction, :attr:`Solution.softest_direction`; float32.
        chance: the probability that the pose can be held, given the uncertainty of the model;
            float32; None if it was not asked for.
        elastic: whether the equilibria of the elastic robot were computed.
        status: how each of these solves ended, as codes: an index of ``tuple(seecr.Status)``; int8;
            None without an elastic map.
        directions: (3, 3) unit vectors u, v and w, in rows, along which the axes count from the
            base frame's origin; None if they are x, y and z. In a plane u is level, w is the
            steepest direction and v is normal to both; a line is along w if it climbs, else u.
    """

    robot: Robot
    axes: tuple[Array, Array, Array]
    orientation: Array
    margin: Array
    deviation: NDArray[np.float32]
    rotation: NDArray[np.float32]
    slack: NDArray[np.int8]
    stiffness: NDArray[np.float32]
    softest: NDArray[np.float32]
    chance: NDArray[np.float32] | None = None
    elastic: bool = True
    status: NDArray[np.int8] | None = None
    directions: Array | None = None

    @property
    def axis_names(self) -> str:
        """``xyz``, or ``uvw`` of a grid with directions of its own."""
        return "xyz" if self.directions is None else "uvw"

    @property
    def places(self) -> Array:
        """(nx, ny, nz, 3) positions x, y and z [m] of the grid's poses."""
        return self._in_base(np.stack(np.meshgrid(*self.axes, indexing="ij"), axis=-1))

    def _in_base(self, own: Array) -> Array:
        """Values (..., 3) along the grid's axes as positions x, y and z [m]."""
        return own if self.directions is None else np.asarray(own @ self.directions)

    def along_axes(self, places: Array) -> Array:
        """(k, 3) positions x, y and z [m] as values along the grid's axes."""
        return places if self.directions is None else np.asarray(places @ self.directions.T)

    def likely(self, at_least: float) -> NDArray[np.bool_]:
        """The poses that can be held with at least a given probability.

        Raises:
            InputError: the map has no probabilities, or the number is not a probability.
        """
        if not 0.0 < at_least <= 1.0:
            raise InputError(f"a probability must be above 0 and at most 1, got {at_least:g}")
        if self.chance is None:
            raise InputError("this map has no probabilities; expected one made with chance=True")
        return np.asarray(self.chance >= at_least)

    @property
    def feasible(self) -> NDArray[np.bool_]:
        """The poses that tensions within the limits can hold."""
        return is_held(self.robot, self.margin)

    def crossings(self, poses: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Neighbours along the grid of which one is among some poses and the other is not.

        Args:
            poses: (nx, ny, nz) bool, such as ``feasible`` or ``likely(0.95)``.

        Returns:
            (k, 7) those that are, and (k, 7) those that are not: the arguments of :func:`boundary`.
        """
        number, inside = np.arange(poses.size).reshape(poses.shape), poses.ravel()
        pairs = np.concatenate([
            np.stack([np.delete(number, -1, k).ravel(), np.delete(number, 0, k).ravel()], axis=1)
            for k in range(3)
        ])  # fmt: skip
        pairs = pairs[inside[pairs[:, 0]] != inside[pairs[:, 1]]]
        pairs = np.where(inside[pairs[:, :1]], pairs, pairs[:, ::-1])
        index = np.unravel_index(pairs, poses.shape)
        own = np.stack([axis[k] for axis, k in zip(self.axes, index, strict=True)], axis=-1)
        turned = np.broadcast_to(self.orientation, (*pairs.shape, 4))
        both = np.concatenate([self._in_base(own), turned], axis=-1)
        return both[:, 0], both[:, 1]

    @property
    def rests(self) -> NDArray[np.bool_]:
        """The poses at which the elastic robot comes to rest, if that was computed."""
        return np.asarray(self.slack != NEVER)

    @property
    def free(self) -> NDArray[np.bool_]:
        """The poses at which forces balance, but the elastic robot is free to move."""
        if self.status is None:
            return np.zeros(self.margin.shape, dtype=bool)
        return np.asarray(self.status == STATUSES.index(Status.SINGULAR))

    @property
    def status_counts(self) -> dict[Status, int]:
        """At how many poses solves ended in each way; empty without an elastic map."""
        if self.status is None:
            return {}
        counts = np.bincount(self.status.ravel(), minlength=len(STATUSES))
        return {status: int(n) for status, n in zip(STATUSES, counts, strict=True) if n}

    def _unrested(self) -> Iterator[tuple[Status, int, tuple[int, ...]]]:
        """Why the elastic robot is not at rest: each reason, at how many poses, and the first."""
        for status, poses in self.status_counts.items():
            if status is not Status.CONVERGED:
                own = self.status == STATUSES.index(status)
                first = np.unravel_index(int(np.argmax(own)), self.margin.shape)
                yield status, poses, tuple(map(int, first))

    def place(self, at: tuple[int, ...]) -> str:
        """Where a pose of the grid is, in words; its index is given."""
        # of robots of many metres, too, without an exponent
        at_mm = [round(1e3 * float(value), 1) for value in self._at(at)]
        return f"x y z {' '.join(f'{value + 0.0:.7g}' for value in at_mm)} mm"

    def _at(self, index: tuple[int, ...]) -> list[float]:
        """x, y and z [m] of a pose of the grid."""
        own = [axis[k] for axis, k in zip(self.axes, index, strict=True)]
        place: list[float] = self._in_base(np.array(own)).tolist()
        return place

    @property
    def cell(self) -> float:
        """Size of a cell of the grid: [m^3], or [m^2] or [m] if some axes have a single value."""
        steps = [np.ptp(axis) / (len(axis) - 1) for axis in self.axes if len(axis) > 1]
        return float(np.prod(steps))

    @property
    def shares(self) -> Array:
        """(nx, ny, nz) size of each pose's part of the grid's box, [m^3], [m^2] or [m].

        It is half a cell at the ends of an axis, so that all of them add up to the box between the
        ends.
        """
        return np.asarray(np.einsum("i,j,k->ijk", *map(steps_of, self.axes)))

    def size(self, poses: NDArray[np.bool_]) -> float:
        """Size of the part of the grid's box that belongs to some poses (nx, ny, nz)."""
        return float(self.shares[poses].sum())

    def size_between(self, poses: NDArray[np.bool_]) -> tuple[float, float]:
        """Between which sizes the part that belongs to some poses (nx, ny, nz) lies.

        Cells between neighbouring poses count if all their corners are among the poses, or if any
        is. Nothing is known of what is smaller than a cell.
        """
        every, some, sides = poses, poses, []
        for k, axis in enumerate(self.axes):
            if len(axis) > 1:
                first, last = ([slice(None)] * 3 for _ in range(2))
                first[k], last[k] = slice(None, -1), slice(1, None)
                every = every[tuple(first)] & every[tuple(last)]
                some = some[tuple(first)] | some[tuple(last)]
            sides.append(np.abs(np.diff(axis)) if len(axis) > 1 else np.ones(1))
        cells = np.einsum("i,j,k->ijk", *sides)
        return float(cells[every].sum()), float(cells[some].sum())

    def beyond(self, reach: DataReach) -> tuple[int, float]:
        """How many poses that can be held lie outside a model's data, and how far at most [m]."""
        away = reach.outside(self.places[self.feasible], self.robot.length)
        return int(np.sum(away > 0.0)), float(away.max(initial=0.0))

    @property
    def softest_at(self) -> tuple[int, ...] | None:
        """Index of the pose with the smallest stiffness among those that can be held."""
        stiffness = np.where(self.feasible & self.rests, self.stiffness, np.nan)
        if not np.isfinite(stiffness).any():
            return None
        return tuple(map(int, np.unravel_index(np.nanargmin(stiffness), stiffness.shape)))

    def size_words(self, poses: NDArray[np.bool_]) -> str:
        """The size of some poses (nx, ny, nz) of the grid, as text; "" of a single pose's grid.

        What the grid leaves open is told, if it is more than the size's last digit.
        """
        unit = size_unit(self.axes)
        if not unit:
            return ""
        size, (low, high) = f"{self.size(poses):.4g}", self.size_between(poses)
        if size == f"{low:.4g}" == f"{high:.4g}":
            return f"{size}{unit}"
        return f"{size}{unit} ({low:.3g} to {high:.3g} at this spacing)"

    def lines(self) -> list[str]:
        """How much of the grid can be held, and how far off the elastic robot is there."""
        n, held = self.margin.size, int(self.feasible.sum())
        way = [] if self.directions is None else [f"grid: {directions_words(self.directions)}"]
        size = self.size_words(self.feasible)
        of = f"{self.robot.name}: {held} of {counted(n, 'pose')} can be held"
        out = [*way, f"{of}, {size}" if size else of]
        half = float(np.median(self.margin[self.feasible])) if held else 0.0
        if half == np.inf:
            out.append("at half of them or more, all cables can be tightened without limit")
        elif half > 0.0:
            out.append(f"median tension margin there: {half:.3g} N inside the limits")
        rests = self.rests
        if self.elastic:
            counts = self.slack[rests]
            parts = [f"{k} at {int(np.sum(counts == k))}" for k in np.unique(counts)]
            slack = f"; slack cables: {', '.join(parts)}" if parts else ""
            out.append(
                f"elastic robot: at rest at {int(rests.sum())} of {counted(n, 'command')}{slack}"
            )
            out += [
                f"not at rest at {poses} ({status.name.lower()}), "
                f"{'' if poses == 1 else 'the first '}at {self.place(first)}: {status.value}"
                for status, poses, first in self._unrested()
            ]
            where = rests & self.feasible
            if np.any(where):
                away = np.linalg.norm(self.deviation[where], axis=-1).max()
                turn = np.degrees(np.linalg.norm(self.rotation[where], axis=-1).max())
                out.append(
                    f"deviation from the command where poses can be held: up to "
                    f"{millimetres(away)} and {turn:.4g} deg"
                )
        return out

    @property
    def region(self) -> str:
        """Where the grid is, in words; whether its lowest poses stand on the robot's floor."""
        return region_words(self.robot, self.axes, self.orientation, self.directions)

    def records(self) -> list[Record]:
        """One row per pose of the grid."""
        return rows_of(self.columns())

    def columns(self) -> dict[str, Any]:
        """The columns of the rows, an array each."""
        places, names = self.places.reshape(-1, 3), None
        if self.status is not None:
            names = np.array([one.name for one in STATUSES], object)[self.status.ravel()]
        return {
            **_columns("{}_m", "xyz", places),
            "margin_N": self.margin.ravel(),
            "feasible": self.feasible.ravel(),
            **({} if self.chance is None else {"probability": self.chance.ravel()}),
            "slack": self.slack.ravel(),
            **({} if names is None else {"status": names}),
            **_columns("d{}_m", "xyz", self.deviation),
            **_columns("r{}_rad", "xyz", self.rotation),
            "smallest_eigenvalue_N_per_m": self.stiffness.ravel(),
            **_columns("softest_{}", MOTION, self.softest),
        }

    def as_json(self, at_least: float | None = None) -> Record:
        """``map.json``: how much can be held, and the elastic robot's largest errors there.

        Args:
            at_least: also report the poses held with at least this probability.

        Returns:
            the document; sizes in m^3, m^2 or m as those of a cell, None for a single pose.
        """
        alone, likely = self.margin.size == 1, None
        if at_least is not None:
            some = self.likely(at_least)
            likely = {
                "at_least": at_least, "poses": int(some.sum()),
                "size": None if alone else self.size(some),
                "size_between": None if alone else self.size_between(some),
            }  # fmt: skip
        where = self.rests & self.feasible
        worst = {
            "deviation_m": np.linalg.norm(self.deviation[where], axis=-1),
            "rotation_rad": np.linalg.norm(self.rotation[where], axis=-1),
        }
        counts, at = self.slack[self.rests], self.softest_at
        return {
            "robot": self.robot.name,
            "shape": self.margin.shape,
            "directions": self.directions,
            "region_m": [[axis.min(), axis.max()] for axis in self.axes],
            "floor_m": self.robot.floor,
            "orientation": self.orientation,
            "poses": self.margin.size,
            "feasible": int(self.feasible.sum()),
            "cell": None if alone else self.cell,
            "size_feasible": None if alone else self.size(self.feasible),
            "size_feasible_between": None if alone else self.size_between(self.feasible),
            "likely": likely,
            "rests": int(self.rests.sum()),
            "not_at_rest": [
                {
                    "status": status,
                    "poses": poses,
                    "first_m": self._at(first),
                    "sentence": status.value,
                }
                for status, poses, first in self._unrested()
            ],
            "slack": {k: int(np.sum(counts == k)) for k in np.unique(counts)},
            "worst_where_feasible": {
                name: float(values.max()) if len(values) else None for name, values in worst.items()
            },
            "softest_where_feasible": at
            and {
                "pose_m": self._at(at),
                "smallest_eigenvalue_N_per_m": self.stiffness[at],
                "direction": self.softest[at],
            },
        }


def _columns(pattern: str, names: Sequence[str], values: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Values (..., k) as columns, with keys from the pattern and each name."""
    return {pattern.format(name): values[..., k].ravel() for k, name in enumerate(names)}


# How a map is cut into slices and where its colours end: the same in pictures and recordings.

# Smaller motions [mm, deg] count as zero: colours up to there would show rounding.
_STILL = 1e-6


def across_of(found: Workspace) -> int:
    """The axis that slices are normal to: the last one, or the one with a single value."""
    lengths = [len(axis) for axis in found.axes]
    return 2 if min(lengths) > 1 else int(np.argmin(lengths))


def evenly_picked(count: int, most: int) -> NDArray[np.intp]:
    """At most so many of the numbers from 0 to count - 1, evenly spread, with both ends."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))


def colour_end(found: Workspace, values: Array) -> float:
    """Upper end of the colours of a deviation (nx, ny, nz), from poses that can be held.

    Poses outside the workspace fall a hundred times as far, and would make all others one colour.
    """
    for some in (values[found.feasible], values):
        known = some[np.isfinite(some)]
        if len(known) and (top := float(np.quantile(known, 0.95))) > _STILL:
            return top
    return 1.0
