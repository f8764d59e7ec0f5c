"""Corrected commands for wanted poses, and what is said of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from seecr.commands import Commands
from seecr.compiled.columns import STRAIN
from seecr.counted import between, counted, rows_words
from seecr.description.cables import NONE_BREAKS, breaking_words
from seecr.description.robot import Robot
from seecr.inverse.lengths import REACHED
from seecr.pose import Array, changes_between
from seecr.result import COORDINATES, MOTION, Record, Result, named, rows_of
from seecr.statics.solution import Solution
from seecr.units import millimetres, newtons, without_rounding

# Rotations below this [deg] are rounding, and displacements of nearest poses below this [m].
_TURNED, _MOVED = 1e-9, 1e-9
# Number of poses whose reason is printed.
_NAMED = 5


@dataclass(frozen=True, eq=False, repr=False)
class Correction(Result):
    """Lengths to command for n wanted poses.

    Attributes:
        wanted: (n, 7).
        aimed: (n, 7) the wanted poses if they can be held, else the nearest that can.
        lengths: (n, m) [m] to command, as told lengths: at the reference pose they are the rest
            lengths of the description, and for passive lines everywhere.
        held: (n,) bool, tensions within the limits can hold the wanted pose.
        found: (n,) bool, there are lengths for the wanted pose or for the nearest that can be held.
        settled: (n,) bool, ``aimed`` is the wanted pose itself, or meets the first-order conditions
            of a local minimum (Karush, Kuhn and Tucker) and the platform stays there. Of the local
            minima of many searches the nearest is taken.
        why_not: (n,) sentences, why a wanted pose cannot be held; "" if it can.
        solution: the certified equilibrium with these lengths.
        commands: the lengths as commands that every function accepts, with the runs, times,
            temperatures and loads that they are for.
        strain_limit: strain of each cable up to which the nearest poses were sought, because no
            highest tension was given; None if all cables had one.
    """

    robot: Robot
    wanted: Array
    aimed: Array
    lengths: Array
    held: NDArray[np.bool_]
    found: NDArray[np.bool_]
    settled: NDArray[np.bool_]
    solution: Solution
    commands: Commands
    why_not: tuple[str, ...]
    strain_limit: float | None = None

    def in_any_orientation(self) -> Correction:
        """The same if positions alone are wanted, which other orientations may hold as well."""
        off = np.linalg.norm(self.aimed[:, :3] - self.wanted[:, :3], axis=1)
        kept = self.found & (off <= _MOVED)
        said = zip(kept, self.why_not, strict=True)
        return replace(
            self,
            wanted=np.where(kept[:, None], self.aimed, self.wanted),
            held=self.held | kept,
            why_not=tuple("" if one else why for one, why in said),
        )

    @property
    def left(self) -> Array:
        """(n, 6) [m, rad] from the wanted pose to the platform's equilibrium."""
        return changes_between(self.solution.pose, self.wanted)

    @property
    def stays(self) -> NDArray[np.bool_]:
        """(n,) bool, the platform is at rest within a micrometre of ``aimed``, and stable."""
        return self.found & rests_at(self.aimed, self.solution)

    @property
    def reached(self) -> NDArray[np.bool_]:
        """(n,) bool, the platform is at rest within a micrometre of the wanted pose, and stable."""
        return self.held & self.stays

    def lines(self) -> list[str]:
        """How many poses are reached, the remaining errors, and which poses cannot be held."""
        n, left = len(self.wanted), self.left
        at, lost = self.reached, ~self.held
        out = [f"{self.robot.name}: {int(at.sum())} of {counted(n, 'pose')} reached"]
        if np.any(at):
            out.append(
                f"remaining error: at most {millimetres(_largest(left[at, :3]), 2)} and "
                f"{without_rounding(_degrees(left[at, 3:])):.2g} deg"
            )
            out.append(self._tensions(at))
        near, leaves = lost & self.found, self.found & ~self.stays
        if np.any(lost):
            out.append(f"{int(lost.sum())} cannot be held with tensions within the limits:")
            out += self._reasons()
        if np.any(near):
            out.append(
                f"the nearest poses that can be held are up to "
                f"{millimetres(_largest(left[near, :3]))} and "
                f"{_degrees(left[near, 3:]):.4g} deg away"
            )
            out.append(self._tensions(near))
        out += self._strain_lines(lost)
        for rows, text in (
            (lost & ~self.found, "of them: no pose nearby was found that can be held"),
            (self.held & ~self.found, "can be held, but a cable would have no length to pay out"),
            (near & ~self.settled, "of them: a nearer pose that can be held may exist"),
            (leaves, "where forces balance but the platform does not come to rest"),
        ):
            if np.any(rows):
                places = rows_words(np.flatnonzero(rows).tolist(), self.commands.line)
                out.append(f"{int(rows.sum())} {text}: {places}")
        if self.robot.weight == 0.0 and self.solution.slack[leaves].any():
            out[-1] += (
                ": without gravity, slack cables leave it free; give a lowest tension above 0"
            )
        return out

    def _tensions(self, rows: NDArray[np.bool_]) -> str:
        """The least and the largest tension of some poses."""
        pulls = self.solution.tensions[rows][:, self.robot.driven]
        return f"tensions there {between(pulls.min(), pulls.max(), lead='from ')} N"

    def place(self, row: int) -> str:
        """The name of a row: "line 24" of its file, or "pose 3", counted from 0, without a file."""
        return rows_words([row], self.commands.line)

    def _strain_lines(self, lost: NDArray[np.bool_]) -> list[str]:
        """How much cables are strained if nothing limits that, and which ropes this breaks."""
        driven = self.robot.driven
        every = np.where(self.found[:, None], self.solution.evaluation.states[..., STRAIN], 0.0)
        strains = every[:, driven]
        if not strains.any():
            return []
        row, k = np.unravel_index(int(np.argmax(strains)), strains.shape)
        strain, pull = float(strains[row, k]), float(self.solution.tensions[row][driven][k])
        endless, broken = self.strain_limit is not None, breaking_words(strain)
        out = []
        if endless or broken:
            name = self.robot.cable_names[int(np.flatnonzero(driven)[k])]
            given = "no highest tension was given" if endless else "cables may break"
            out.append(
                f"{given}: {name} pulls {newtons(pull)} at {self.place(int(row))}, which strains "
                f"it by {100.0 * strain:.3g} %, {broken or NONE_BREAKS}"
            )
        if self.strain_limit is not None and np.any(lost):
            out.append(
                "nearest poses are sought with cables strained by at most "
                f"{100.0 * self.strain_limit:g} %; give a highest tension"
            )
        return out

    def _reasons(self) -> list[str]:
        """The first poses that cannot be held, each with the reason."""
        rows = np.flatnonzero(~self.held)
        named_rows = [f"  {self.place(i)}: {self.why_not[i]}" for i in rows[:_NAMED]]
        more = len(rows) - _NAMED
        return [*named_rows, f"  and {more} more, see why_not"] if more > 0 else named_rows

    def records(self) -> list[Record]:
        """One row per pose: wanted pose, lengths, remaining error, tensions."""
        cables, driven = self.robot.cable_names, np.flatnonzero(self.robot.driven)
        return rows_of(
            {
                **named("want_{}", COORDINATES, self.wanted),
                **named("length_{}_m", [str(k + 1) for k in driven], self.lengths[:, driven]),
                "held": self.held,
                "reached": self.reached,
                "why_not": self.why_not,
                **named("left_{}", MOTION, self.left),
                **named("tension_{}_N", cables, self.solution.tensions),
            }
        )

    def as_json(self, kept: Array | None = None) -> Record:
        """``correction.json``.

        Args:
            kept: (n,) probability that tensions stay within their limits, :func:`kept_chance`.
        """
        left, line, there = self.left, self.commands.line, self.solution
        return {
            "robot": self.robot.name,
            "cables": self.robot.cable_names,
            "poses": len(self.wanted),
            "reached": int(self.reached.sum()),
            "not_held": int((~self.held).sum()),
            "without_answer": int((~(self.found & there.converged)).sum()),
            "rows": [
                {
                    **({} if line is None else {"line": line[i]}),
                    "wanted": self.wanted[i],
                    "aimed": self.aimed[i] if self.found[i] else None,
                    "lengths_m": self.lengths[i],
                    "held": self.held[i],
                    "why_not": self.why_not[i] or None,
                    "reached": reached,
                    "left_m": left[i, :3],
                    "left_rad": left[i, 3:],
                    "within_limits_probability": None if kept is None else kept[i],
                    "tensions_N": there.tensions[i],
                    "status": there.status[i] if self.found[i] else "no_answer",
                }
                for i, reached in enumerate(self.reached)
            ],
        }


def _largest(vectors: Array, rounding: float = _MOVED) -> float:
    """The longest of vectors (n, 3), displacements [m] or rotations [deg]; 0 for rounding."""
    longest = float(np.linalg.norm(vectors, axis=1).max())
    return 0.0 if longest < rounding else longest


def _degrees(turned: Array) -> float:
    """The largest of rotations (n, 3) [rad] in degrees; 0 where that is rounding."""
    return _largest(np.degrees(turned), _TURNED)


def rests_at(poses: Array, solution: Solution) -> NDArray[np.bool_]:
    """(n,) whether the platform is at rest at poses (n, 7), to within a micrometre."""
    size = np.where(np.arange(6) < 3, 1.0, solution.robot.length)
    off = np.abs(changes_between(solution.pose, poses) * size).max(axis=1)
    return np.asarray(solution.converged & (off < REACHED))
