"""The whole catalogue, linearised about a fitted set: what each effect would be worth beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from crosscheck.calibration.joint_fit.joining import added_columns, amplitudes, amplitudes_at_null
from crosscheck.calibration.joint_fit.joint import JointFit, Setting
from crosscheck.calibration.linear_evidence.gram import ColumnGroup, Gram, gram_of
from crosscheck.calibration.linear_evidence.priors import widths_for
from crosscheck.fit.effects.starts import UNSEEN
from crosscheck.fit.least_squares.known import known_readings
from crosscheck.fit.least_squares.state import derivatives
from seecr.effects import Term, Terms
from seecr.pose import Array


@dataclass(frozen=True, eq=False)
class Catalogue:
    """All effects that might be missing, each with its starting values.

    Attributes:
        at_once: effects without history or shapes, at null.
        later: the others, at their most promising shapes.
        prices: for some of these, how much more ln evidence they gain there than on average.
    """

    at_once: Terms
    later: Terms
    prices: Mapping[str, float] = field(default_factory=dict)

    def start(self, name: str) -> Term:
        """An effect with its starting values."""
        return self.at_once[name] if name in self.at_once else self.later[name]

    def size(self, name: str) -> int:
        """How many parameters an effect has."""
        return len(self.start(name).layout)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all effects."""
        return (*self.at_once.names, *self.later.names)


def gram_about(setting: Setting, joint: JointFit, catalogue: Catalogue) -> Gram:
    """Normal equations of the whole catalogue, linearised about a fit of some of it."""
    return gram_with(setting, joint, catalogue, *catalogue_columns(setting, joint, catalogue))


def gram_with(
    setting: Setting,
    joint: JointFit,
    catalogue: Catalogue,
    columns: Mapping[str, Array],
    z: Mapping[str, Array],
) -> Gram:
    """The same, given the columns and values of :func:`catalogue_columns`."""
    groups, first = {}, 0
    for name, x in columns.items():
        count = x.shape[1]
        term, seen = _in_linear_model(joint, catalogue, name)
        one_sided = (term.layout.lower == term.layout.null)[seen]
        own = np.arange(first, first + count)
        groups[name] = ColumnGroup(own, widths_for(term.layout, setting.free), one_sided)
        first += count
    white = joint.state.white
    x = np.concatenate([np.zeros((len(white), 0)), *columns.values()], axis=1)
    y = white + x @ np.concatenate([np.zeros(0), *z.values()])
    white_x, white_y = (joint.whitened(setting.chain, part) for part in (x, y))
    known, readings = known_of(joint, catalogue, tuple(columns))
    return gram_of(
        np.concatenate([white_x, known]), np.concatenate([white_y, readings]), groups
    )  # fmt: skip


def known_of(joint: JointFit, catalogue: Catalogue, names: Sequence[str]) -> tuple[Array, Array]:
    """Independent measurements: columns (k, p) by the effects' amplitudes, and readings (k,)."""
    each = [_in_linear_model(joint, catalogue, name) for name in names]
    terms = Terms(term for term, _seen in each)
    columns, readings = known_readings(terms)
    order = [np.flatnonzero(terms.own(term.name))[seen] for term, seen in each]
    none = np.zeros(0, dtype=np.intp)
    return columns[:, np.concatenate([none, *order])], readings


def _in_linear_model(
    joint: JointFit, catalogue: Catalogue, name: str
) -> tuple[Term, NDArray[np.bool_]]:
    """An effect in the fit or at its start, and which (p,) of its parameters have columns."""
    if name in joint.terms:
        term = joint.terms[name]
        return term, amplitudes(term)
    term = catalogue.start(name)
    return term, amplitudes_at_null(term)


def catalogue_columns(
    setting: Setting, joint: JointFit, catalogue: Catalogue
) -> tuple[Mapping[str, Array], Mapping[str, Array]]:
    """For each effect that is seen: columns (N, k) of its amplitudes, and their values z (k,)."""
    inside = joint.terms
    every = Terms([*inside, *(t for t in catalogue.at_once if t.name not in inside)])
    state = joint.state.of(every)
    rates = derivatives(setting.problem, state, frozen=True) * every.scale
    columns, z = {}, {}
    for term in every:
        part = np.flatnonzero(every.own(term.name))[amplitudes(term)]
        columns[term.name], z[term.name] = rates[:, part], term.sizes[amplitudes(term)]
    for term in catalogue.later:
        if term.name not in inside:
            own = added_columns(setting, joint, term)
            columns[term.name], z[term.name] = own, np.zeros(own.shape[1])
    seen = [
        n for n, x in columns.items()
        if x.shape[1] and (n in inside or np.max(np.abs(x), initial=0.0) > UNSEEN)
    ]  # fmt: skip
    return {n: columns[n] for n in seen}, {n: z[n] for n in seen}
