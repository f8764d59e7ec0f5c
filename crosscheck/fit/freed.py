"""Effects that are fitted before anything else: what the data alone can say of themselves.

Frames that were aligned to the commands have taken in a part of every error. The values that say
how they stand are therefore the data's own: fitted to them beside whatever else is, and of no use
to other data. So are the values of a file or run that the model has not seen, of an effect that
has its own for each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.gauss_newton import fit
from crosscheck.fit.parts import LaidOut
from crosscheck.fit.problem import Problem
from crosscheck.fit.registration import NAME as TRACKER
from crosscheck.fit.registration import registered_each
from crosscheck.fit.state import State, evaluate
from crosscheck.fit.words import measured
from crosscheck.units import parameter_name
from seecr.effects import ApartLayout, Term, Terms, apart, effect_named, layout_of
from seecr.pose import Array

__all__ = ["Freed", "freed"]


@dataclass(frozen=True, eq=False)
class Freed:
    """A model with what its data leave free.

    Attributes:
        terms: with the values that are best there. free: (p,) which were fitted.
        notes: a sentence about each effect.
    """

    terms: Terms
    free: NDArray[np.bool_]
    notes: tuple[str, ...] = ()


def freed(problem: Problem, laid: LaidOut) -> Freed:
    """The model with what its data leave free at the best values there.

    All other values stay.

    Args:
        problem: the data; :attr:`Measurements.free` names the effects.
        laid: effects of the model as it stands, and of which files or runs it knows nothing.
    """
    names, terms = problem.data.free, laid.terms
    if not (names or laid.fresh) or not problem.n_readings:
        return Freed(terms, np.zeros(len(terms), dtype=bool))
    own = [_new(problem, name) for name in names if name not in terms]
    every = Terms([*terms, *own])
    free = _free(every, names, laid.fresh)
    factor = problem.noise(problem.experiment.predict(every.effects))
    state = _registered(problem, every, factor, free)
    best = fit(problem, state.terms, factor, state, free=free)
    found = best.terms
    moved = free & ~found.knowledge.fixed
    # where the model misses something, values are no surer than it is right
    error = best.stderr * max(1.0, np.sqrt(best.state.chi2 / problem.n_readings))
    told = [_told(found, name, moved, error, problem, name in names) for name in found.names]
    return Freed(found, moved, tuple(filter(None, told)))


def _new(problem: Problem, name: str) -> Term:
    """An effect that the model has not; each of several files has its own."""
    layout, data = layout_of(effect_named(name), problem.robot), problem.data
    if data.files:
        files = data.free_in.get(name, range(len(data.files)))
        layout = apart(layout, "file", tuple(data.origins[k] for k in files), layout.null)
    return Term(layout, layout.null)


def _free(
    terms: Terms, names: Sequence[str], fresh: Sequence[tuple[str, str]]
) -> NDArray[np.bool_]:
    """(p,) the parameters that are free: of some effects all, of others of some files or runs."""
    free = np.array([effect in names for effect, _key in terms.labels], dtype=bool)
    for effect, part in fresh:
        layout = terms[effect].layout
        assert isinstance(layout, ApartLayout)
        own = np.arange(len(layout))[layout.part(part)]
        free[terms.part(effect).start + own] = True
    return free


def _registered(problem: Problem, terms: Terms, factor: Array, free: NDArray[np.bool_]) -> State:
    """The model as it stands, or with the tracker's frame turned and shifted where that is nearer.

    Gauss-Newton would have a long way from another frame.
    """
    stood = evaluate(problem, terms, factor)
    if TRACKER not in terms or not free[terms.part(TRACKER)].any():
        return stood
    term = terms[TRACKER]
    if term.knowledge.any:
        return stood
    mine = free[terms.part(TRACKER)]
    at_null = np.where(mine, term.layout.null, term.vector)
    plain = evaluate(problem, terms.with_term(term.with_vector(at_null)), factor, stood)
    frames = registered_each(problem, plain.prediction, term.with_vector(at_null), mine)
    turned = evaluate(problem, terms.with_term(frames), factor, plain)
    return min(stood, turned, key=lambda state: state.chi2)


def _told(
    terms: Terms, name: str, moved: NDArray[np.bool_], error: Array, problem: Problem, by_toml: bool
) -> str:
    """What an effect was found to be; "" where it was not fitted."""
    term, mine = terms[name], moved[terms.part(name)]
    if not (mine.any() or by_toml):
        return ""
    layout = term.layout
    errors = np.where(mine, error[terms.part(name)], 0.0)
    values = zip(layout.names, layout.units, term.vector, errors, mine, strict=True)
    words = ", ".join(
        f"{parameter_name(key, unit)} {measured(v, e, unit)}" for key, unit, v, e, own in values
        if own or by_toml
    )  # fmt: skip
    why = f" is free, as the TOML beside {problem.data.name} says, and" if by_toml else ""
    return f"{name}{why} was fitted to these data first: {words}"
