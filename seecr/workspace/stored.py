"""Maps of any size: in parts, each a Parquet file, of which memory never holds more than a few."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seecr.arguments import silent
from seecr.counted import counted
from seecr.description.fingerprint import all_numbers
from seecr.description.mjcf import GivenRobot
from seecr.description.robot import Robot
from seecr.files import path_of
from seecr.parallel import threads
from seecr.parts import key_of, parts_in
from seecr.pose import Array
from seecr.prediction.experiment import effects_of
from seecr.prediction.model import GivenEffects, Model
from seecr.prediction.uncertainty import moving_covariance
from seecr.result import Record, Result
from seecr.statics.solution import Status
from seecr.units import millimetres
from seecr.version import full_version
from seecr.workspace.grid import directions_words, region_words, size_unit, steps_of
from seecr.workspace.maps import MapJob, Progress, map_job

# Most poses of a part: seconds of work, and some ten megabytes.
_POSES = 500_000
MARK = "seecr.map"
"""Key of what is said of a part, in its file."""
FILES = ("map.json", "map.npz", "map.png", "map.svg", "map.rrd")
"""What the command writes beside the folder of parts."""

Box = tuple[slice, slice, slice]
"""A part of a grid: which values of its axes."""


@dataclass(frozen=True, eq=False, repr=False)
class StoredMap(Result):
    """A map that is in files, one for each part of its grid.

    Attributes:
        robot: as described.
        axes: the grid's x, y and z [m], or u, v and w.
        orientation: (4,) quaternion of all poses.
        directions: (3, 3) of the axes, as :attr:`Workspace.directions`.
        files: Parquet, in the order of the grid; a row for each pose, with the columns of
            :meth:`Workspace.to_frame`.
        computed: how many of them were computed now; the others were there.
        parts: what is known of each: ``poses``, ``feasible`` and ``rests`` are numbers of poses,
            ``size_feasible`` is in m^3, m^2 or m, ``slack`` numbers of poses by how many cables are
            slack, ``status`` those by how solves ended. Of poses that can be held, ``beyond`` lie
            outside the data of the model, at most by ``beyond_m``; there, ``deviation_m`` and
            ``rotation_rad`` are the largest and ``stiffness_N_per_m`` is the smallest, or None.
    """

    robot: Robot
    axes: tuple[Array, Array, Array]
    orientation: Array
    directions: Array | None
    files: Sequence[Path]
    computed: int
    parts: Sequence[Record]

    def sum(self, key: str) -> Any:
        """The sum of a number over all parts."""
        return sum(part[key] for part in self.parts)

    def counts(self, key: str) -> dict[str, int]:
        """Numbers of poses by ``slack`` or ``status``, of all parts."""
        out: dict[str, int] = {}
        for part in self.parts:
            for name, count in part[key].items():
                out[name] = out.get(name, 0) + count
        return dict(sorted(out.items()))

    def _end(self, key: str, which: Callable[[list[float]], float] = max) -> float | None:
        known = [part[key] for part in self.parts if part[key] is not None]
        return which(known) if known else None

    def _unrested(self) -> Iterator[tuple[Status, int]]:
        """Why the elastic robot is not at rest, and at how many poses."""
        for name, count in self.counts("status").items():
            if name != Status.CONVERGED.name:
                yield Status[name], count

    @property
    def region(self) -> str:
        """Where the grid is, in words; whether its lowest poses stand on the robot's floor."""
        return region_words(self.robot, self.axes, self.orientation, self.directions)

    def lines(self) -> list[str]:
        """How much can be held, how far off the elastic robot is there, and where the files are."""
        poses, size = counted(self.sum("poses"), "pose"), self.sum("size_feasible")
        way = [] if self.directions is None else [f"grid: {directions_words(self.directions)}"]
        unit = size_unit(self.axes)
        held = f"{self.robot.name}: {self.sum('feasible')} of {poses} can be held"
        out = [*way, f"{held}, {size:.4g}{unit}" if unit else held]
        if any(part["status"] for part in self.parts):  # there are none without an elastic map
            counts = ", ".join(f"{k} at {n}" for k, n in self.counts("slack").items())
            slack = f"; slack cables: {counts}" if counts else ""
            commands = counted(self.sum("poses"), "command")
            out.append(f"elastic robot: at rest at {self.sum('rests')} of {commands}{slack}")
            out += [f"not at rest at {count} ({status.name.lower()}): {status.value}"
                    for status, count in self._unrested()]  # fmt: skip
        away, turn = self._end("deviation_m"), self._end("rotation_rad")
        if away is not None and turn is not None:
            out.append(
                f"deviation from the command where poses can be held: up to "
                f"{millimetres(away)} and {np.degrees(turn):.4g} deg"
            )
        there = len(self.files) - self.computed
        kept = f"{counted(len(self.files), 'part')} in {self.files[0].parent}"
        return [*out, f"{kept}, {there} there already" if there else kept]

    def as_json(self) -> Record:
        """``map.json`` with the keys of :meth:`Workspace.as_json`, and what is known of each part.

        What only a map in memory tells is None.
        """
        alone = not size_unit(self.axes)
        ends = {key: self._end(key) for key in ("deviation_m", "rotation_rad")}
        softest = self._end("stiffness_N_per_m", min)
        return {
            "robot": self.robot.name,
            "shape": [len(axis) for axis in self.axes],
            "directions": self.directions,
            "region_m": [[axis.min(), axis.max()] for axis in self.axes],
            "floor_m": self.robot.floor,
            "orientation": self.orientation,
            "poses": self.sum("poses"),
            "feasible": self.sum("feasible"),
            "cell": None,
            "size_feasible": None if alone else self.sum("size_feasible"),
            "size_feasible_between": None,
            "likely": None,
            "rests": self.sum("rests"),
            "not_at_rest": [
                {"status": status, "poses": count, "sentence": status.value}
                for status, count in self._unrested()
            ],
            "slack": self.counts("slack"),
            "worst_where_feasible": ends,
            "softest_where_feasible": softest and {"smallest_eigenvalue_N_per_m": softest},
            "parts": self.records(),
        }

    def records(self) -> list[Record]:
        """One row per part: its file, and what is known of it."""
        rows = zip(self.files, self.parts, strict=True)
        return [{"file": path.name, **_flat(part)} for path, part in rows]


