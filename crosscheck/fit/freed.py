"""Effects that stay free in every fit of some data: how its tracker stands was found from it.

Frames that were aligned to the commands have taken in a part of every error. The values that say
how they stand are therefore the data's own: fitted to them beside whatever else is, and of no use
to other data.
"""

from __future__ import annotations

import numpy as np

from crosscheck.fit.gauss_newton import fit
from crosscheck.fit.problem import Problem
from crosscheck.fit.registration import NAME as TRACKER
from crosscheck.fit.registration import registered
from crosscheck.fit.state import State, evaluate
from crosscheck.fit.words import shown
from crosscheck.units import parameter_name
from seecr.effects import Term, Terms, effect_named, layout_of
from seecr.pose import Array

__all__ = ["freed"]


def freed(problem: Problem, terms: Terms) -> tuple[Terms, tuple[str, ...]]:
    """The model with the effects that its data leave free, at their best values there.

    All other effects keep theirs.

    Args:
        problem: the data; :attr:`Measurements.free` names the effects.
        terms: effects of the model as it stands.

    Returns:
        the model, and a sentence about each of them.
    """
    names = problem.data.free
    if not names or not problem.n_readings:
        return terms, ()
    layouts = [layout_of(effect_named(name), problem.robot) for name in names]
    own = [Term(layout, layout.null) for layout in layouts if layout.name not in terms]
    every = Terms([*terms, *own])
    factor = problem.noise(problem.experiment.predict(every.effects))
    state = _registered(problem, every, factor)
    free = np.array([effect in names for effect, _key in every.labels])
    found = fit(problem, state.terms, factor, state, free=free)
    return found.terms, tuple(_told(found.terms[name], problem) for name in names)


def _registered(problem: Problem, terms: Terms, factor: Array) -> State:
    """The model as it stands, or with the tracker's frame turned and shifted where that is nearer.

    Gauss-Newton would have a long way from another frame.
    """
    stood = evaluate(problem, terms, factor)
    if TRACKER not in problem.data.free or terms[TRACKER].knowledge.any:
        return stood
    at_null = terms.with_term(Term(terms[TRACKER].layout, terms[TRACKER].layout.null))
    plain = evaluate(problem, at_null, factor, stood)
    frame = registered(problem, plain.prediction)
    if frame is None:
        return stood
    turned = evaluate(problem, terms.with_term(frame), factor, plain)
    return min(stood, turned, key=lambda state: state.chi2)


def _told(term: Term, problem: Problem) -> str:
    values = zip(term.layout.names, term.layout.units, term.vector, strict=True)
    words = ", ".join(f"{parameter_name(key, unit)} {shown(v, unit)}" for key, unit, v in values)
    return (
        f"{term.name} is free, as the TOML beside {problem.data.path.name} says, and was fitted to "
        f"these data first: {words}"
    )
