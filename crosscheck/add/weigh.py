"""Judges what effects fitted to data are worth, and how well their values are known."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from crosscheck.add.result import Addition
from crosscheck.comparison.coloured import coloured_noise
from crosscheck.errors import UnsolvedError
from crosscheck.fit.effects.candidates import null_fit, seen_directions
from crosscheck.fit.effects.contradictions import contradictions
from crosscheck.fit.effects.evidence import FALSE_ALARM, p_value
from crosscheck.fit.effects.gauss_newton import Fit, fit
from crosscheck.fit.effects.held_out import HeldOut, hold_out, improves, pays, unfitted
from crosscheck.fit.effects.nothing import distance_from_nothing, is_nothing
from crosscheck.fit.effects.systematic import moved_together
from crosscheck.fit.least_squares.known import firmer
from crosscheck.fit.least_squares.problem import Problem, Rms, rms_by_kind
from crosscheck.fit.least_squares.state import evaluate
from crosscheck.fit.noise.whiteness import Whiteness, whiteness
from crosscheck.model.fitted import Fitted
from crosscheck.model.write import provenance_of, renewed, with_fit
from seecr.counted import counted, some
from seecr.description.robot import Robot
from seecr.effects import Terms
from seecr.pose import Array
from seecr.prediction.model import Model

# A value of more plausible sizes than this needs a check.
_IMPLAUSIBLE = 5.0
# Parameters with a larger correlation than this can hardly be determined separately.
_CORRELATED = 0.95
_MOST_NAMED = 4
# Held-out runs are not predicted better than they are fitted, except by chance. If their chi2 is
# below this part of the fit's, the fit has ended in a local minimum.
_HOLLOW = 0.9


def weigh(
    problem: Problem, terms: Terms, names: Sequence[str], factor: Array, best: Fit,
    notes: Sequence[str], basis: Model, firmness: float = 1.0,
) -> Addition:  # fmt: skip
    """Judge what the named effects are worth in the best fit, against the model without them.

    Args:
        problem: the data. terms: effects before. names: of the new ones. factor: of the noise.
        best: the fit with all of them. notes: about the data. basis: the model to write into.
        firmness: by how much independently measured values were made firmer for this fit
            (:func:`crosscheck.fit.least_squares.known.firmer`).

    Raises:
        UnsolvedError: the fit did not converge, or ended in a local minimum.
    """
    base = base_of(problem, terms, names, factor)
    some_left = any(name not in names for name in terms.names)
    without = hold_out(problem, base, factor) if some_left else unfitted(problem, base)
    best, held = _out_of_hollows(problem, factor, best)
    _refuse_unsettled(problem, names, best, held)
    own = np.isin([effect for effect, _key in best.terms.labels], list(names))
    white = whiteness_of(problem, best)
    coloured = None if white.is_noise else coloured_noise(problem, best.state, factor)
    noise = white.is_noise or (coloured is not None and not coloured.open)
    # standard errors are too small if the noise is larger than stated or autocorrelated, and also
    # if another effect is still missing
    moved = np.zeros_like(best.covariance) if noise else moved_together(problem, best)
    inflation = max(white.inflation, firmness)
    known = firmer(best.terms, 1.0 / firmness)
    covariance = _no_wider(known, inflation**2 * best.covariance + moved)
    fitted = _split(known, best, np.sqrt(np.diag(covariance)))
    # autocorrelated noise looks like an effect more easily than white noise of its size
    larger = max(1.0, white.scale) if coloured is None else white.inflation
    drop = (base.chi2 - best.chi2) / larger**2
    p = p_value(drop, seen_directions(best, own), False)
    distance, count = distance_from_nothing(best.terms, covariance, own)
    before, after = (
        rms_by_kind(problem, evaluate(problem, terms, factor).raw),
        rms_by_kind(problem, best.state.raw),
    )
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
            *_warnings(problem.robot, best, fitted, own),
            *_widened(best, np.sqrt(np.diag(moved)), own),
        ),
        notes=tuple(dict.fromkeys(notes)),
        model=_model(problem, basis, fitted, names, errors, best.with_idle(covariance)),
    )


def _model(
    problem: Problem, basis: Model, fitted: Sequence[Fitted], names: Sequence[str],
    errors: Mapping[str, Rms], covariance: Array,
) -> Model:  # fmt: skip
    """The new model; effects that neither it had nor ``names`` has are new as well."""
    source = provenance_of(problem.data.name, f"crosscheck add {' + '.join(names)}")
    fresh = [f.term.name for f in fitted if f.term.name not in (*basis.names, *names)]
    new = with_fit(basis, fitted, [*names, *fresh], source, errors, covariance)
    return renewed(new, problem.robot, problem.data)


def base_of(problem: Problem, terms: Terms, names: Sequence[str], factor: Array) -> Fit:
    """The model without the named effects, refitted."""
    rest = Terms(term for term in terms if term.name not in names)
    base = null_fit(problem, rest, factor, refit=bool(rest))
    if not base.valid:
        why = base.status.value
        raise UnsolvedError(f"{problem.data.path}: the model without {' + '.join(names)}: {why}")
    return base


def _out_of_hollows(problem: Problem, factor: Array, best: Fit) -> tuple[Fit, HeldOut]:
    """The fit and its held-out errors; if these hint at a local minimum, refitted from a fold."""
    held = hold_out(problem, best, factor)
    if not _hollow(best, held):
        return best, held
    k = int(np.argmin(held.chi2 / np.maximum(held.readings, 1.0)))
    other = fit(problem, best.terms.with_vector(held.values[k]), factor, best.state)
    if not (other.valid and other.chi2 < best.chi2):
        return best, held
    return other, hold_out(problem, other, factor)


def _hollow(best: Fit, held: HeldOut) -> bool:
    return held.valid and float(held.chi2.sum()) < _HOLLOW * best.chi2


def _refuse_unsettled(problem: Problem, names: Sequence[str], best: Fit, held: HeldOut) -> None:
    if best.valid and best.settled and not _hollow(best, held):
        return
    why = "ended in a local minimum: held-out runs are predicted better than they are fitted"
    if not best.valid:
        why = f"failed, as {best.status.value}"
    elif not best.settled:
        why = f"did not converge in {counted(best.iterations, 'step')}"
    raise UnsolvedError(
        f"{problem.data.path}: the fit of {' + '.join(names)} {why}; nothing was added: find what "
        "else is missing with crosscheck diagnose, or fix known values in the model"
    )


def whiteness_of(problem: Problem, found: Fit) -> Whiteness:
    """Test the residuals of a fit."""
    return whiteness(problem, found.state.white, int(np.sum(np.isfinite(found.stderr))))


def _no_wider(terms: Terms, covariance: Array) -> Array:
    """The covariance (p, p), no value less certain than it was measured independently."""
    stderr = np.sqrt(np.diag(covariance))
    wide = terms.knowledge.measured & (stderr > terms.knowledge.stderr)
    shrink = np.ones(len(stderr))
    shrink[wide] = terms.knowledge.stderr[wide] / stderr[wide]
    return np.asarray(covariance * np.outer(shrink, shrink))


def _split(terms: Terms, best: Fit, stderr: Array) -> tuple[Fitted, ...]:
    parts = [(term, terms.part(term.name)) for term in terms]
    return tuple(Fitted(t, stderr[own], best.at_bound[own]) for t, own in parts)


def _warnings(
    robot: Robot, best: Fit, fitted: Sequence[Fitted], own: NDArray[np.bool_]
) -> list[str]:
    return [*(text for f in fitted for text in _warnings_of(robot, f)), *_together(best, own)]


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
            "their plausible sizes: check them"
            if large.sum() > 1
            else "its plausible size: check it"
        )
        yield (f"{name}: {_are(names[large])} {size[large].max():.3g} times {whose} on the robot")


def _are(names: NDArray[np.str_]) -> str:
    """Parameters as the subject of a sentence about their largest number, with its verb."""
    return f"{some(names.tolist())} {'is' if len(names) == 1 else 'are up to'}"


def _widened(best: Fit, moved: Array, own: NDArray[np.bool_]) -> list[str]:
    """A warning if standard errors are mostly due to effects that may still be missing."""
    if not np.any(own & (moved > best.stderr)):
        return []
    return [
        "the residuals are not noise: the standard errors include by how much another missing "
        "effect may shift these values; crosscheck diagnose searches for it"
    ]


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
