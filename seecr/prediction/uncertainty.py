"""The uncertainty of a calibrated model's predictions, from the covariance that it keeps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seecr.counted import counted
from seecr.description.mjcf import GivenRobot, robot_of
from seecr.effects import Terms
from seecr.files import read_text
from seecr.pose import Array
from seecr.prediction.effect_tables import UNSEEN, Where, number_of
from seecr.prediction.experiment import Experiment, senses
from seecr.prediction.model import CALIBRATION, FIT, Model, model_given
from seecr.prediction.sensitivity import sensitivities
from seecr.result import MOTION, Record, Result, named, rows_of
from seecr.statics.starts import Commanded, answered, commands_from
from seecr.units import short

PARAMETERS, STDERR, CORRELATION = "parameters", "stderr", "correlation"
"""Keys of the table: labels, their standard errors with all digits, and rows up to the diagonal."""

# An eigenvalue of a correlation matrix this far below zero is not due to rounding of its digits;
# files of earlier versions have six digits.
_ROUNDED = 1e-3
# A value's own standard error has three digits; if it differs by more, somebody has edited it.
_SAME = 0.01


@dataclass(frozen=True, eq=False, repr=False)
class Spread(Result):
    """Standard deviations of the poses of n commands, due to the uncertainty of the model's values.

    They are to first order in the parameters, like the covariance itself; NaN for a row without
    equilibrium.

    Attributes:
        position: (n, 3) [m]; rotation: (n, 3) [rad], rotation vector in the base frame.
        tensions: (n, m) [N]; 0 for a slack cable.
        seen: (n, 6) [m, rad] the same for what the tracker would read. Often a calibration
            leaves only the tracker's pose in the base frame open: platform and tracker then move
            together, and this is small.
    """

    position: Array
    rotation: Array
    tensions: Array
    seen: Array

    def lines(self) -> list[str]:
        """The largest of all rows, of the platform itself and of what the tracker would read."""
        n, rests = len(self.position), ~np.isnan(self.position[:, 0])
        head = f"{counted(n, 'command')}, at rest at {int(rests.sum())}"
        if not rests.any():
            return [head]
        there, seen = (
            f"{short(1e3 * _longest(place[rests]), 2)} mm and "
            f"{short(np.degrees(_longest(turn[rests])), 2)} deg"
            for place, turn in (
                (self.position, self.rotation),
                (self.seen[:, :3], self.seen[:, 3:]),
            )
        )
        pulls = short(float(self.tensions[rests].max()), 2)
        return [
            f"{head}; one standard deviation: up to {there}, {pulls} N; as read by the tracker: "
            f"{seen}"
        ]

    def records(self) -> list[Record]:
        """One row per command."""
        cables = [str(k + 1) for k in range(self.tensions.shape[1])]
        return rows_of(
            {
                **named("stderr_{}", MOTION, np.hstack([self.position, self.rotation])),
                **named("stderr_seen_{}", MOTION, self.seen),
                **named("stderr_tension_{}_N", cables, self.tensions),
            }
        )


def _longest(vectors: Array) -> float:
    """Length of the longest of vectors (n, 3)."""
    return float(np.linalg.norm(vectors, axis=1).max())


def covariance_of(model: Model) -> Array | None:
    """Covariance (p, p) of a model's values, each in its own unit; None if the model keeps none.

    The correlations of ``[fit]``, or else of ``[calibration]``, are multiplied by the standard
    errors stated with the values. These are used with all digits where ``[fit]`` or
    ``[calibration]`` has them. Values that were added to the model later are uncorrelated with the
    others, and count as exact if nobody knows their errors.

    Raises:
        InputFileError: the table holds no valid correlations.
    """
    kept_in = _kept_in(model)
    if kept_in is None or not model.names:
        return None
    title, table = kept_in
    labels = [f"{effect}.{key}" for effect, key in model.terms.labels]
    names = _names(model, title, table.get(PARAMETERS, []))
    kept = _correlations(model, names, table[CORRELATION])
    stderr = np.concatenate([model.errors_of(name) for name in model.terms.names])
    out = np.eye(len(labels))
    both = [(labels.index(name), k) for k, name in enumerate(names) if name in labels]
    here, there = np.array(both, dtype=int).reshape(-1, 2).T
    out[np.ix_(here, here)] = kept[np.ix_(there, there)]
    stderr[here] = _in_full(model, stderr[here], table, there)
    known = np.where(np.isfinite(stderr), stderr, 0.0)
    return np.asarray(out * np.outer(known, known))


def _names(model: Model, title: str, given: object) -> list[str]:
    """Labels of the values whose correlations are kept; effects since removed may be among them."""
    names = [str(name) for name in given] if isinstance(given, list) else []
    for k, label in enumerate(names):
        effect, _dot, key = label.partition(".")
        wrong = label in names[:k]
        if effect in model.names:
            layout = model.terms[effect].layout
            wrong = wrong or key not in (*layout.names, *layout.effect.renamed)
        if wrong:
            raise _file_of(model).error(
                f"[{title}] {PARAMETERS}: expected each parameter once, as EFFECT.PARAMETER, got "
                f"{label!r}; fit the model again",
                key=title,
            )
    return names


def _kept_in(model: Model) -> tuple[str, Mapping[str, Any]] | None:
    """The table that keeps correlations, and its name."""
    tables = ((name, model.document.get(name)) for name in (FIT, CALIBRATION))
    own = ((name, t) for name, t in tables if isinstance(t, Mapping) and CORRELATION in t)
    return next(own, None)


def _in_full(
    model: Model, short: Array, table: Mapping[str, Any], which: NDArray[np.intp]
) -> Array:
    """Standard errors with all digits from a table, where they agree with the short ones.

    Combinations of values may be known a hundred times better than each value; three digits of the
    errors would not be enough for them.
    """
    if STDERR not in table:
        return short
    given, count = table[STDERR], len(table[PARAMETERS])
    if not isinstance(given, list) or len(given) != count:
        got = len(given) if isinstance(given, list) else given
        raise _file_of(model).error(
            f"{STDERR}: expected {counted(count, 'number')}, one for each of {PARAMETERS}, got "
            f"{got}; fit the model again",
            key=STDERR,
        )
    every = [np.inf if cell == UNSEEN else number_of(cell) for cell in given]
    for cell, one in zip(given, every, strict=True):
        if one is None or not one >= 0.0:
            raise _file_of(model).error(
                f"{STDERR}: expected numbers from 0 on, or {UNSEEN!r}, got {cell!r}; fit the model "
                "again",
                key=STDERR,
            )
    full = np.array(every)[which]
    with np.errstate(invalid="ignore"):
        return np.where(np.abs(full - short) <= _SAME * short, full, short)


def moving_covariance(model: Model) -> tuple[Terms, Array] | None:
    """The terms that move the platform (not sensors), and their covariance (p, p), if kept."""
    whole = covariance_of(model)
    if whole is None:
        return None
    moving = [term.name for term in model.terms if not senses(term.layout.effect)]
    columns = np.flatnonzero([effect in moving for effect, _key in model.terms.labels])
    return model.terms.only(moving), whole[np.ix_(columns, columns)]


def _correlations(model: Model, names: list[str], rows: object) -> Array:
    """The full matrix (k, k), from rows that end at the diagonal."""
    out = np.eye(len(names))
    try:
        for k, row in enumerate(rows):  # type: ignore[arg-type, var-annotated]
            out[k, : k + 1] = out[: k + 1, k] = np.asarray(row, float)
        whole = len(rows) == len(names) > 0  # type: ignore[arg-type]
        fine = whole and np.allclose(np.diag(out), 1.0) and np.abs(out).max() <= 1.0 + 1e-9
        fine = bool(fine) and float(np.linalg.eigvalsh(out)[0]) > -_ROUNDED
    except (OverflowError, TypeError, ValueError, IndexError):
        fine = False
    if not fine:
        raise _file_of(model).error(
            f"{CORRELATION}: expected {counted(len(names), 'row')} of numbers, one for each of "
            f"{PARAMETERS}, each up to its diagonal, which is 1; fit the model again",
            key=CORRELATION,
        )
    return out


def _file_of(model: Model) -> Where:
    """The file as on disk, to find the line of a mistake: reading has changed the document."""
    if model.path is None:
        return Where(Path("the model"), model.document.as_string())
    return Where(model.path, read_text(model.path, "expected a model"))


def spread_of(robot: GivenRobot, commands: Commanded, model: Model | str | Path) -> Spread | None:
    """Standard deviations of poses and tensions; None if the model keeps no covariance.

    Args:
        robot: as described, or its MJCF.
        commands: as in :func:`seecr.predict`.
        model: as ``crosscheck calibrate``, ``add`` or ``diagnose`` write it, or its file.

    Returns:
        (n, 3) [m], (n, 3) [rad] and (n, m) [N]; None without a covariance.

    Raises:
        InputFileError: the model holds no valid correlations.

    Example:
        ``seecr.spread_of(robot, poses, "model.toml")``
    """
    robot = robot_of(robot)
    model = model_given(model, robot)
    whole, known = covariance_of(model), moving_covariance(model)
    if whole is None or known is None:
        return None
    terms, covariance = known
    experiment = Experiment(robot, answered(commands_from(commands, robot)))
    own = _spread(experiment, terms, covariance)
    all_move = len(terms.names) == len(model.terms.names)
    seen = own if all_move else _spread(experiment, model.terms, whole)
    return Spread(own[:, :3], own[:, 3:6], own[:, 6:], seen[:, :6])


def _spread(experiment: Experiment, terms: Terms, covariance: Array) -> Array:
    """Standard deviations (n, 6 + m) of readings, from the covariance (p, p) of the terms."""
    at = experiment.predict(terms.effects)
    out = np.zeros((len(experiment.commands), 6 + experiment.robot.n_cables))
    if len(terms):
        slopes = sensitivities(experiment, terms, at)
        squares = np.einsum("nip,pq,niq->ni", slopes, covariance, slopes)
        out = np.sqrt(np.maximum(squares, 0.0))
    out[~at.solved] = np.nan
    return out
