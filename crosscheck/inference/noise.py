"""The noise of readings: its size, its correlation along runs, and readings that are far off.

A reading of kind k (position, orientation, tension) in row i has the noise

    e_ik = scale_k s_i AR(1; rho_k along the run),   s_i in FAR with the chances OUTLIERS

in units of the stated noise. Two readings that are ``gap`` steps apart have the correlation
rho^gap, where a step is the usual time between rows (or one row if times are not known). Whitening
divides by the size and subtracts what the reading before predicts:

    v_i = (u_i - phi u_before)/sqrt(1 - phi^2),   u = sqrt(weight) r/scale,   phi = rho^gap

Scale and rho maximise the marginal likelihood of a fit, in which all that its effects can imitate
is integrated out (REML; Patterson and Thompson, Biometrika 58, 1971): with y = r + X z,

    y ~ N(0, X W^2 X^T + Sigma(scale, rho)),   z ~ N(0, W^2)

The residuals of a fit alone would be too small and too little correlated. What outliers add to the
likelihood is its variational bound: the weights are sum_s q_s/s^2 with the posterior chances q.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, special

from crosscheck.fit.algebra import root_beside_one
from crosscheck.fit.problem import KINDS, Problem, kinds_read
from crosscheck.inference import priors
from seecr.pose import Array

# Gap of readings that are so far apart that they are not correlated.
_LONG = 1e3
# Limits of the estimate: beyond them nothing changes any more.
_SMALLEST, _LARGEST, _MOST_ALIKE = 1e-2, 1e3, 0.97
# Fisher scoring: most steps, most halvings of one, the gain in ln likelihood that ends it, and the
# longest step of ln scale and of rho.
_STEPS, _HALVINGS, _GAIN, _LONGEST = 12, 6, 1e-3, (2.0, 0.5)
# rho for derivatives at 0: of gaps below 1, rho^gap grows there without bound.
_LEAST_RHO = 1e-6
# A reading with less weight than this is an outlier.
_OUTLIER = 0.05


@dataclass(frozen=True, eq=False)
class Chain:
    """The order in which the counted readings (N,) follow one another.

    Attributes:
        kind: (N,) number of each reading's kind in KINDS. row: (N,) its row.
        before: (N,) number of the reading before it in its run and channel; -1 for the first.
        gap: (N,) steps since that reading.
    """

    kind: NDArray[np.int64]
    row: NDArray[np.int64]
    before: NDArray[np.int64]
    gap: Array

    def without(self, absent: NDArray[np.bool_]) -> Chain:
        """The same where some readings (N,) predict none after them."""
        cut = (self.before >= 0) & absent[self.before]
        return replace(self, before=np.where(cut, -1, self.before))

    def only(self, some: NDArray[np.intp]) -> Chain:
        """Some readings by themselves; none may follow another one."""
        place = np.full(len(self.row) + 1, -1)  # of -1, too, which has no reading before
        place[some] = np.arange(len(some))
        return Chain(self.kind[some], self.row[some], place[self.before[some]], self.gap[some])


@dataclass(frozen=True, eq=False)
class Noise:
    """Size and correlation of the noise.

    Attributes:
        scale: (3,) standard deviation of each kind over the stated one.
        rho: (3,) correlation of successive readings of a run.
    """

    scale: Array
    rho: Array

    def by_kind(self, problem: Problem) -> tuple[dict[str, float], dict[str, float]]:
        """Scale and rho, by the name of each kind of reading in the data."""
        kinds = {KINDS.index(kind): kind.name for kind in kinds_read(problem)}
        return (
            {name: float(self.scale[k]) for k, name in kinds.items()},
            {name: float(self.rho[k]) for k, name in kinds.items()},
        )


STATED_NOISE = Noise(np.ones(len(KINDS)), np.zeros(len(KINDS)))
"""White noise of the stated size."""


def chain_of(problem: Problem) -> Chain:
    """The order of a problem's counted readings."""
    row, column = problem.row_of, problem.column_of
    ends = [kind.columns.indices(problem.measured.shape[1]) for kind in KINDS]
    kind_of = np.concatenate([np.full(len(range(*end)), k) for k, end in enumerate(ends)])
    run = problem.data.run_index[row]
    order = np.lexsort((row, column, run))
    follows = (run[order][1:] == run[order][:-1]) & (column[order][1:] == column[order][:-1])
    before = np.full(len(row), -1, dtype=np.int64)
    before[order[1:][follows]] = order[:-1][follows]
    return Chain(kind_of[column], row, before, _gaps(problem, row, before))


