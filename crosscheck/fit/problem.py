"""Measurements as a weighted least-squares problem: residuals, their noise, their rows.

A residual is measured minus predicted: position [m], orientation as the rotation vector from the
predicted to the measured one [rad] (or the differences of the angles that were read), tension [N].
The noise of a row is that of its readings plus that of the commanded lengths, which the robot's own
sensitivity carries over to the readings:

    Sigma = diag(sigma^2) + (dy/dl0) sigma_length^2 (dy/dl0)^T

Residuals are whitened by its Cholesky factor, so that noise alone has unit variance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from crosscheck.measurements.data import Measurements, Sigma
from seecr.description.joints import locked
from seecr.description.robot import Robot
from seecr.effects import catalogue
from seecr.effects.base import Effect, Readings
from seecr.pose import Array, products, quat_conjugate, rotation_vectors, rxyz_from_quat
from seecr.prediction.experiment import Experiment, Prediction
from seecr.prediction.parted import Parted, rates_by_length
from seecr.units import in_unit

# Columns of a residual row: position, orientation, then tensions.
POSITION, ORIENTATION, TENSION = slice(0, 3), slice(3, 6), slice(6, None)
# Numbers that differ less [m, rad] are the same number; in so many rows no instrument reads it.
_ROUNDING, _ROWS = 1e-12, 4
# What is computed once, of the data alone.
_OF_DATA = ("measured", "filled_in", "uses_angles")


@dataclass(eq=False)
class Problem:
    """Readings of a robot, with their noise.

    Attributes:
        robot, data: what was measured.
        sigma: noise of each kind of reading, for every kind that was read.
        use: (n,) bool rows that count; the others are way points or were left out, see
            ``left_out``.
        left_out: sentences that name the rows left out, and why.
        considered: names of the effects that may explain the readings.
        far_off: (n,) bool outliers, if any are known; they hardly count in fits, and not at all in
            rms errors.
        groups: (n,) number of each row's file or run, if effects have separate values for these.
    """

    robot: Robot
    data: Measurements
    sigma: Sigma
    use: NDArray[np.bool_]
    left_out: tuple[str, ...] = ()
    considered: frozenset[str] = field(default_factory=lambda: frozenset(catalogue()))
    groups: NDArray[np.int64] | None = None
    far_off: NDArray[np.bool_] | None = None
    experiment: Experiment = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.experiment = Parted(self.robot, self.data.as_commands(self.robot))
        self.use = self.use & self.data.read

    def without(self, rows: NDArray[np.bool_], why: str) -> Problem:
        """The same problem with some rows left out; predictions already computed are shared."""
        return self._like(use=self.use & ~rows, left_out=(*self.left_out, why))

    def only(self, rows: NDArray[np.bool_]) -> Problem:
        """The same problem on some of its rows."""
        return self._like(use=self.use & rows)

    def with_sigma(self, sigma: Sigma) -> Problem:
        """The same problem with other noise."""
        return self._like(sigma=sigma)

    def with_far_off(self, rows: NDArray[np.bool_]) -> Problem:
        """The same problem with some rows marked as outliers."""
        return self._like(far_off=rows)

    def considering(self, names: frozenset[str]) -> Problem:
        """The same problem, with only some effects that may be missing."""
        return self._like(considered=names)

    def with_groups(self, groups: NDArray[np.int64] | None) -> Problem:
        """The same problem with other groups of rows."""
        return self._like(groups=groups)

    def _like(self, **changes: object) -> Problem:
        """The same problem with other fields than its robot and data."""
        other = object.__new__(Problem)
        kept = [*(item.name for item in fields(self)), *_OF_DATA]
        mine = vars(self)
        vars(other).update({name: mine[name] for name in kept if name in mine} | changes)
        return other

    @cached_property
    def measured(self) -> NDArray[np.bool_]:
        """(n, 6 + m) which readings exist."""
        data = self.data
        if data.quat_wxyz is not None:
            whole = np.asarray(np.isfinite(data.quat_wxyz).all(axis=1))
            turned = np.repeat(whole[:, None], 3, axis=1)
        else:
            turned = np.asarray(np.isfinite(data.angles_rad))
        measured = np.concatenate(
            [np.isfinite(data.position), turned, np.isfinite(data.tensions)], axis=1
        )
        measured[:, :6] &= ~self.filled_in
        return measured

    @cached_property
    def filled_in(self) -> NDArray[np.bool_]:
        """(6,) parts of the pose that joints lock and whose columns hold one number in all rows.

        Nothing read them: whoever wrote the file filled the pose in. Their noise would be zero.
        """
        data, fixed = self.data, locked(self.robot)
        if not fixed.any():
            return fixed
        turned = data.angles_rad
        if data.quat_wxyz is not None:
            home = quat_conjugate(self.robot.reference_pose[3:])
            turned = rotation_vectors(products(data.quat_wxyz, home))
        for k, values in enumerate(np.concatenate([data.position, turned], axis=1).T):
            some = values[np.isfinite(values)]
            fixed[k] &= len(some) >= _ROWS and np.ptp(some) <= _ROUNDING
        return fixed

    @cached_property
    def counted(self) -> NDArray[np.bool_]:
        """(n, 6 + m) which readings exist and count."""
        return self.measured & self.use[:, None]

    @cached_property
    def row_of(self) -> NDArray[np.int64]:
        """Row of each counted residual, in the order of whitened vectors."""
        return np.nonzero(self.counted)[0]

    @cached_property
    def column_of(self) -> NDArray[np.int64]:
        """Column of each counted residual."""
        return np.nonzero(self.counted)[1]

    @property
    def n_readings(self) -> int:
        """Number of counted readings."""
        return int(self.counted.sum())

    @cached_property
    def uses_angles(self) -> bool:
        """Whether the orientation was read as single angles only."""
        return self.data.quat_wxyz is None and bool(np.isfinite(self.data.angles_rad).any())

    def residuals(self, readings: Readings) -> Array:
        """Measured minus predicted, (n, 6 + m), NaN where nothing was read."""
        data = self.data
        if data.quat_wxyz is not None:
            back = quat_conjugate(readings.quat_wxyz)
            turned = rotation_vectors(products(data.quat_wxyz, back))
        elif self.uses_angles:
            turned = data.angles_rad - rxyz_from_quat(readings.quat_wxyz)
            turned = (turned + np.pi) % (2 * np.pi) - np.pi
        else:
            turned = np.full((data.n_rows, 3), np.nan)
        raw = np.concatenate(
            [data.position - readings.position, turned, data.tensions - readings.tensions],
            axis=1,
        )
        raw[:, :6][:, self.filled_in] = np.nan
        return raw

    def as_read(self, change: Array, readings: Readings) -> Array:
        """Convert derivatives (n, 6 + m, p) of rotation vectors to those of the angles read."""
        if not self.uses_angles:
            return change
        change = change.copy()
        change[:, ORIENTATION] = np.einsum(
            "nij,njp->nip", angle_rates(readings.quat_wxyz), change[:, ORIENTATION]
        )
        return change

    @cached_property
    def reading_sigma(self) -> Array:
        """(n, 6 + m) standard deviation of each reading; 1 for kinds without a stated noise.

        It cannot be written: rows that are all alike are one, shown so many times.
        """
        stated = (self.sigma.position_m, self.sigma.orientation_rad, self.sigma.tension_N)
        ratio = self.data.sigma_ratio[:, :3]
        alike = ratio[:1] if len(ratio) and not np.any(ratio != ratio[0]) else ratio
        by_kind = np.array([value or 1.0 for value in stated]) * alike
        table = np.repeat(by_kind, [3, 3, self.data.n_cables], axis=1)
        return np.broadcast_to(table, self.measured.shape)

    @cached_property
    def length_sigma(self) -> Array:
        """(n, 1) [m] standard deviation of each row's commanded lengths."""
        return (self.sigma.length_m or 0.0) * self.data.sigma_ratio[:, 3:]

    def by_length(self, at: Prediction) -> Array:
        """Derivative of what was read by the rest lengths, (n, 6 + m, m)."""
        return self.as_read(rates_by_length(at), at.readings)

    def noise(self, at: Prediction) -> Array:
        """Cholesky factors of each row's noise, (n, 6 + m, 6 + m); 1 where nothing was read.

        Of exact lengths, whose readings have noise of their own alone, only the diagonal (n, 6 + m)
        exists, and it is :attr:`reading_sigma`.
        """
        return self.noise_about(self.by_length(at) if self.sigma.length_m else None)

    def noise_under(self, effects: Sequence[Effect]) -> Array:
        """The same as a model sees it; nothing is predicted where lengths are exact."""
        if not self.sigma.length_m:
            return self.noise_about(None)
        return self.noise(self.experiment.predict(effects))

    def noise_about(self, by_length: Array | None) -> Array:
        """The same, given the derivative by lengths (n, 6 + m, m); None if lengths are exact."""
        if by_length is None or not self.sigma.length_m:
            return self.reading_sigma
        own = np.where(self.measured, self.reading_sigma, 1.0)
        rate = np.where(self.measured[:, :, None], by_length * self.length_sigma[:, None], 0.0)
        return noise_factors(own, rate)

    def whiten(self, factor: Array, values: Array) -> Array:
        """Counted residuals (N,) or derivatives (N, p), divided by the Cholesky factor of noise."""
        single = values.ndim == 2
        table = values[..., None] if single else values
        table = np.where(self.measured[..., None], table, 0.0)
        white: Array = in_units_of(factor, table)[self.counted]
        return white[:, 0] if single else white


