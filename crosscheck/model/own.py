"""Fitted values of each file or run, as a model keeps them: by name, with what is usual."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from crosscheck.model.fitted import Fitted
from seecr.effects import ApartLayout, Knowledge, Own, Term, Values
from seecr.pose import Array


@dataclass(frozen=True, eq=False)
class Kept:
    """An effect as a model keeps it.

    Attributes:
        usual: its values for other files or runs, together with those of the known ones.
        parts: newly fitted values by the model's names of files or runs.
    """

    usual: Fitted
    parts: Mapping[str, Fitted]


def kept(one: Fitted, before: Term | None) -> Kept:
    """What a model keeps of a fit.

    For an unknown file or run the mean of the known ones is expected, with a standard error from
    their differences and uncertainties; if only one is known, with a plausible size.

    Args:
        one: the effect as fitted.
        before: the same in the model before, if it was there.
    """
    term, layout = one.term, one.term.layout
    if not isinstance(layout, ApartLayout):
        return Kept(one, {})
    values = dict(term.own.values) if term.own is not None else {}
    parts = {}
    for name in layout.parts:
        written = next((w for w in values if name == w or name.endswith(f"/{w}")), name)
        parts[written] = _part(one, layout, name)
        fitted = parts[written]
        values[written] = Values(fitted.term.vector, fitted.stderr, fitted.term.knowledge)
    vector, stderr = _usual(layout, values)
    knowledge = Knowledge.nothing(len(layout.base)) if before is None else before.knowledge
    vector = np.where(knowledge.fixed | knowledge.measured, layout.rest, vector)
    usual = Term(layout.base, vector, knowledge, Own(layout.kind, values))
    return Kept(Fitted(usual, stderr, np.zeros(len(vector), dtype=bool)), parts)


def _part(one: Fitted, layout: ApartLayout, name: str) -> Fitted:
    where, known = layout.part(name), one.term.knowledge
    knowledge = Knowledge(known.fixed[where], known.value[where], known.stderr[where])
    term = Term(layout.base, one.term.vector[where], knowledge)
    return Fitted(term, one.stderr[where], one.at_bound[where])


def _usual(layout: ApartLayout, values: Mapping[str, Values]) -> tuple[Array, Array]:
    """Mean of the values and how much a further one may differ, (p,) each."""
    every = np.array([one.vector for one in values.values()])
    if len(every) < 2:
        return every[0], layout.base.scale.copy()
    own = np.array([np.where(np.isfinite(one.stderr), one.stderr, 0.0) for one in values.values()])
    return every.mean(axis=0), np.hypot(every.std(axis=0, ddof=1), np.sqrt((own**2).mean(axis=0)))


def without_parts(fitted: Sequence[Fitted], covariance: Array) -> tuple[list[Fitted], Array]:
    """The effects that are the same everywhere, and their covariance."""
    same = np.array([not isinstance(one.term.layout, ApartLayout) for one in fitted], dtype=bool)
    own = np.repeat(same, [len(one.term.layout) for one in fitted])
    return (
        [one for one, yes in zip(fitted, same, strict=True) if yes],
        covariance[np.ix_(own, own)],
    )