def _flat(part: Record) -> Record:
    """With a column for each way in which a solve may end."""
    counts = {f"status_{one.name.lower()}": part["status"].get(one.name, 0) for one in Status}
    return {k: value for k, value in part.items() if k not in ("status", "slack")} | counts


def store_map(
    robot: GivenRobot,
    x: ArrayLike,
    y: ArrayLike,
    z: ArrayLike,
    out: str | Path,
    *,
    orientation: ArrayLike | None = None,
    lowest: ArrayLike = 0.0,
    highest: ArrayLike = np.inf,
    wrenches: ArrayLike | None = None,
    effects: GivenEffects = (),
    elastic: bool = True,
    chance: bool = False,
    progress: Progress = silent,
    executor: Executor | None = None,
) -> StoredMap:
    """A workspace as :func:`seecr.workspace_map` computes it, of any number of poses, in files.

    Memory holds a few parts of half a million poses each, whatever the size of the grid. What is
    in the folder already is not computed again, as long as nothing that it depends on has changed.

    Args:
        robot, x, y, z, orientation, lowest, highest, wrenches, effects, elastic, chance, progress:
            as in :func:`seecr.workspace_map`.
        out: folder for the parts.
        executor: computes parts, see there.

    Returns:
        what is known of the parts, and their files.

    Raises:
        InputError: as there, or the folder cannot be written to.
        InputFileError: a part is damaged, or the folder is of something else.
        ExecutorError: the executor ended before its work; the parts that are done stay.

    Example:
        ``seecr.store_map(robot, *seecr.default_axes(robot, 5), "map").files``
    """
    limits = lowest, highest, wrenches
    job = map_job(robot, (x, y, z), orientation, limits, effects, elastic, chance)
    numbers = _numbers_of(job)
    every = {
        key_of([numbers, [axis[cut] for axis, cut in zip(job.axes, box, strict=True)]]): box
        for box in boxes(job.shape, _POSES)
    }
    with parts_in(path_of(out, "a folder"), MARK, FILES) as parts:
        said = {key: part for key in every if (part := parts.read(key)) is not None}
        if said:
            progress(sum(part["poses"] for part in said.values()))
        missing = {key: box for key, box in every.items() if key not in said}
        said |= parts.complete(
            missing, partial(_mapped, job), executor or threads(),
            lambda _key, part: progress(part["poses"]), "part",
        )  # fmt: skip
    files, known = [parts.files[key] for key in every], [said[key] for key in every]
    return StoredMap(
        job.robot, job.axes, np.asarray(job.turned), job.directions, files, len(missing), known
    )  # fmt: skip


