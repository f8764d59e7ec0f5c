"""A hypothesis that was fitted, and its score: Laplace evidence about its own fit, plus ln prior.

H = (S, f): a set S of members of the catalogue and at most one field f, with noise of its own.

    ln p(H, y) = ln N(y; 0, X L X^T + mu^2 F F^T + Sigma)    averaged over the widths L and mu
               + what the mixture for outliers adds           (variational bound)
               + ln p(noise scale) + ln p(S) + ln p(f)
               + ln of the share of its prior to which each shape is determined
               + ln of what parameters stopped at zero might have been
               - 1/2 (what the linear model would still gain where the fit ended)

(MacKay, Neural Computation 4, 1992, for evidence at an optimum.) All hypotheses of one search
differ from these by the same constant.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from crosscheck.fit.algebra import inverse_of, solved
from crosscheck.fit.state import can_be
from crosscheck.inference.about import AmplitudeColumns, linear_of, log_shares
from crosscheck.inference.catalogue import Catalogue, Key, is_field
from crosscheck.inference.evidence import Linear, best_widths, log_evidence, log_gain
from crosscheck.inference.fit import Fit
from crosscheck.inference.noise import NoisePrior, log_det
from crosscheck.inference.priors import EQUAL, WIDTHS, WITHIN
from seecr.pose import Array

# The widths that maximise the evidence count only if the optimum with them loses less ln posterior
# at the fit than this: the linear model holds about the fit alone.
_NEAR = 8.0


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A fitted hypothesis.

    Attributes:
        key: its members. fit: its fit.
        widths: prior width of each member. score: ln evidence plus ln prior.
        possible: whether a robot can have its values.
        wanted: prior widths that promise far more evidence, if these would move the fit: it is
            fitted again with them. Of many small values wide priors cost that much.
    """

    key: Key
    fit: Fit
    widths: dict[str, float]
    score: float
    possible: bool
    wanted: dict[str, float] | None = None

    @property
    def field(self) -> str | None:
        """The key of its field."""
        return next((k for k in self.key if is_field(k)), None)


def scored(every: Catalogue, key: Key, fit: Fit, widths: Mapping[str, float]) -> Hypothesis:
    """A fit with these prior widths as a hypothesis, linearised about its own optimum."""
    linear, z = _own_linear(every, key, fit)
    held = {k: widths.get(k, group.middle) for k, group in linear.groups.items()}
    best = best_widths(linear, held)
    field = next((k for k in key if is_field(k)), None)
    if field is not None and field in best.chosen:
        z[linear.groups[field].columns] = best.values[best.place(field)]
    wanted = None
    if best.left_to_gain(z) > _NEAR:
        own = linear.solved(held)
        if log_evidence(best) > log_evidence(own) + WITHIN:
            wanted = {**widths, **best.chosen}
        best = own
    stood = every.stood_keys
    score = (
        log_evidence(best) + sum(log_shares(fit).values()) + _log_absent(every, fit, best.chosen)
    )
    score -= 0.5 * (fit.state.log_det + log_det(fit.data.chain, fit.noise) + _left_to_gain(fit))
    score += fit.log_outliers + NoisePrior.of(fit.data.problem).log(fit.noise)
    robot = fit.data.problem.robot
    possible = key == stood or can_be(robot, fit.terms, every.stood)
    chosen, score = {**widths, **best.chosen}, score + every.log_prior(key)
    return Hypothesis(key, fit, chosen, score, possible, wanted)


def wider(every: Catalogue, one: Hypothesis) -> dict[str, float]:
    """The widths of greatest evidence about a fit, none below an expected size.

    An expected size may be ten times too small; odds of twenty to one say so. Of many effects that
    can stand for each other the evidence would also narrow those that it has no use for, and call
    their values certain.
    """
    linear, _z = _own_linear(every, one.key, one.fit)
    groups = {
        k: replace(group, widths=group.widths[group.widths >= min(1.0, group.widths.max())])
        for k, group in linear.groups.items()
    }
    held = {k: max(one.widths.get(k, 1.0), group.middle) for k, group in groups.items()}
    return best_widths(replace(linear, groups=groups), held, EQUAL).chosen


def _own_linear(every: Catalogue, key: Key, fit: Fit) -> tuple[Linear, Array]:
    """Normal equations of a fit's own amplitudes and field, and their values in it."""
    keys, members = every.keys_of(fit.terms), dict[str, AmplitudeColumns]()
    for term in fit.terms:
        at = np.flatnonzero(fit.terms.own(term.name))
        own = fit.free[at] & ~term.layout.shape
        if own.any():
            x, z = fit.jacobian[:, at[own]], fit.z[at[own]]
            members[keys[term.name]] = AmplitudeColumns(term, own, x, z)
    return linear_of(fit, members, {k: every.fields[k] for k in key if is_field(k)})


def _left_to_gain(fit: Fit) -> float:
    """How much further the objective would fall if the model were linear.

    It is next to nothing where a fit converged, unless its derivatives point the wrong way: the sag
    of a cable grows with the square of its weight.
    """
    free = np.flatnonzero(fit.free)
    if not len(free):
        return 0.0
    normal, gradient = fit.equations
    inverse2 = fit.width[free] ** -2.0
    slope = gradient[free] - fit.z[free] * inverse2
    return float(slope @ solved(normal[np.ix_(free, free)] + np.diag(inverse2), slope))


# --- parameters that are stopped at zero ----------------------------------------------------------


def _log_absent(every: Catalogue, fit: Fit, widths: Mapping[str, float]) -> float:
    """ln evidence that parameters stopped at zero cost beside the others; never above 0.

    Friction on a cable behind the exit point, with zero friction, is that cable alone. If both had
    the same evidence, then data that would show friction, and show none, could not tell them apart.
    """
    terms, keys = fit.terms, every.keys_of(fit.terms)
    shape = np.concatenate([np.zeros(0, bool), *(t.layout.shape for t in terms)])
    held = (terms.vector <= terms.lower) & (terms.lower == terms.null) & ~shape
    held = np.flatnonzero(held & ~terms.knowledge.fixed & (fit.width > 0.0))
    if not len(held):
        return 0.0
    free = np.flatnonzero(fit.free)
    owners = np.array([keys[name] for name, _key in terms.labels])
    wide = np.array(
        [widths.get(owners[k], fit.width[k]) if not shape[k] else fit.width[k] for k in free]
    )
    both = np.concatenate([free, held])
    n, (normal, gradient) = len(free), fit.equations
    # those at zero as they would be if all that the others do were still to be explained
    gradient = (gradient + normal[:, free] @ fit.z[free])[both]
    normal = normal[np.ix_(both, both)]
    inverse = inverse_of(normal[:n, :n] + np.diag(wide**-2.0)) if n else np.zeros((0, 0))
    cross = normal[:n, n:]
    power = np.diag(normal)[n:] - np.sum(cross * (inverse @ cross), axis=0)
    # an optimum is pressed against the bound: what pulls away from it, the fit did not find
    along = np.minimum(gradient[n:] - cross.T @ (inverse @ gradient[:n]), 0.0)
    total = 0.0
    for k, p, a in zip(held, np.maximum(power, 0.0), along, strict=True):
        own = widths.get(owners[k])
        of = WIDTHS if own is None else [own]
        total += log_gain(np.array([[p]]), np.array([a]), of, one_sided=True)
    return total
