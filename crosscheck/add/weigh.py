"""Judges what effects fitted to data are worth, and how well their values are known."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import special

from crosscheck.add.result import Addition
from crosscheck.comparison.noise import coloured_noise
from crosscheck.fit.problem import Rms, rms_by_kind
from crosscheck.fit.residual_noise import whiteness
from crosscheck.fit.state import contradictions
from crosscheck.inference.catalogue import About, Catalogue, name_of
from crosscheck.inference.fit import Fit, unfitted
from crosscheck.inference.held_out import hold_out, improves, pays
from crosscheck.inference.priors import FALSE_ALARM, SURE
from crosscheck.model.fitted import Fitted
from crosscheck.model.write import provenance_of, renewed, with_fit
from seecr.counted import some
from seecr.description.robot import Robot
from seecr.effects import Terms
from seecr.pose import Array
from seecr.prediction.model import Model

_MOST_NAMED = 4
# A value of more expected sizes than this needs a check.
_IMPLAUSIBLE = 5.0
# Parameters with a larger correlation than this can hardly be determined separately.
_CORRELATED = 0.95
# What is less probable is outside an interval of 95 % whatever it does to a value.
MATTERS = 1.0 - SURE


def weigh(
    best: Fit, base: Fit, terms: Terms, names: Sequence[str], notes: Sequence[str], basis: Model
) -> Addition:
    """Judge what the named effects are worth in the best fit, against ``base`` without them."""
    problem = best.data.problem
    far = best.outlying
    if far.any():
        best, base = best.with_far_off(far), base.with_far_off(far)
        lines = problem.data.lines_of(far)
        notes = [*notes, f"outliers, given little weight and not included in these errors: {lines}"]
        problem = best.data.problem
    without, held = hold_out(base), hold_out(best)
    own = np.isin([effect for effect, _key in best.terms.labels], list(names))
    near = best.state.white[~far[problem.row_of]]
    white = whiteness(problem.only(~far), near, int(best.seen.sum()))
    factor = best.data.factor
    coloured = None if white.is_noise else coloured_noise(problem, best.state, factor)
    noise = white.is_noise or (coloured is not None and not coloured.open)
    about = About(Catalogue.of(best.data, best.terms), best)
    moved = spread_by_others(about, chances := chances_beside(about))
    covariance = _no_wider(best.terms, best.covariance + moved)
    stderr, parts = np.sqrt(np.diag(covariance)), [(t, best.terms.part(t.name)) for t in best.terms]
    fitted = tuple(Fitted(t, stderr[part], best.at_bound[part]) for t, part in parts)
    drop = best.metric.power(base.left) - best.metric.power(best.left)
    p = float(special.chdtrc(max(int((best.seen & own).sum()), 1), max(drop, 0.0)))
    distance, count = distance_from_nothing(best.terms, covariance, own)
    stood = unfitted(best.data, terms)
    before, after = rms_by_kind(problem, stood.state.raw), rms_by_kind(problem, best.state.raw)
    errors = {"before": before, "after": after, "held_out": held.rms}
    return Addition(
        names=tuple(names),
        fitted=fitted,
        before=before,
        after=after,
        held_out_before=without.rms,
        held_out=held.rms,
        fall=improves(without, held),
        p=p,
        predicts=pays(without, held) and p < FALSE_ALARM,
        from_nothing=distance,
        is_nothing=is_nothing(distance, count),
        whiteness=white,
        coloured=coloured,
        warnings=(
            *(text for f in fitted for text in _warnings_of(problem.robot, f)),
            *_together(best, own),
            *_widened(noise, chances, bool(np.any(own & (np.sqrt(np.diag(moved)) > best.stderr)))),
        ),
        notes=tuple(dict.fromkeys(notes)),
        model=_model(best, basis, fitted, names, errors, covariance),
    )


def spread_by_others(about: About, chances: Mapping[str, float]) -> Array:
    """Covariance (p, p) of how far a fit's values are from those of models with one effect more.

    The errors of a fit hold if just its effects are missing. A heavier platform beside a wrong
    length takes a part of what the length explains: if the data leave it a chance of 30 %, the
    length is known no better than the two models agree on it (Hoeting et al. 1999).

    Args:
        about: what further members do about the fit. chances: the probability of each.
    """
    moves = np.zeros((1, len(about.fit.terms)))
    for key, p in chances.items():
        if p > MATTERS and key in about.columns:
            moves = np.vstack([moves, np.sqrt(p) * about.moves(key)[1]])
    return np.asarray(moves.T @ moves)


def chances_beside(about: About) -> dict[str, float]:
    """The probability of each further effect beside a fit, at most one, by the linear model."""
    every, nothing = about.every, about.every.log_prior(frozenset())
    keys = [key for key in about.columns if key in about.promises]
    odds = [about.promises[k] + every.log_prior(frozenset({k})) - nothing for k in keys]
    total = np.logaddexp.reduce([0.0, *odds])
    return {key: float(np.exp(one - total)) for key, one in zip(keys, odds, strict=True)}


def _model(
    best: Fit, basis: Model, fitted: Sequence[Fitted], names: Sequence[str],
    errors: Mapping[str, Rms], covariance: Array,
) -> Model:  # fmt: skip
    """The new model; effects that neither it had nor ``names`` has are new as well."""
    problem = best.data.problem
    source = provenance_of(problem.data.name, f"crosscheck add {' + '.join(names)}")
    fresh = [f.term.name for f in fitted if f.term.name not in (*basis.names, *names)]
    new = with_fit(basis, fitted, [*names, *fresh], source, errors, best.with_idle(covariance))
    return renewed(new, problem.robot, problem.data)


def _no_wider(terms: Terms, covariance: Array) -> Array:
    """The covariance (p, p), no value less certain than it was measured independently."""
    stderr = np.sqrt(np.diag(covariance))
    wide = terms.knowledge.measured & (stderr > terms.knowledge.stderr)
    shrink = np.ones(len(stderr))
    shrink[wide] = terms.knowledge.stderr[wide] / stderr[wide]
    return np.asarray(covariance * np.outer(shrink, shrink))


def _warnings_of(robot: Robot, f: Fitted) -> Iterator[str]:
    """Warnings about one effect's values."""
    name, names = f.term.name, np.array(f.term.layout.names)
    yield from contradictions([f.term])
    unseen, stopped = ~np.isfinite(f.stderr), np.asarray(f.at_bound, bool)
    if stopped.any():
        yield f"{name}: {some(names[stopped])} stopped at a bound"
    if (unseen & ~stopped).any():
        yield f"{name}: {some(names[unseen & ~stopped])} not determined by these data"
    if not f.term.is_possible(robot):
        yield (f"{name}: no robot can have these values, so something else acts like this effect")
    size = np.abs(f.term.sizes)
    large = (size > _IMPLAUSIBLE) & ~f.term.layout.shape
    if large.any():
        whose = (
            "their expected sizes: check them" if large.sum() > 1 else "its expected size: check it"
        )
        verb = "is" if large.sum() == 1 else "are up to"
        most = f"{size[large].max():.3g} times {whose} on the robot"
        yield f"{name}: {some(names[large].tolist())} {verb} {most}"


