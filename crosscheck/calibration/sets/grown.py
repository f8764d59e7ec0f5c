"""Sets that grow member by member from exact fits, where the fit of all effects misleads.

The fit of all effects may end in a local minimum: outliers hold it there, or one large nonlinear
effect that is missing. Linear evidence about it then leads nowhere near the sets that explain most.
Grown one by one, each member is chosen by linear evidence about a fit that is exact.
"""

from __future__ import annotations

from crosscheck.calibration.sets.exact import Exact, Refit

# Effects from which sets grow, members tried in each step, and most members.
_FROM, _TRIED, _MOST = 2, 4, 7
# A member is added if it raises the ln evidence by as much.
_LEAST = 3.0


def grown(exact: Exact) -> Refit:
    """The best of all sets after the best single effects have grown."""
    none = exact.fitted[frozenset(exact.plain.terms.names)]
    if none is None:
        return exact.best
    scores = exact.scores_about(none.joint)
    names = [name for name in exact.catalogue.names if name not in none.names]
    alone = exact.fit_all(scores, [none.names | {name} for name in names])
    begun = [one for one in alone if one is not None and exact.can_be(one)]
    for one in sorted(begun, key=lambda one: -one.score)[:_FROM]:
        _grow(exact, one)
    return exact.best


def _grow(exact: Exact, here: Refit) -> None:
    """Fit larger and larger sets, as long as they can still become better than the best."""
    always = frozenset(exact.plain.terms.names)
    while (left := _MOST - len(here.names - always)) > 0:
        scores = exact.scores_about(here.joint)
        larger = [here.names | {name} for name in exact.catalogue.names if name not in here.names]
        tried = sorted(larger, key=lambda names: (-scores.score(names), sorted(names)))[:_TRIED]
        fits = [fit for fit in exact.fit_all(scores, tried) if fit is not None]
        top = max(filter(exact.can_be, fits), key=lambda fit: fit.score, default=here)
        gain = top.score - here.score
        if gain < _LEAST or top.score + gain * (left - 1) < exact.best.score:
            return
        here = top