def boxes(shape: tuple[int, int, int], most: int) -> list[Box]:
    """A grid in boxes of at most so many poses, in its order."""
    steps: list[int] = []
    for n in reversed(shape):
        steps.insert(0, max(1, min(n, most)))
        most //= steps[0]
    cuts = [[slice(k, min(k + step, n)) for k in range(0, n, step)]
            for n, step in zip(shape, steps, strict=True)]  # fmt: skip
    return list(product(*cuts))


def _mapped(job: MapJob, box: Box) -> tuple[Any, Record]:
    """The rows of one box of a grid, as a table of pyarrow, and what is known of it."""
    from pyarrow import table  # takes a while to import

    cuts = list(zip(job.axes, box, strict=True))
    x, y, z = (axis[cut] for axis, cut in cuts)
    own = replace(job, axes=(x, y, z))
    found = own.workspace(own.blank() | own.part(slice(0, own.poses)))
    held, slack = found.feasible, found.slack[found.rests]
    where = held & found.rests
    reach = getattr(job.effects, "reach", None)  # of a model
    beyond, beyond_m = (0, 0.0) if reach is None else found.beyond(reach)
    away, turn = (np.linalg.norm(one[where], axis=-1) for one in (found.deviation, found.rotation))
    return table(found.columns()), {
        "first_m": [float(axis[0]) for axis in found.axes],
        "poses": held.size,
        "feasible": int(held.sum()),
        "size_feasible": float(
            np.einsum("i,j,k,ijk->", *(steps_of(axis)[cut] for axis, cut in cuts), held)
        ),
        "rests": slack.size,
        "slack": {f"{k}": int(n) for k, n in enumerate(np.bincount(slack)) if n},
        "status": {one.name: count for one, count in found.status_counts.items()},
        "beyond": beyond,
        "beyond_m": beyond_m,
        "deviation_m": _most(away),
        "rotation_rad": _most(turn),
        "stiffness_N_per_m": None if not where.any() else float(found.stiffness[where].min()),
    }


def _most(values: NDArray[Any]) -> float | None:
    return float(values.max()) if len(values) else None


def _numbers_of(job: MapJob) -> list[Any]:
    """All that the results depend on, but the places."""
    known = moving_covariance(job.effects) if isinstance(job.effects, Model) else None
    reach = getattr(job.effects, "reach", None)
    acting = [[type(one).__qualname__, vars(one)] for one in effects_of(job.effects, job.robot)]
    return [
        full_version(), all_numbers(job.robot), job.turned, job.directions, acting, job.limits,
        job.elastic, job.chance, known[1] if job.chance and known is not None else None,
        vars(reach) if reach else None,
    ]  # fmt: skip
