"""Fits the effects whose values belong to the data, before anything else is fitted.

A tracker frame that was aligned to the commands has absorbed a part of every error, so its values
mean nothing for other data. The same holds for an effect with separate values for each file or run,
if the model has not seen that file or run.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.problem import Problem
from crosscheck.fit.registration import NAME as TRACKER
from crosscheck.fit.registration import registered_each
from crosscheck.fit.state import State, evaluate
from crosscheck.inference.fit import FLAT, Data, Fit, fit, without_rows
from crosscheck.inference.noise import outliers
from crosscheck.measurements.data import Measurements
from seecr.counted import some
from seecr.effects import ApartLayout, Knowledge, Own, Term, Terms, Values, apart, layout_of
from seecr.pose import Array
from seecr.units import measured, parameter_name

# Effects with separate values for each file or run, laid out for those of some data. A model keeps
# the values of files or runs that it has seen; others start from the effect's common values.


Fresh = Sequence[tuple[str, str]]
"""Effects, each with a file or run for which the model has no values."""


def laid_out(data: Measurements, terms: Terms) -> tuple[Terms, Fresh, list[str]]:
    """The model, with separate values for the files or runs of the data where effects have them.

    Returns:
        The effects, which values are new, and notes on that.
    """
    out, fresh, notes = list[Term](), list[tuple[str, str]](), list[str]()
    for term in terms:
        if term.own is None or isinstance(term.layout, ApartLayout):
            out.append(term)
            continue
        names = tuple(dict.fromkeys(data.parts[term.own.kind].tolist()))
        known = {name: _known(term.own, name) for name in names}
        new = [name for name in names if known[name] is None]
        values = [known[name] or _unknown(term) for name in names]
        layout = apart(term.layout, term.own.kind, names, term.vector)
        vector = np.concatenate([one.vector for one in values])
        knowledge = Knowledge.joined([one.knowledge for one in values])
        out.append(Term(layout, vector, knowledge, term.own))
        fresh += [(term.name, name) for name in new]
        notes.append(_said_of_parts(term, term.own.kind, [n for n in names if n not in new], new))
    return Terms(out), fresh, notes


def groups_of(data: Measurements, terms: Terms) -> NDArray[np.int64] | None:
    """(n,) number of each row's file or run, if effects have separate values for these."""
    kinds = [term.layout.kind for term in terms if isinstance(term.layout, ApartLayout)]
    if not kinds:
        return None
    _names, number = np.unique(data.parts["run" if "run" in kinds else "file"], return_inverse=True)
    return np.asarray(number, np.int64)


def _known(own: Own, name: str) -> Values | None:
    """The model's values for a file or run; its name may be written without the folder."""
    same = (
        v for written, v in own.values.items() if name == written or name.endswith(f"/{written}")
    )
    return next(same, None)


def _unknown(term: Term) -> Values:
    """Starting values for a file or run that the model has not seen.

    Independent measurements of other files or runs say nothing about it and are not taken over.
    """
    count = len(term.layout)
    knowledge = replace(Knowledge.nothing(count), fixed=term.knowledge.fixed)
    return Values(term.vector, np.full(count, np.inf), knowledge)


def _said_of_parts(term: Term, kind: str, known: Sequence[str], new: Sequence[str]) -> str:
    words = [f"{some(known)} as in the model"] if known else []
    held = bool(term.knowledge.fixed.all())
    then = "at the fixed common values" if held else "fitted to these data first"
    words += [f"{some(new)} not in the model, so {then}"] if new else []
    return f"{term.name} has separate values for each {kind}: {'; '.join(words)}"


# The fit of what the data leave free.


def freed(
    problem: Problem, terms: Terms, fresh: Fresh = ()
) -> tuple[Terms, NDArray[np.bool_], list[str]]:
    """Fit the parameters that the data leave free, of a model that is laid out; the others stay.

    Returns:
        The model, which of its parameters (p,) were fitted, and a sentence for each effect that was
        fitted or that the TOML names.
    """
    names = problem.data.free
    if not (names or fresh) or not problem.n_readings:
        return terms, np.zeros(len(terms), dtype=bool), []
    own = [_new(problem, name) for name in names if name not in terms]
    every = Terms([*terms, *own])
    free = _free(every, names, fresh)
    data = Data.of(problem, every)
    state = _registered(problem, every, data.factor, free)
    best = _fitted(data, state, free)
    found = every.with_vector(best.terms.vector)
    moved, error = free & ~found.knowledge.fixed, best.stderr
    told = [_told(found, name, moved, error, problem, name in names) for name in found.names]
    return found, moved, list(filter(None, told))


def _fitted(data: Data, state: State, free: NDArray[np.bool_]) -> Fit:
    """The fit of the free parameters, of which nothing is known; all others stay.

    Rows that are far off hardly count. But a row may stick out because it alone shows what is free,
    such as where the target is. So if there are any, a second fit begins where all count alike.
    """
    parts = np.split(free, np.cumsum([len(term.layout) for term in state.terms])[:-1])
    held = [
        replace(term, knowledge=replace(term.knowledge, fixed=term.knowledge.fixed | ~mine))
        for term, mine in zip(state.terms, parts, strict=True)
    ]
    start, widths = state.of(Terms(held)), dict.fromkeys(state.terms.names, FLAT)
    best = fit(data, start, widths)
    if not outliers(data.chain, best.weight, data.problem.data.n_rows).any():
        return best
    every = np.ones(len(best.weight))
    alike = without_rows(replace(best, weight=every), every < 1.0)
    fits = [best, *([fit(data, alike, widths, noise=best.noise)] if alike.valid else [])]
    return min(fits, key=lambda one: one.cost)


def _new(problem: Problem, name: str) -> Term:
    """An effect that the model lacks, at its null values; separate for each of several files."""
    layout, data = layout_of(name, problem.robot), problem.data
    if data.files:
        files = data.free_in.get(name, range(len(data.files)))
        layout = apart(layout, "file", tuple(data.origins[k] for k in files), layout.null)
    return Term(layout, layout.null)


def _free(terms: Terms, names: Sequence[str], fresh: Fresh) -> NDArray[np.bool_]:
    """(p,) the free parameters: all those of named effects, others only for new files or runs."""
    free = np.array([effect in names for effect, _key in terms.labels], dtype=bool)
    for effect, part in fresh:
        layout = terms[effect].layout
        assert isinstance(layout, ApartLayout)
        own = np.arange(len(layout))[layout.part(part)]
        free[terms.part(effect).start + own] = True
    return free


def _registered(problem: Problem, terms: Terms, factor: Array, free: NDArray[np.bool_]) -> State:
    """The model as it stands, or with the tracker frame registered to it, whichever fits better.

    Gauss-Newton would need many steps from a frame that is far away.
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
    """A sentence with the values that an effect was fitted to; "" if it was not fitted."""
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
    why = f" is free, as stated in the TOML beside {problem.data.name}, and" if by_toml else ""
    return f"{name}{why} was fitted to these data first: {words}"
