"""The differences between SEECR and MuJoCo at each pose, and the allowed differences."""

from __future__ import annotations

import difflib
import fnmatch
import math
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from crosscheck.settle.settler import SettlingBatch
from seecr.files import Toml, path_of, plain, read_toml
from seecr.pose import Array
from seecr.statics.solution import Solution

# The distance between two poses, by code that neither SEECR's nor MuJoCo's side uses.
#
# Both sides compute rotations with seecr.pose; an error there could cancel in a difference
# computed with it. Here SciPy rotates.


def gap(pose_a: Array, pose_b: Array) -> tuple[Array, Array]:
    """Distance [m] and angle [rad] between poses (..., 7), both (...,); NaN where a pose is NaN."""
    a, b = np.broadcast_arrays(np.asarray(pose_a, float), np.asarray(pose_b, float))
    distance = np.sqrt(np.sum((a[..., :3] - b[..., :3]) ** 2, axis=-1))
    angle = np.full(distance.shape, np.nan)
    known = np.isfinite(a).all(axis=-1) & np.isfinite(b).all(axis=-1)
    if known.any():
        one, other = (
            Rotation.from_quat(poses[known][:, 3:], scalar_first=True) for poses in (a, b)
        )
        angle[known] = (one.inv() * other).magnitude()
    return distance, angle


QUANTITIES = {
    "settled_position_m": ("settled", "position after plain settling"),
    "settled_orientation_rad": ("settled", "orientation after plain settling"),
    "position_m": ("polished", "position"),
    "orientation_rad": ("polished", "orientation"),
    "tension_N": ("tension", "tension of a cable"),
}
"""Quantities with thresholds, each as the head of a column and in words. ``settled_`` is MuJoCo
after plain settling, the others after the polish.
"""


@dataclass(frozen=True, eq=False)
class Differences:
    """Differences between MuJoCo and SEECR at n poses; NaN if one of them has no answer.

    Attributes:
        settled_position_m: (n,) [m] distance after plain settling.
        settled_orientation_rad: (n,) [rad] angle between them after plain settling.
        position_m: (n,) [m] distance after the polish.
        orientation_rad: (n,) [rad] angle after the polish.
        cable_tension_N: (n, m) [N] absolute difference of each cable's tension after the polish.
        slack_same: (n,) whether both find the same cables slack. A cable that is slack for one and
            taut for the other, by less than the allowed difference of tension, counts as the same.
    """

    settled_position_m: Array
    settled_orientation_rad: Array
    position_m: Array
    orientation_rad: Array
    cable_tension_N: Array
    slack_same: NDArray[np.bool_]

    @property
    def tension_N(self) -> Array:
        """Largest difference of a tension at each pose, (n,) [N]."""
        return np.asarray(self.cable_tension_N.max(axis=1))


@dataclass(frozen=True, eq=False)
class Allowance:
    """Largest differences that count as agreement at each of n poses.

    They are the thresholds, unless a robot is so nearly singular that the residual forces move it
    farther. Then the residual over the smallest eigenvalue of the stiffness is allowed.

    Attributes:
        settled_position_m, settled_orientation_rad, position_m, orientation_rad, tension_N:
            (n,) as in :class:`Differences`.
        widened: (n,) whether any of them is wider than its threshold.
    """

    settled_position_m: Array
    settled_orientation_rad: Array
    position_m: Array
    orientation_rad: Array
    tension_N: Array
    widened: NDArray[np.bool_]


def allowances(thresholds: Thresholds, solution: Solution, settling: SettlingBatch) -> Allowance:
    """Thresholds, or residual over smallest eigenvalue where that is larger."""
    load = solution.tables.scale
    softest = np.fmin(solution.smallest_eigenvalue, settling.smallest_eigenvalue)
    # Below rounding there is no stiffness to divide by: the thresholds hold as they are.
    firm = softest > settling.neutral
    per_newton = np.divide(1.0, softest, out=np.zeros_like(softest), where=firm)
    length = solution.robot.length
    rough = load * _known(solution.residual + settling.settled_residual) * per_newton
    fine = load * _known(solution.residual + settling.residual) * per_newton
    slack = {
        "settled_position_m": rough,
        "settled_orientation_rad": rough / length,
        "position_m": fine,
        "orientation_rad": fine / length,
        # A soft direction is soft because tensions hardly change along it.
        "tension_N": np.zeros_like(fine),
    }
    base = by_quantity(thresholds)
    wide = {name: np.maximum(base[name], slack[name]) for name in QUANTITIES}
    widened = np.any([slack[name] > base[name] for name in QUANTITIES], axis=0)
    return Allowance(**wide, widened=widened)


def differences_of(
    solution: Solution, settling: SettlingBatch, tension_allowed: Array
) -> Differences:
    """Differences between MuJoCo's and SEECR's answers.

    Args:
        solution: n poses.
        settling: the same n poses.
        tension_allowed: (n,) [N] below this a taut cable may be slack for the other.
    """
    settled_m, settled_rad = gap(settling.settled_pose, solution.pose)
    position_m, orientation_rad = gap(settling.pose, solution.pose)
    tension = np.abs(settling.tensions - solution.tensions)
    larger = np.fmax(settling.tensions, solution.tensions)
    same = (settling.slack == solution.slack) | (larger <= tension_allowed[:, None])
    return Differences(
        settled_position_m=settled_m,
        settled_orientation_rad=settled_rad,
        position_m=position_m,
        orientation_rad=orientation_rad,
        cable_tension_N=tension,
        slack_same=same.all(axis=1),
    )


