"""Lays out effects with separate values for each file or run, for the files or runs of some data.

A model keeps the values of the files or runs that it has seen. In a fit each file or run of the
data has its own values; those that the model has not seen start from the effect's common values.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crosscheck.measurements.data import Measurements
from seecr.counted import some
from seecr.effects import ApartLayout, Knowledge, Own, Term, Terms, Values, apart


@dataclass(frozen=True, eq=False)
class LaidOut:
    """A model for some data.

    Attributes:
        terms: its effects, those with separate values laid out for the files or runs of the data.
        fresh: pairs of an effect and a file or run for which the model has no values.
        notes: which values were taken from the model, and which are new.
    """

    terms: Terms
    fresh: tuple[tuple[str, str], ...]
    notes: tuple[str, ...]


def laid_out(data: Measurements, terms: Terms) -> LaidOut:
    """The model, with separate values for the files or runs of the data where effects have them."""
    out, fresh, notes = [], [], []
    for term in terms:
        if term.own is None or isinstance(term.layout, ApartLayout):
            out.append(term)
            continue
        names = names_in(data, term.own.kind)
        known = {name: _known(term.own, name) for name in names}
        new = [name for name in names if known[name] is None]
        out.append(_term(term, {name: known[name] or _unknown(term) for name in names}))
        fresh += [(term.name, name) for name in new]
        notes.append(_said(term, term.own.kind, [n for n in names if n not in new], new))
    return LaidOut(Terms(out), tuple(fresh), tuple(notes))


def names_in(data: Measurements, kind: str) -> tuple[str, ...]:
    """Names of the files or runs, in the order of the data."""
    return tuple(dict.fromkeys(data.parts[kind].tolist()))


def groups_of(data: Measurements, terms: Terms) -> NDArray[np.int64] | None:
    """(n,) number of each row's file or run, if effects have separate values for these."""
    kinds = [term.layout.kind for term in terms if isinstance(term.layout, ApartLayout)]
    if not kinds:
        return None
    _names, number = np.unique(data.parts["run" if "run" in kinds else "file"], return_inverse=True)
    return np.asarray(number, np.int64)


def _term(term: Term, values: dict[str, Values]) -> Term:
    assert term.own is not None
    layout = apart(term.layout, term.own.kind, tuple(values), term.vector)
    vector = np.concatenate([one.vector for one in values.values()])
    return Term(layout, vector, Knowledge.joined([v.knowledge for v in values.values()]), term.own)


def _known(own: Own, name: str) -> Values | None:
    """The model's values for a file or run; its name may be written without the folder."""
    for written, values in own.values.items():
        if name == written or name.endswith(f"/{written}"):
            return values
    return None


def _unknown(term: Term) -> Values:
    """Starting values for a file or run that the model has not seen.

    Independent measurements of other files or runs say nothing about it and are not taken over.
    """
    count = len(term.layout)
    knowledge = Knowledge.nothing(count)
    fixed = Knowledge(term.knowledge.fixed, knowledge.value, knowledge.stderr)
    return Values(term.vector, np.full(count, np.inf), fixed)


def _said(term: Term, kind: str, known: Sequence[str], new: Sequence[str]) -> str:
    words = [f"{some(known)} as in the model"] if known else []
    if new:
        held = bool(term.knowledge.fixed.all())
        then = "at the fixed common values" if held else "fitted to these data first"
        words.append(f"{some(new)} not in the model, so {then}")
    return f"{term.name} has separate values for each {kind}: {'; '.join(words)}"
