"""Is what is left noise? Goodness of fit, structure along the way, and noise nobody stated."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import spatial, stats

from crosscheck.fit.problem import Problem, kinds_read
from seecr.pose import Array, rotvec_from_quat

# Residuals are structured where neighbours agree by more than this many standard errors.
STRUCTURED = 4.0
# A goodness of fit below this is not noise of the stated size.
POOR_FIT = 1e-3
# Residuals are not taken to go together more than this.
_MOST_ALIKE = 0.98


@dataclass(frozen=True)
class Whiteness:
    """Tests of whitened residuals against noise.

    Attributes:
        chi2: sum of squares; dof: readings less parameters seen.
        p: chance of a chi2 this large from noise of the stated size.
        scale: sqrt(chi2/dof), the noise in units of the stated one.
        lag: correlation of a residual with the next one of its run.
        lag_errors: the same in standard errors.
        neighbour: correlation with the residual at the nearest commanded pose.
        neighbour_errors: the same in standard errors.
        runs_p: smallest p of the runs tests of the signs, a run and reading, times their number.
    """

    chi2: float
    dof: int
    p: float
    scale: float
    lag: float
    lag_errors: float
    neighbour: float
    neighbour_errors: float
    runs_p: float

    @property
    def structured(self) -> bool:
        """Whether neighbours agree more than noise would."""
        return max(self.lag_errors, self.neighbour_errors) > STRUCTURED

    @property
    def inflation(self) -> float:
        """By how much standard errors of fitted values grow over those of the stated noise.

        By the size of what is left; and where that has structure, residuals that go together
        count for fewer: n (1 - rho)/(1 + rho) of n with correlation rho from one to the next.
        """
        grown = max(1.0, self.scale)
        if not self.structured:
            return grown
        rho = min(max(self.lag, self.neighbour, 0.0), _MOST_ALIKE)
        return float(grown * np.sqrt((1.0 + rho) / (1.0 - rho)))

    @property
    def is_noise(self) -> bool:
        """Whether nothing speaks against noise of the stated size."""
        return self.p > POOR_FIT and not self.structured


def whiteness(problem: Problem, white: Array, parameters: int) -> Whiteness:
    """Test whitened residuals (N,) that ``parameters`` directions were fitted to."""
    table = as_table(problem, white)
    dof = max(len(white) - parameters, 1)
    chi2 = float(white @ white)
    lag = _pairs(table, _next_rows(problem))
    near = _pairs(table, _nearest_rows(problem))
    return Whiteness(
        chi2=chi2,
        dof=dof,
        p=float(stats.chi2.sf(chi2, dof)),
        scale=float(np.sqrt(chi2 / dof)),
        lag=lag[0],
        lag_errors=lag[1],
        neighbour=near[0],
        neighbour_errors=near[1],
        runs_p=_runs_test(problem, table),
    )


def as_table(problem: Problem, white: Array) -> Array:
    """Whitened residuals as (n, 6 + m), NaN where nothing counts."""
    table = np.full(problem.measured.shape, np.nan)
    table[problem.row_of, problem.column_of] = white
    return table


def _pairs(table: Array, pairs: Array) -> tuple[float, float]:
    """Correlation of residual rows in pairs (k, 2), and its size in standard errors."""
    if len(pairs) == 0:
        return 0.0, 0.0
    product = table[pairs[:, 0]] * table[pairs[:, 1]]
    # a structure in one channel is not to drown in the noise of the others: the best channel
    # counts, against the number of channels
    best, best_errors = 0.0, 0.0
    channels = [c for c in range(table.shape[1]) if np.isfinite(product[:, c]).any()]
    for chosen in [channels, *[[c] for c in channels]]:
        part = product[:, chosen]
        both = np.isfinite(part)
        if both.sum() < 8:
            continue
        power = float(np.nanmean(table[:, chosen] ** 2))
        correlation = float(part[both].mean() / max(power, 1e-300))
        errors = correlation * np.sqrt(both.sum())
        if errors > best_errors:
            best, best_errors = correlation, errors
    return best, best_errors


def _next_rows(problem: Problem) -> Array:
    run, use = problem.data.run_index, problem.use
    rows = np.flatnonzero(use)
    together = run[rows[1:]] == run[rows[:-1]]
    return np.stack([rows[:-1][together], rows[1:][together]], axis=1)


def _nearest_rows(problem: Problem) -> Array:
    """Each row with the row of nearest command that is not its neighbour in time."""
    commands = problem.experiment.commands
    rows = np.flatnonzero(problem.use)
    if len(rows) < 8:
        return np.zeros((0, 2), dtype=int)
    if commands.lengths is not None:
        place = commands.lengths[rows]
    else:
        turn = rotvec_from_quat(commands.pose[rows, 3:]) * problem.robot.length
        place = np.concatenate([commands.pose[rows, :3], turn], axis=1)
    tree = spatial.cKDTree(place)
    _distance, index = tree.query(place, k=min(4, len(rows)))
    pairs = set()
    for a, neighbours in enumerate(np.atleast_2d(index)):
        for b in neighbours:
            if b != a and abs(int(rows[b]) - int(rows[a])) > 1:
                pairs.add((min(a, int(b)), max(a, int(b))))
                break
    return np.array([(rows[a], rows[b]) for a, b in sorted(pairs)]).reshape(-1, 2)


def _runs_test(problem: Problem, table: Array) -> float:
    """Wald-Wolfowitz runs test of the signs, worst channel of all runs, Bonferroni."""
    smallest, tests = 1.0, 0
    index = problem.data.run_index
    for name in np.unique(index):
        part = table[(index == name) & problem.use]
        for column in part.T:
            signs = np.sign(column[np.isfinite(column)])
            up, down = int((signs > 0).sum()), int((signs < 0).sum())
            if up < 4 or down < 4:
                continue
            tests += 1
            count = 1 + int((signs[1:] != signs[:-1]).sum())
            n = up + down
            mean = 1 + 2 * up * down / n
            variance = (mean - 1) * (mean - 2) / (n - 1)
            smallest = min(smallest, float(stats.norm.cdf((count - mean) / np.sqrt(variance))))
    return min(1.0, smallest * max(tests, 1))


def estimate_sigma(problem: Problem, raw: Array) -> tuple[Problem, tuple[str, ...]]:
    """Fill in noise that nobody stated, from how much neighbours along a run differ.

    Third differences of residuals along a run hold almost none of a smooth model error but
    all of the noise (times sqrt(20)); the median keeps jumps out.
    """
    sigma, notes = problem.sigma, []
    for kind in kinds_read(problem):
        if getattr(sigma, kind.sigma) is not None:
            continue
        value = _by_differences(problem, raw[:, kind.columns])
        sigma = replace(sigma, **{kind.sigma: value})
        notes.append(
            f"{kind.sigma} is not stated: estimated from differences between neighbouring rows as "
            f"{value:.2g} {kind.si}"
        )
    return problem.with_sigma(sigma), tuple(notes)


def _by_differences(problem: Problem, raw: Array) -> float:
    index = problem.data.run_index
    pieces = []
    for name in np.unique(index):
        part = raw[(index == name) & problem.use]
        if len(part) >= 4:
            pieces.append(np.abs(np.diff(part, n=3, axis=0)).ravel() / np.sqrt(20.0))
    every = np.concatenate(pieces) if pieces else np.abs(raw[problem.use]).ravel()
    every = every[np.isfinite(every)]
    return max(float(np.median(every)) / 0.6745, 1e-12) if len(every) else 1.0
