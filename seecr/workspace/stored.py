"""Maps of any size: in parts, each a Parquet file, of which memory never holds more than a few."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import closing
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
from seecr.parallel import as_done, threads
from seecr.parts import key_of, parts_in
from seecr.pose import Array
from seecr.prediction.experiment import effects_of
from seecr.prediction.model import GivenEffects, Model
from seecr.prediction.uncertainty import moving_covariance
from seecr.result import Record, Result
from seecr.statics.solution import Status
from seecr.units import millimetres
from seecr.version import full_version
from seecr.workspace.grid import Workspace, steps_of
from seecr.workspace.maps import MapJob, Progress, map_job

# Most poses of a part: seconds of work, and some ten megabytes.
_POSES = 500_000
_MARK = "seecr.map"

Box = tuple[slice, slice, slice]
"""A part of a grid: which values of its axes."""


@dataclass(frozen=True, eq=False, repr=False)
class StoredMap(Result):
    """A map that is in files, one for each part of its grid.

    Attributes:
        robot: as described.
        axes: the grid's x, y and z [m], or u, v and w.
        files: Parquet, in the order of the grid; a row for each pose, with the columns of
            :meth:`Workspace.to_frame`.
        computed: how many of them were computed now; the others were there.
        parts: what is known of each: ``poses``, ``feasible`` and ``rests`` are numbers of poses,
            ``size_feasible`` is in m^3, m^2 or m, ``status`` numbers of poses by how solves ended,
            ``deviation_m`` and ``rotation_rad`` the largest where poses can be held, and
            ``stiffness_N_per_m`` the smallest there; None without any.
    """

    robot: Robot
    axes: tuple[Array, Array, Array]
    files: Sequence[Path]
    computed: int
    parts: Sequence[Record]

    def sum(self, key: str) -> Any:
        """The sum of a number over all parts."""
        return sum(part[key] for part in self.parts)

    def _known(self, key: str) -> list[float]:
        return [part[key] for part in self.parts if part[key] is not None]

    def lines(self) -> list[str]:
        """How much can be held, how far off the elastic robot is there, and where the files are."""
        poses, status = counted(self.sum("poses"), "pose"), dict[str, int]()
        out = [f"{self.robot.name}: {self.sum('feasible')} of {poses} can be held"]
        for part in self.parts:
            for name, count in part["status"].items():
                status[name] = status.get(name, 0) + count
        if status:
            out.append(f"elastic robot: at rest at {status.pop(Status.CONVERGED.name, 0)}")
            out += [f"not at rest at {count} ({name.lower()}): {Status[name].value}"
                    for name, count in sorted(status.items())]  # fmt: skip
        away, turn = self._known("deviation_m"), self._known("rotation_rad")
        if away:
            out.append(
                f"deviation from the command where poses can be held: up to "
                f"{millimetres(max(away))} and {np.degrees(max(turn)):.4g} deg"
            )
        there = len(self.files) - self.computed
        kept = f"{counted(len(self.files), 'part')} in {self.files[0].parent}"
        return [*out, f"{kept}, {there} there already" if there else kept]

    def records(self) -> list[Record]:
        """One row per part: its file, and what is known of it."""
        rows = zip(self.files, self.parts, strict=True)
        return [{"file": path.name, **_flat(part)} for path, part in rows]


def _flat(part: Record) -> Record:
    """With a column for each way in which a solve may end."""
    counts = {f"status_{one.name.lower()}": part["status"].get(one.name, 0) for one in Status}
    return {name: value for name, value in part.items() if name != "status"} | counts


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
    from pyarrow import table  # takes a while to import

    limits = lowest, highest, wrenches
    job = map_job(robot, (x, y, z), orientation, limits, effects, elastic, chance)
    every, numbers = boxes(job.shape, _POSES), _numbers_of(job)
    keys = [key_of([numbers, [axis[cut] for axis, cut in zip(job.axes, box, strict=True)]])
            for box in every]  # fmt: skip
    with parts_in(path_of(out, "a folder"), _MARK) as parts:
        said = {key: part for key in keys if (part := parts.read(key)) is not None}
        if said:
            progress(sum(part["poses"] for part in said.values()))
        missing = [key for key in keys if key not in said]
        todo = [box for key, box in zip(keys, every, strict=True) if key not in said]
        with closing(as_done(partial(_mapped, job), todo, executor or threads())) as results:
            for i, found in results:
                widths = [steps_of(axis)[cut] for axis, cut in zip(job.axes, todo[i], strict=True)]
                said[missing[i]] = _said_of(found, widths)
                parts.keep(missing[i], table(found.columns()), said[missing[i]])
                progress(found.margin.size)
        there = parts.files()
    files, known = [there[key] for key in keys], [said[key] for key in keys]
    return StoredMap(job.robot, job.axes, files, len(missing), known)


def boxes(shape: tuple[int, int, int], most: int) -> list[Box]:
    """A grid in boxes of at most so many poses, in its order."""
    steps: list[int] = []
    for n in reversed(shape):
        steps.insert(0, max(1, min(n, most)))
        most //= steps[0]
    cuts = [[slice(k, min(k + step, n)) for k in range(0, n, step)]
            for n, step in zip(shape, steps, strict=True)]  # fmt: skip
    return list(product(*cuts))


def _mapped(job: MapJob, box: Box) -> Workspace:
    """The workspace in one box of a grid."""
    x, y, z = (axis[cut] for axis, cut in zip(job.axes, box, strict=True))
    own = replace(job, axes=(x, y, z))
    return own.workspace(own.blank() | own.part(slice(0, own.poses)))


def _said_of(found: Workspace, widths: list[Array]) -> Record:
    """What is known of a part, of which each pose is so wide along each axis [m]."""
    held = found.feasible
    where = held & found.rests
    away, turn = (np.linalg.norm(one[where], axis=-1) for one in (found.deviation, found.rotation))
    return {
        "first_m": [axis[0] for axis in found.axes],
        "poses": held.size,
        "feasible": int(held.sum()),
        "size_feasible": float(np.einsum("i,j,k,ijk->", *widths, held)),
        "rests": int(found.rests.sum()),
        "status": {one.name: count for one, count in found.status_counts.items()},
        "deviation_m": _most(away),
        "rotation_rad": _most(turn),
        "stiffness_N_per_m": None if not where.any() else float(found.stiffness[where].min()),
    }


def _most(values: NDArray[Any]) -> float | None:
    return float(values.max()) if len(values) else None


def _numbers_of(job: MapJob) -> list[Any]:
    """All that the results depend on, but the places."""
    known = moving_covariance(job.effects) if isinstance(job.effects, Model) else None
    acting = [[type(one).__qualname__, vars(one)] for one in effects_of(job.effects, job.robot)]
    return [
        full_version(), all_numbers(job.robot), job.turned, job.directions, acting, job.limits,
        job.elastic, job.chance, known[1] if job.chance and known is not None else None,
    ]  # fmt: skip