def _gaps(problem: Problem, row: NDArray[np.int64], before: NDArray[np.int64]) -> Array:
    """(N,) steps between readings, by time if it is known, else by rows."""
    clock = problem.data.t_s
    if clock is None:
        clock = np.arange(problem.data.n_rows, dtype=float)
    since = np.where(before < 0, np.nan, np.abs(clock[row] - clock[row[before]]))
    # rows with the same time are taken to be one usual step apart
    usual = float(np.median(since[since > 0.0])) if (since > 0.0).any() else 1.0
    return np.nan_to_num(np.where(since == 0.0, usual, since) / usual, nan=_LONG)


# --- whitening ------------------------------------------------------------------------------------


def foretold(chain: Chain, noise: Noise) -> Array:
    """(N,) phi: correlation of each reading's noise with that of the reading before."""
    rho = noise.rho[chain.kind]
    return np.where(chain.before < 0, 0.0, rho ** np.minimum(chain.gap, _LONG))


def whitened(chain: Chain, noise: Noise, weight: Array, values: Array) -> Array:
    """Residuals (N,) or derivatives (N, p), in units of the stated noise, made white."""
    size = np.sqrt(weight) / noise.scale[chain.kind]
    return _less_foretold(chain, noise, values * _along(values, size))


def _less_foretold(chain: Chain, noise: Noise, unit: Array) -> Array:
    phi = foretold(chain, noise)
    if not phi.any():
        return unit
    left = unit[np.maximum(chain.before, 0)]  # of many columns: one copy is enough
    left *= -_along(unit, phi)
    left += unit
    left /= _along(unit, np.sqrt(1.0 - phi**2))
    return left


def _along(values: Array, factor: Array) -> Array:
    return factor if values.ndim == 1 else factor[:, None]


def log_det(chain: Chain, noise: Noise) -> float:
    """ln determinant of the noise's covariance over that of the stated noise, without weights."""
    phi = foretold(chain, noise)
    return float(np.sum(2.0 * np.log(noise.scale[chain.kind])) + np.sum(np.log1p(-(phi**2))))


# --- size and correlation -------------------------------------------------------------------------


def estimate(chain: Chain, start: Noise, weight: Array, x: Array, y: Array, width: Array) -> Noise:
    """The noise of maximum marginal likelihood, by Fisher scoring.

    Args:
        chain: the order of the readings. start: where to begin. weight: (N,) of each reading.
        x: (N, p) derivatives by z, y: (N,) r + X z, both in units of the stated noise.
        width: (p,) prior standard deviations of z.
    """
    kinds = np.unique(chain.kind)
    linked = np.array([bool(np.any(chain.before[chain.kind == k] >= 0)) for k in kinds])
    count = np.bincount(chain.kind, minlength=len(KINDS))[kinds]
    columns = x * width
    rho = np.where(linked, np.clip(start.rho[kinds], 0.0, _MOST_ALIKE), 0.0)
    log_scale = np.clip(np.log(start.scale[kinds]), np.log(_SMALLEST), np.log(_LARGEST))

    def noise(log_scale: Array, rho: Array) -> Noise:
        scale, alike = np.ones(len(KINDS)), np.zeros(len(KINDS))
        scale[kinds], alike[kinds] = np.exp(log_scale), rho
        return Noise(scale, alike)

    def at(log_scale: Array, rho: Array) -> tuple[float, Array, Array]:
        value, by_scale, by_rho = _likelihood(chain, noise(log_scale, rho), weight, columns, y)
        return value, by_scale[kinds], np.where(linked, by_rho[kinds], 0.0)

    value, by_scale, by_rho = at(log_scale, rho)
    for _ in range(_STEPS):
        # expected information of an AR(1) process, for each kind: of ln scale, of both, of rho
        other = 1.0 - rho**2
        a, b, c = 2.0 * count, -2.0 * count * rho / other, count * (1.0 + rho**2) / other**2
        free = linked & ~((rho <= 0.0) & (by_rho < 0.0)) & ~((rho >= _MOST_ALIKE) & (by_rho > 0.0))
        det = np.where(free, a * c - b**2, a)
        step_scale = np.where(free, c * by_scale - b * by_rho, by_scale) / det
        step_rho = np.where(free, (a * by_rho - b * by_scale) / det, 0.0)
        part = min(
            1.0,
            _LONGEST[0] / max(float(np.max(np.abs(step_scale))), 1e-300),
            _LONGEST[1] / max(float(np.max(np.abs(step_rho))), 1e-300),
        )
        for _ in range(_HALVINGS):
            trial = (
                np.clip(log_scale + part * step_scale, np.log(_SMALLEST), np.log(_LARGEST)),
                np.clip(rho + part * step_rho, 0.0, _MOST_ALIKE),
            )
            found = at(*trial)
            if found[0] > value:
                break
            part *= 0.4
        else:
            break
        gain, (value, by_scale, by_rho), (log_scale, rho) = found[0] - value, found, trial
        if gain < _GAIN:
            break
    return noise(log_scale, rho)