def ratios(difference: Differences, allowance: Allowance) -> Array:
    """Each difference over its allowance, (n, 5) in the order of ``QUANTITIES``."""
    parts = [getattr(difference, name) / getattr(allowance, name) for name in QUANTITIES]
    return np.stack(parts, axis=1)


def within(difference: Differences, allowance: Allowance) -> NDArray[np.bool_]:
    """Whether all differences are allowed and the same cables are slack, (n,)."""
    close = np.all(ratios(difference, allowance) <= 1.0, axis=1)  # False where NaN
    return np.asarray(close & difference.slack_same)


def by_quantity(thresholds: Thresholds) -> dict[str, float]:
    """The thresholds by ``QUANTITIES``, in that order."""
    settled = {f"settled_{name}": value for name, value in vars(thresholds.settled).items()}
    return settled | vars(thresholds.polished)


def _known(residual: Array) -> Array:
    """Residuals, with zero where there is no answer: NaN and infinity widen no threshold."""
    return np.where(np.isfinite(residual), residual, 0.0)


# The thresholds of the suite, from a TOML file that a user can copy and change.

SHIPPED = Path(__file__).with_name("thresholds.toml")


@dataclass(frozen=True)
class SettledLimits:
    """Limits for MuJoCo after plain settling."""

    position_m: float = math.nan
    orientation_rad: float = math.nan


@dataclass(frozen=True)
class PolishedLimits:
    """Limits for MuJoCo after the polish."""

    position_m: float = math.nan
    orientation_rad: float = math.nan
    tension_N: float = math.nan


@dataclass(frozen=True)
class FindingLimits:
    """How many poses of a case may have more than one right answer.

    Attributes:
        branches: largest number with two stable equilibria.
        free_to_move: names ``CASE POSE``, or patterns, of those that may be free to move.
        free_elsewhere: largest share of those in a case whose poses have no names.
    """

    branches: int = 0
    free_to_move: tuple[str, ...] = ()
    free_elsewhere: float = 0.0

    def names(self, case: str, pose: int) -> bool:
        """Whether a pose is named as free to move."""
        return any(fnmatch.fnmatchcase(f"{case} {pose}", name) for name in self.free_to_move)


@dataclass(frozen=True)
class Thresholds:
    """What counts as agreement between SEECR and MuJoCo.

    Attributes:
        settled: largest differences against MuJoCo after plain settling.
        polished: largest differences against MuJoCo after the polish.
        findings: how many poses may have more than one right answer.
    """

    settled: SettledLimits = field(default_factory=SettledLimits)
    polished: PolishedLimits = field(default_factory=PolishedLimits)
    findings: FindingLimits = field(default_factory=FindingLimits)


def load_thresholds(path: str | Path | None = None) -> Thresholds:
    """Read thresholds; those that the file leaves out keep their shipped values.

    Args:
        path: a TOML file; None for the shipped one.

    Returns:
        the thresholds.

    Raises:
        InputFileError: not TOML, an unknown table or key, or a value of another kind.
        InputError: no path.

    Example:
        ``crosscheck.load_thresholds()``
    """
    shipped = _merge(Thresholds(), SHIPPED)
    return shipped if path is None else _merge(shipped, path_of(path, "thresholds"))


def thresholds_toml(thresholds: Thresholds) -> str:
    """Thresholds as the text of a file, with the comments of the shipped one."""
    import tomlkit

    document = tomlkit.parse(SHIPPED.read_text(encoding="utf-8"))
    for table, values in plain(thresholds).items():
        for key, value in values.items():
            if document[table][key] != value:
                document[table][key] = value
    return tomlkit.dumps(document)


def _merge(thresholds: Thresholds, path: Path) -> Thresholds:
    file = read_toml(path, f"expected thresholds such as those in {SHIPPED}")
    _check_names(file, file.content, vars(thresholds), "table")
    parts = {}
    for table, values in file.content.items():
        part = getattr(thresholds, table)
        if not isinstance(values, dict):
            raise file.error(f"{table}: expected a table [{table}], got {values!r}", table)
        _check_names(file, values, vars(part), f"key of [{table}]")
        for key, value in values.items():
            expected, fits = _KINDS[key]
            if not fits(value):
                raise file.error(f"[{table}] {key}: expected {expected}, got {value!r}", key)
        of_kind = {key: type(getattr(part, key))(value) for key, value in values.items()}
        parts[table] = replace(part, **of_kind)
    return replace(thresholds, **parts)


def _check_names(file: Toml, got: Iterable[str], known: Collection[str], what: str) -> None:
    for name in got:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=len(known), cutoff=0.0)
            raise file.error(
                f"{name!r} is not a {what} of thresholds; expected {' or '.join(near)}", name
            )


def _is_number(value: Any, kind: Any = int | float) -> bool:
    return isinstance(value, kind) and not isinstance(value, bool) and math.isfinite(value)


def _are_names(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(name, str) for name in value)


_Kind = tuple[str, Callable[[Any], bool]]


def _positive(most: float) -> _Kind:
    return f"a positive number up to {most:.3g}", lambda v: _is_number(v) and 0 < v <= most


# Two physics that differ by a metre, half a turn or a kilonewton agree on no robot: a larger
# threshold is a typing error that would switch its gate off.
_KINDS: dict[str, _Kind] = {
    "position_m": _positive(1.0),
    "orientation_rad": _positive(math.pi),
    "tension_N": _positive(1000.0),
    "branches": ("a whole number from 0 on", lambda v: _is_number(v, int) and v >= 0),
    "free_to_move": ('a list of names "CASE POSE"', _are_names),
    "free_elsewhere": ("a share from 0 to 1", lambda v: _is_number(v) and 0 <= v <= 1),
}
