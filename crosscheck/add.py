"""Fit an effect to measurements, together with those a model has, and say what it is worth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.errors import CrosscheckError, UnsolvedError
from crosscheck.fit.candidates import (
    Trials,
    candidates_for,
    null_fit,
    seen_directions,
    try_candidate,
)
from crosscheck.fit.evidence import FALSE_ALARM, p_value
from crosscheck.fit.gauss_newton import Fit, fit
from crosscheck.fit.held_out import hold_out, improves, pays, unfitted
from crosscheck.fit.noise import Whiteness, whiteness
from crosscheck.fit.prepare import Progress, outlying_rows, prepare
from crosscheck.fit.problem import Problem, Rms, rms_by_kind
from crosscheck.fit.reasons import Why
from crosscheck.fit.state import evaluate
from crosscheck.fit.words import rms_words, value_lines, value_records
from crosscheck.given import GivenModel, GivenRobot, model_of, robot_of
from crosscheck.measurements.read import GivenData, measurements_of
from crosscheck.model.write import Fitted
from seecr.effects import Terms, effect_named, layout_of
from seecr.effects.base import Layout
from seecr.pose import Array
from seecr.result import Record, Result

# A value this many plausible sizes from null deserves a second look.
_IMPLAUSIBLE = 5.0
# Parameters whose errors go together like this are hardly determined apart.
_CORRELATED = 0.95
_MOST_NAMED = 4


@dataclass(frozen=True, eq=False, repr=False)
class Addition(Result):
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
    def terms(self) -> Terms:
        """All effects of the new model with their values, as a model for the next call."""
        return Terms(one.term for one in self.fitted)

    def lines(self) -> list[str]:
        """Errors without and with the effect, the values, and what speaks against them."""
        worth = "pays" if self.pays else "does not pay"
        left = rms_words(self.held_out_before), rms_words(self.held_out)
        out = [
            f"{self.name} {worth} on runs left out: {left[0]} before, {left[1]} with it",
            f"on all rows: {rms_words(self.before)} before, {rms_words(self.after)} with it",
        ]
        for one in self.fitted:
            values = value_lines(one.term.layout, one.term.vector, one.stderr, one.at_bound)
            out += [f"{one.term.name}: {line}" for line in values]
        out += [f"warning: {warning}" for warning in self.warnings]
        return [*out, *(f"note: {note}" for note in self.notes)]

    def records(self) -> list[Record]:
        """A record for each parameter of the new model: value and standard error, SI."""
        return [
            record
            for one in self.fitted
            for record in value_records(one.term.layout, one.term.vector, one.stderr, one.at_bound)
        ]

    def as_json(self) -> dict[str, Any]:
        """The content of ``add.json``, in SI."""
        return {
            "effect": self.name,
            "effects": {f.term.name: f.as_json() for f in self.fitted},
            "before": dict(self.before),
            "after": dict(self.after),
            "held_out_before": dict(self.held_out_before),
            "held_out": dict(self.held_out),
            "improves_held_out": self.pays,
            "p": self.p,
            "chi2_fall_a_block": self.fall[0],
            "chi2_fall_stderr": self.fall[1],
            "is_noise": self.whiteness.is_noise,
            "residual": vars(self.whiteness),
            "warnings": list(self.warnings),
            "notes": list(self.notes),
        }

    @property
    def own(self) -> Fitted:
        """The effect itself."""
        return next(f for f in self.fitted if f.term.name == self.name)


def add_effect(
    robot: GivenRobot,
    data: GivenData,
    name: str,
    model: GivenModel = (),
    progress: Progress = lambda _text, _part: None,
) -> Addition:
    """Fit an effect to data, jointly with those the model has.

    Args:
        robot: as described, or its MJCF.
        data: measurements, or their file.
        name: of the effect.
        model: effects of the model, or their file; where the named one is among them it is
            fitted again. The plain model without.
        progress: called with what is being done and the part of it that is done.

    Raises:
        InputError: no effect of that name.
        CrosscheckError: the data cannot carry it.
    """
    robot = robot_of(robot)
    layout = layout_of(effect_named(name), robot)
    data = measurements_of(data, robot)
    terms, said = model_of(model, robot)
    ready = prepare(robot, data, terms)
    problem, notes = ready.problem, [*said, *ready.all_notes]
    if ready.refusal is not None:
        kind = UnsolvedError if ready.refusal.unsolved else CrosscheckError
        raise kind(f"{data.path}: {ready.refusal}; {name} was not fitted")
    _refuse(problem, layout)
    progress(f"fitting {name}", 0.0)
    plain = problem.experiment.predict(terms.effects)
    factor = problem.noise(plain)
    best = _fitted(problem, terms, layout, factor)
    progress("looking for outliers", 0.4)
    outliers = outlying_rows(problem, best.state)
    if outliers.any():
        lines = data.places(outliers)
        word = "line" if outliers.sum() == 1 else "lines"
        words = f"{word} {lines} left out: outliers, far off the others"
        notes.append(words)
        problem = problem.without(outliers, words)
        best = _fitted(problem, terms, layout, factor)
    progress("predicting runs left out", 0.6)
    return _weigh(problem, terms, layout, factor, best, notes)


def _refuse(problem: Problem, layout: Layout) -> None:
    reason = next(c.why_not for c in candidates_for(problem) if c.name == layout.name)
    if reason is not None:
        raise CrosscheckError(f"{problem.data.path} cannot carry {layout.name}: {reason.words}")


def _base(problem: Problem, terms: Terms, layout: Layout, factor: Array) -> Fit:
    """The model without the effect, at its own best."""
    rest = terms.without(layout.name)
    base = null_fit(problem, rest, factor, refit=bool(rest))
    if not base.valid:
        why = base.status.value
        raise UnsolvedError(f"{problem.data.path}: the model without {layout.name}: {why}")
    return base


def _fitted(problem: Problem, terms: Terms, layout: Layout, factor: Array) -> Fit:
    """The best joint fit, from where the effect stands and from its most promising starts."""
    fits = [fit(problem, terms, factor)] if layout.name in terms else []
    if fits and fits[0].valid and terms[layout.name].knowledge.any:
        return fits[0]  # what is known of it says where it is
    base = _base(problem, terms, layout, factor)
    tried = try_candidate(Trials(problem, factor), base, layout)
    if tried.fit is not None:
        fits.append(fit(problem, tried.fit.terms, factor, tried.fit.state))
    good = [found for found in fits if found.valid]
    if not good:
        reason = tried.why_not
        unsolved = reason is None or reason.why is Why.UNSOLVED
        kind = UnsolvedError if unsolved else CrosscheckError
        why = reason or fits[0].status.value
        raise kind(f"{problem.data.path} cannot carry {layout.name}: {why}")
    return min(good, key=lambda found: found.chi2)


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
    without = hold_out(problem, base, factor) if rest else unfitted(problem, base)
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