def _likelihood(
    chain: Chain, noise: Noise, weight: Array, columns: Array, y: Array
) -> tuple[float, Array, Array]:
    """ln likelihood, and its derivatives by each kind's ln scale (3,) and rho (3,).

    Power and volume depend on the noise through the same quadratic form: with L L^T = 1 + X^T X of
    the whitened X, and what the best z leaves of y, they change as the squares of the whitened rows
    of (X L^-T, y - X z) do.
    """
    size = np.sqrt(weight) / noise.scale[chain.kind]
    unit = np.column_stack([columns, y]) * size[:, None]
    white = _less_foretold(chain, noise, unit)
    factor = root_beside_one(white[:, :-1])
    part = linalg.solve_triangular(
        factor, white[:, :-1].T @ white[:, -1], lower=True, check_finite=False
    )
    z = linalg.solve_triangular(factor, part, lower=True, trans=1, check_finite=False)
    ball = linalg.solve_triangular(factor, unit[:, :-1].T, lower=True, check_finite=False)
    rows = np.column_stack([ball.T, unit @ np.append(-z, 1.0)])
    left = _less_foretold(chain, noise, rows)
    power = float(left[:, -1] @ left[:, -1]) + float(z @ z)
    volume = 2.0 * float(np.sum(np.log(np.diag(factor)))) + log_det(chain, noise)
    phi, rho = foretold(chain, noise), np.maximum(noise.rho[chain.kind], _LEAST_RHO)
    by_phi = np.where(chain.before < 0, 0.0, chain.gap * rho ** (chain.gap - 1.0))
    squares = np.einsum("ij,ij->i", left, left)
    with_before = np.einsum("ij,ij->i", left, rows[np.maximum(chain.before, 0)])
    other = 1.0 - phi**2
    slope = by_phi / other * (phi * (1.0 - squares) + np.sqrt(other) * with_before)

    def by_kind(each: Array) -> Array:
        return np.bincount(chain.kind, each, len(KINDS)).astype(float)

    return -0.5 * (power + volume), by_kind(squares - 1.0), by_kind(slope)


# --- readings that are far off --------------------------------------------------------------------


def mixture(chain: Chain, noise: Noise, residual: Array) -> tuple[Array, float]:
    """Weights (N,) of residuals (N,) if a row's noise has one of three sizes, and what that adds.

    It adds so much to the ln likelihood with these weights (a bound). While a fit is far off, the
    bulk of the residuals stands for the noise.
    """
    chance, sizes = np.log(priors.OUTLIERS), np.array(priors.FAR)
    weight, total = np.ones(len(residual)), 0.0
    for k in np.unique(chain.kind):
        mine = np.flatnonzero(chain.kind == k)
        _, group, count = np.unique(chain.row[mine], return_inverse=True, return_counts=True)
        power = np.bincount(group, residual[mine] ** 2)
        bulk = np.median(power / (2.0 * special.gammaincinv(0.5 * count, 0.5)))
        each_power = power / max(float(noise.scale[k]) ** 2, float(bulk))
        prior = chance - count[:, None] * np.log(sizes)
        each = prior - 0.5 * each_power[:, None] / sizes**2
        q = np.exp(each - special.logsumexp(each, axis=1, keepdims=True))
        weight[mine] = (q / sizes**2).sum(axis=1)[group]
        total += float(np.sum(q * prior + special.entr(q)))
    return weight, total