def _widened(noise: bool, chances: Mapping[str, float], wider: bool) -> Iterator[str]:
    """That standard errors are wider because another effect may be missing as well."""
    if not wider:
        return
    likely = max(chances, key=lambda key: chances[key])
    why = f"{name_of(likely)} may be missing as well" if noise else "the residuals are not noise"
    yield (
        f"{why}: the standard errors include by how much another missing effect may shift these "
        "values; crosscheck diagnose searches for it"
    )


def _together(best: Fit, own: NDArray[np.bool_]) -> list[str]:
    """Warnings about parameters that can hardly be told from those of another effect."""
    labels = [".".join(label) for label in best.terms.labels]
    table = np.abs(best.correlation)
    pairs = [
        (float(table[i, j]), i, j)
        for i in np.flatnonzero(own).tolist()
        for j in np.flatnonzero(~own).tolist()
        if table[i, j] > _CORRELATED
    ]
    return [
        (
            f"{labels[i]} and {labels[j]} are strongly correlated ({c:.3f}): these data hardly "
            "separate them"
        )
        for c, i, j in sorted(pairs, reverse=True)[:_MOST_NAMED]
    ]


def distance_from_nothing(
    terms: Terms, covariance: Array, own: NDArray[np.bool_]
) -> tuple[float, int]:
    """Distance of parameters from null, together, in standard errors, and how many are in it.

    Shapes, fixed values and unidentifiable parameters (inf in the covariance) do not count. The
    distance is infinite if no parameter was free.
    """
    shape = np.concatenate([term.layout.shape for term in terms])
    free = own & ~shape & ~terms.knowledge.fixed
    if not free.any():
        return float("inf"), 0
    seen = np.flatnonzero(free & np.isfinite(np.diag(covariance)) & (np.diag(covariance) > 0.0))
    if not len(seen):
        return 0.0, 1
    scale = terms.scale[seen]
    z = (terms.vector - terms.null)[seen] / scale
    part = covariance[np.ix_(seen, seen)] / np.outer(scale, scale)
    squared = float(z @ np.linalg.pinv(part, hermitian=True) @ z)
    return float(np.sqrt(max(squared, 0.0))), len(seen)


def is_nothing(distance: float, count: int) -> bool:
    """Whether so many values are no further from null than chance takes one within its error."""
    if not np.isfinite(distance):
        return False
    return bool(special.chdtr(count, distance**2) <= special.chdtr(1, 1.0))