def in_units_of(factor: Array, table: Array) -> Array:
    """Whiten residuals or derivatives (n, k, p) by Cholesky factors (n, k, k) of their noise.

    Factors (n, k) are the diagonals of those that have nothing else.
    """
    if factor.ndim == 3:
        return np.asarray(np.linalg.solve(factor, table), float)
    return table / factor[..., None]


def angle_rates(quat_wxyz: Array) -> Array:
    """d(rx, ry, rz)/d(rotation vector in the base frame), (n, 3, 3).

    The inverse of w = x' drx + y' dry + z' drz with the axes x' = x, y' = Rx y and z' = Rx Ry z. It
    does not exist at ry = +-90 deg, where cos(ry) is replaced by 1e-9.
    """
    angles = rxyz_from_quat(quat_wxyz)
    sx, cx = np.sin(angles[:, 0]), np.cos(angles[:, 0])
    sy, cy = np.sin(angles[:, 1]), np.maximum(np.cos(angles[:, 1]), 1e-9)
    one, nil = np.ones_like(sx), np.zeros_like(sx)
    rows = [[one, sx * sy / cy, -cx * sy / cy], [nil, cx, sx], [nil, -sx / cy, cx / cy]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


Rms = dict[str, float | None]


@dataclass(frozen=True)
class Kind:
    """A kind of reading.

    Attributes:
        name: name in words. key: key of its rms errors. sigma: name of its noise in :class:`Sigma`.
        columns: its columns in a row of residuals. si: its SI unit.
    """

    name: str
    key: str
    sigma: str
    columns: slice
    si: str

    @property
    def factor(self) -> float:
        """Factor from SI to ``unit``."""
        return in_unit(self.si)[0]

    @property
    def unit(self) -> str:
        """The unit in which people read it."""
        return in_unit(self.si)[1]

    def sizes(self, problem: Problem, raw: Array) -> Array:
        """(n,) size of each row's error: length of the vector, or the largest tension; SI.

        Args:
            problem: which readings count. raw: (n, 6 + m) residuals.

        Returns:
            NaN where nothing of the kind was read or the row does not count.
        """
        some = problem.counted[:, self.columns]
        part = np.where(some, raw[:, self.columns], 0.0)
        if self.name == "tension":
            size = np.max(np.abs(part), axis=1, initial=0.0)
        else:
            size = np.linalg.norm(part, axis=1)
        return np.where(some.any(axis=1), size, np.nan)


KINDS = (
    Kind("position", "position_rms_m", "position_m", POSITION, "m"),
    Kind("orientation", "orientation_rms_rad", "orientation_rad", ORIENTATION, "rad"),
    Kind("tension", "tension_rms_N", "tension_N", TENSION, "N"),
)
BY_NAME = {kind.name: kind for kind in KINDS}


def kinds_read(problem: Problem) -> list[Kind]:
    """The kinds of readings that count in these data."""
    return [kind for kind in KINDS if problem.counted[:, kind.columns].any()]


def kinds_stated(problem: Problem) -> list[Kind]:
    """The kinds of readings whose noise was stated, not estimated."""
    given = problem.data.sigma
    return [kind for kind in kinds_read(problem) if getattr(given, kind.sigma) is not None]


def rms_by_kind(problem: Problem, raw: Array) -> Rms:
    """Root mean square of the counted residuals: position [m], orientation [rad], tension [N].

    The mean is over single components, so that noise alone gives its sigma. It is None where
    nothing was read, and leaves out rows that are marked as ``far_off``.
    """
    out: Rms = {}
    counted = problem.counted
    if problem.far_off is not None:
        counted = counted & ~problem.far_off[:, None]
    for kind in KINDS:
        values = raw[:, kind.columns][counted[:, kind.columns]]
        out[kind.key] = float(np.sqrt((values**2).mean())) if len(values) else None
    return out


def noise_factors(own: Array, rate: Array) -> Array:
    """Cholesky factors (n, k, k) of diag(own^2) + rate rate^T: own (n, k), common (n, k, m)."""
    covariance = rate @ np.swapaxes(rate, 1, 2)
    index = np.arange(own.shape[1])
    covariance[:, index, index] += own**2
    try:
        return np.asarray(np.linalg.cholesky(covariance), float)
    except np.linalg.LinAlgError:
        # where a platform is almost free to move, the squares of its rates swallow the rest
        wide = np.concatenate([np.nan_to_num(rate), own[:, :, None] * np.eye(len(index))], axis=2)
        upper = np.linalg.qr(np.swapaxes(wide, 1, 2), mode="r")
        sign = np.where(np.diagonal(upper, axis1=1, axis2=2) < 0.0, -1.0, 1.0)
        return np.asarray(np.swapaxes(upper * sign[:, :, None], 1, 2))