def outliers(chain: Chain, weight: Array, n_rows: int) -> NDArray[np.bool_]:
    """(n,) bool rows in which some kind of reading hardly counts."""
    least = np.ones(n_rows)
    np.minimum.at(least, chain.row, weight)
    return np.asarray(least < _OUTLIER)


# --- what is believed of the noise ----------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class NoisePrior:
    """What is believed of the noise of each kind before any fit.

    A stated noise is right to a factor of 1.4, or was misjudged. A scatter within dwells is only a
    lower bound. Without a statement, an estimate stands in, which may be wrong by anything.

    Attributes:
        kinds: numbers of the kinds that were read.
        stated: whether the noise of each was stated. bound: whether that is a lower bound.
    """

    kinds: NDArray[np.intp]
    stated: NDArray[np.bool_]
    bound: NDArray[np.bool_]

    @classmethod
    def of(cls, problem: Problem) -> NoisePrior:
        """That of a problem's readings."""
        kinds, given = kinds_read(problem), problem.data.sigma
        return cls(
            np.array([KINDS.index(kind) for kind in kinds], dtype=np.intp),
            np.array([getattr(given, kind.sigma) is not None for kind in kinds], dtype=bool),
            np.full(len(kinds), problem.data.sigma_source == "dwell_scatter"),
        )

    def log(self, noise: Noise) -> float:
        """ln prior density of the noise's size and correlation."""
        return float(np.sum(np.logaddexp.reduce(self._parts(noise), axis=0)))

    def misjudged(self, noise: Noise) -> Array:
        """(kinds,) probability that a statement was misjudged; 0 where there is none."""
        parts = self._parts(noise)
        chance = np.exp(parts[1] - np.logaddexp.reduce(parts, axis=0))
        return np.asarray(chance * (self.stated & ~self.bound))

    @staticmethod
    def log_misjudged(size: float) -> float:
        """ln prior density that a statement was misjudged by this factor, up to a constant."""
        off = np.log(size) / priors.MISJUDGED_BY
        return float(np.log(priors.MISJUDGED) - 0.5 * off**2 - np.log(priors.MISJUDGED_BY))

    def is_unknown(self, noise: Noise, place: float = 0.0) -> float:
        """Probability that what a fit takes for noise is something unknown.

        It is if it is larger than stated and slow, or if what a row foretells of the next one is
        larger than anybody misjudges; or, by the odds ``place``, if it goes by the place. What is
        white is noise, however large.
        """
        rho, scale = noise.rho[self.kinds], noise.scale[self.kinds]
        no_noise = (rho >= priors.SLOW) | (rho * scale > priors.MISJUDGED_MOST)
        misjudged = self.misjudged(noise)
        # the odds are of a noise that was rather misjudged than not
        goes_by_place = (misjudged > 0.5) * place / (1.0 + place)
        return float(np.max(np.maximum(misjudged * no_noise, goes_by_place), initial=0.0))

    def _parts(self, noise: Noise) -> Array:
        """(2, kinds) ln density of ln(noise/stated) and rho, as stated and misjudged.

        A stated noise is that of a sensor, whose readings from pose to pose hardly know of one
        another. So rho has the density 2 (1 - rho), the plainest one that is 0 at rho = 1.
        """
        off, alike = np.log(noise.scale[self.kinds]), noise.rho[self.kinds]

        def normal(width: Array) -> Array:
            return np.asarray(-0.5 * (off / width) ** 2 - np.log(width))

        as_stated = normal(np.where(self.stated, priors.STATED, priors.UNSTATED))
        as_stated += np.where(self.stated, np.log1p(-priors.MISJUDGED), 0.0)
        misjudged = np.log(priors.MISJUDGED) + normal(np.full(len(off), priors.MISJUDGED_BY))
        # above a lower bound, what is not its own noise is as probable as anything
        above = self.bound & (off > 0.0)
        as_stated = np.where(above, -np.inf, as_stated)
        misjudged = np.where(above, normal(np.full(len(off), priors.MISJUDGED_BY)), misjudged)
        sizes = np.stack([as_stated, np.where(self.stated, misjudged, -np.inf)])
        return sizes + np.where(self.stated, np.log(2.0 * (1.0 - alike)), 0.0)
