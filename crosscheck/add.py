"""Fit an effect to measurements, together with those a model has, and say what it is worth."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.errors import CrosscheckError
from crosscheck.fit.candidates import layouts_for, null_fit, seen_directions, try_candidate
from crosscheck.fit.evidence import FALSE_ALARM, p_value
from crosscheck.fit.gauss_newton import Fit, fit
from crosscheck.fit.held_out import hold_out, improves, pays, unfitted
from crosscheck.fit.noise import Whiteness, whiteness
from crosscheck.fit.prepare import Progress, outlying_rows, prepare
from crosscheck.fit.problem import Problem, Rms, rms_by_kind
from crosscheck.fit.state import evaluate
from crosscheck.measurements.data import Measurements
from crosscheck.model.write import Fitted
from seecr.effects import Terms, effect_named, layout_of
from seecr.effects.base import Layout
from seecr.pose import Array
from seecr.robot import Robot
from seecr.sensitivity import Term

# A value this many plausible sizes from null deserves a second look.
_IMPLAUSIBLE = 5.0
# Parameters whose errors go together like this are hardly determined apart.
_CORRELATED = 0.95
_MOST_NAMED = 4


class UnsolvedError(CrosscheckError):
    """Rows that have no equilibrium, so that nothing can be fitted."""

    exit_status = 3


@dataclass(frozen=True, eq=False)
class Addition:
    """An effect fitted to data, with the rest of the model.

    Attributes:
        name: of the effect.
        fitted: all effects of the new model with their errors.
        before: rms errors of the model as it stood. after: of the new one.
        held_out_before, held_out: the same on runs left out of the fit.
        fall: mean fall of chi2 on a block left out, and its standard error.
        p: chance of the fall of chi2 on all data where the effect is absent.
        pays: whether the effect improves what was left out, and not by chance.
        whiteness: of what is left.
        warnings: about the values. notes: about the data.
    """

    name: str
    fitted: tuple[Fitted, ...]
    before: Rms
    after: Rms
    held_out_before: Rms
    held_out: Rms
    fall: tuple[float, float]
    p: float
    pays: bool
    whiteness: Whiteness
    warnings: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def own(self) -> Fitted:
        """The effect itself."""
        return next(f for f in self.fitted if f.term.name == self.name)


def add_effect(
    robot: Robot,
    data: Measurements,
    terms: Iterable[Term],
    name: str,
    progress: Progress = lambda _text, _part: None,
) -> Addition:
    """Fit an effect to data, jointly with those the model has.

    Args:
        robot: as described.
        data: measurements.
        terms: effects of the model; where the named one is among them it is fitted again.
        name: of the effect.
        progress: called with what is being done and the part of it that is done.

    Raises:
        InputError: no effect of that name.
        CrosscheckError: the data cannot carry it.
    """
    layout = layout_of(effect_named(name), robot)
    model = Terms(terms)
    problem, notes, why = prepare(robot, data, model)
    if why:
        kind = UnsolvedError if not problem.n_readings or "equilibrium" in why else CrosscheckError
        raise kind(f"{data.path}: {why}; {name} was not fitted")
    _refuse(problem, layout)
    progress(f"fitting {name}", 0.0)
    plain = problem.experiment.predict(model.effects)
    factor = problem.noise(plain)
    best = _fitted(problem, model, layout, factor)
    progress("looking for outliers", 0.4)
    outliers = outlying_rows(problem, best.state)
    if outliers.any():
        lines = ", ".join(str(k) for k in data.line[outliers])
        word = "line" if outliers.sum() == 1 else "lines"
        words = f"{word} {lines} left out: outliers, far off the others"
        notes.append(words)
        problem = problem.without(outliers, words)
        best = _fitted(problem, model, layout, factor)
    progress("predicting runs left out", 0.6)
    return _weigh(problem, model, layout, factor, best, notes)


def _refuse(problem: Problem, layout: Layout) -> None:
    why = next(c.why_not for c in layouts_for(problem) if c.name == layout.name)
    if why:
        raise CrosscheckError(
            f"{problem.data.path} cannot carry {layout.name}: {why.removeprefix('no candidate: ')}"
        )


def _base(problem: Problem, terms: Terms, layout: Layout, factor: Array) -> Fit:
    """The model without the effect, at its own best."""
    rest = terms.without(layout.name)
    base = null_fit(problem, rest, factor, refit=bool(rest))
    if not base.valid:
        raise UnsolvedError(f"{problem.data.path}: the model without {layout.name}: {base.why}")
    return base


def _fitted(problem: Problem, terms: Terms, layout: Layout, factor: Array) -> Fit:
    """The best joint fit, from where the effect stands and from its most promising starts."""
    trials = []
    if layout.name in terms:
        trials.append(fit(problem, terms, factor))
    tried = try_candidate(problem, _base(problem, terms, layout, factor), layout, factor)
    if tried.fit is not None:
        trials.append(fit(problem, tried.fit.terms, factor, tried.fit.state))
    good = [t for t in trials if t.valid]
    if not good:
        why = tried.why_not or trials[0].why
        kind = UnsolvedError if "solved" in why else CrosscheckError
        raise kind(f"{problem.data.path} cannot carry {layout.name}: {why}")
    return min(good, key=lambda f: f.chi2)


def _weigh(
    problem: Problem,
    terms: Terms,
    layout: Layout,
    factor: Array,
    best: Fit,
    notes: list[str],
) -> Addition:
    base = _base(problem, terms, layout, factor)
    rest = terms.without(layout.name)
    without = hold_out(problem, base, factor) if rest else unfitted(problem, Terms(), base)
    held = hold_out(problem, best, factor)
    white = whiteness(problem, best.state.white, int(np.sum(np.isfinite(best.stderr))))
    stood = evaluate(problem, terms, factor)
    fall = improves(without, held)
    drop = (base.chi2 - best.chi2) / max(1.0, white.scale) ** 2
    p = p_value(drop, seen_directions(best, layout.name), False)
    # stated noise that is too small, or noise that goes together, makes standard errors too small
    fitted = _split(best, white.inflation)
    return Addition(
        name=layout.name,
        fitted=fitted,
        before=rms_by_kind(problem, stood.raw),
        after=rms_by_kind(problem, best.state.raw),
        held_out_before=without.rms,
        held_out=held.rms,
        fall=fall,
        p=p,
        pays=pays(without, held) and p < FALSE_ALARM,
        whiteness=white,
        warnings=tuple(_warnings(best, fitted, layout.name)),
        notes=tuple(dict.fromkeys(notes)),
    )


def _split(best: Fit, scale: float) -> tuple[Fitted, ...]:
    parts = [(term, best.terms.part(term.name)) for term in best.terms]
    return tuple(Fitted(t, best.stderr[own] * scale, best.at_bound[own]) for t, own in parts)


def _warnings(best: Fit, fitted: Sequence[Fitted], name: str) -> list[str]:
    out = []
    for f in fitted:
        names = np.array(f.term.layout.names)
        unseen, stopped = ~np.isfinite(f.stderr), np.asarray(f.at_bound, bool)
        if stopped.any():
            out.append(f"{f.term.name}: {_some(names[stopped])} ended on a bound")
        if (unseen & ~stopped).any():
            out.append(f"{f.term.name}: {_some(names[unseen & ~stopped])} not seen by these data")
        size = np.abs(f.term.sizes)
        large = (size > _IMPLAUSIBLE) & ~f.term.layout.shape
        if large.any():
            out.append(
                f"{f.term.name}: {_some(names[large])} is up to {size[large].max():.3g} times a "
                "plausible size: check it on the robot"
            )
    return out + _together(best, name)


def _together(best: Fit, name: str) -> list[str]:
    """Parameters of the effect that are hardly determined apart from those of another."""
    own, labels = best.terms.own(name), [".".join(label) for label in best.terms.labels]
    table = np.abs(best.correlation)
    pairs = [
        (float(table[i, j]), i, j)
        for i in np.flatnonzero(own).tolist()
        for j in np.flatnonzero(~own).tolist()
        if table[i, j] > _CORRELATED
    ]
    return [
        f"{labels[i]} and {labels[j]} are hardly determined apart (correlation {c:.3f})"
        for c, i, j in sorted(pairs, reverse=True)[:_MOST_NAMED]
    ]


def _some(names: Any) -> str:
    rest = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
    return ", ".join(names[:_MOST_NAMED]) + rest
