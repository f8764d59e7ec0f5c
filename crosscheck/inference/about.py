"""What every member of a catalogue does to the readings about a fit.

About a fit the readings are nearly linear in what every member does, y = r + X z, whether the fit
has the member or not. Effects with history, with shapes or with weight only act on their own way
through the rows, or at the right shape: their columns are those at their most promising shape
beside the fit.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.algebra import inverse_of
from crosscheck.fit.state import amplitude_columns, known_readings
from crosscheck.inference.catalogue import (
    Catalogue,
    Member,
    at_its_size,
    is_field,
    member_key,
    part_of,
)
from crosscheck.inference.evidence import (
    Linear,
    MemberColumns,
    Solved,
    averaged,
    best_widths,
    log_gain,
)
from crosscheck.inference.fit import FLAT, TRACKER, Fit
from crosscheck.inference.priors import FIELD_WIDTHS, WIDTHS
from seecr.effects import ApartLayout, Term, Terms
from seecr.effects.base import Layout
from seecr.effects.setup import Setup
from seecr.pose import Array

_TRACKER_WIDTHS = (*WIDTHS, 30.0, 100.0, 300.0)
# Values of size s lose ln(w/s) + (s/w)^2/2 - 1/2 of ln evidence each to a width w: between two of
# WIDTHS up to 0.31, between closer ones 0.08. Of many values that is so much that a second group
# that acts the same would be taken in to make up for it.
_FEW_VALUES = 12
_CLOSER_WIDTHS = tuple(sorted([*WIDTHS, *(float(np.sqrt(a * b)) for a, b in pairwise(WIDTHS))]))
# An effect is not seen if its expected size moves no reading by more than this part of its noise.
_UNSEEN = 0.02
# Starts are this far off a bound, in expected sizes: laws with history have derivatives there.
_INSIDE = 0.1


def widths_for(layout: Layout, free: Iterable[str] = ()) -> Array:
    """Prior widths of an effect over which its evidence is averaged.

    If its values belong to the data (``free``), it has one. Otherwise sets in which others do what
    its values did would be preferred: a narrower prior would suffice there.
    """
    if layout.name in set(free):
        return np.array([FLAT])
    if layout.name == TRACKER:
        return np.array(_TRACKER_WIDTHS)
    return np.array(_CLOSER_WIDTHS if len(layout) > _FEW_VALUES else WIDTHS)


def inside(term: Term, by: float = _INSIDE) -> Term:
    """Move a start off its bound, where laws with history have two-sided derivatives."""
    layout = term.layout
    at_bound = (term.vector <= layout.lower) & ~layout.shape & ~term.knowledge.fixed
    return term.with_vector(np.where(at_bound, term.vector + by * layout.scale, term.vector))


def amplitudes(term: Term) -> NDArray[np.bool_]:
    """(p,) parameters that the linear model treats: neither shapes nor fixed ones."""
    return np.asarray(~term.layout.shape & ~term.knowledge.fixed)


@dataclass(frozen=True, eq=False)
class AmplitudeColumns:
    """What a member does in a linear model.

    Attributes:
        term: its values. own: (p,) which of them the model has.
        columns: (N, k) derivatives by z of these. z: (k,) their values in the fit.
    """

    term: Term
    own: NDArray[np.bool_]
    columns: Array
    z: Array


def linear_of(
    fit: Fit, members: Mapping[str, AmplitudeColumns], fields: Mapping[str, Array]
) -> tuple[Linear, Array]:
    """Normal equations of members and fields (N, k) about a fit, with its noise.

    Independent measurements of values are further readings.

    Returns:
        The equations, and the values z (p,) in the fit of all columns; 0 for those of fields.
    """
    count = sum(len(m.z) for m in members.values())
    groups, known, readings, first = dict[str, MemberColumns](), [], [], 0
    for key, one in members.items():
        layout, at = one.term.layout, first + np.arange(len(one.z))
        one_sided = (layout.lower == layout.null)[one.own]
        groups[key] = MemberColumns(at, widths_for(layout, fit.data.free), one_sided)
        rows, values = known_readings(Terms([one.term]))
        known.append(np.zeros((len(rows), count)))
        known[-1][:, at] = rows[:, one.own]
        readings.append(values)
        first += len(one.z)
    none = np.zeros((len(fit.state.white), 0))
    x = np.hstack([none, *(m.columns for m in members.values())])
    z = np.concatenate([np.zeros(0), *(m.z for m in members.values())])
    y = fit.state.white + x @ z
    for key, columns in fields.items():
        at = first + np.arange(columns.shape[1])
        groups[key] = MemberColumns(at, np.array(FIELD_WIDTHS))
        first += len(at)
    white = np.empty((len(y), first))  # one by one: together fields may be a gigabyte
    white[:, :count] = fit.metric.white(x)
    for key, columns in fields.items():
        white[:, groups[key].columns] = fit.metric.white(columns)
    linear = Linear.of(white, fit.metric.white(y), groups)
    if known:
        more = np.zeros((sum(map(len, readings)), first))
        more[:, :count] = np.concatenate(known)
        linear = linear.with_readings(more, np.concatenate(readings))
    return linear, np.append(z, np.zeros(first - count))


class About:
    """What every member of a catalogue does to the readings about a fit.

    Attributes:
        fit: the fit.
        starts: each member with its values in the fit, or at null and its most promising shape.
        prices: ln evidence that the best shape of a member gains too much over its shapes' mean.
        columns: (N, k) derivatives by z of the amplitudes of each member that is seen.
    """

    def __init__(self, every: Catalogue, fit: Fit) -> None:
        self.every, self.fit = every, fit
        self.problem = fit.data.problem
        self.starts: dict[str, Term] = {}
        self.prices = {name: -share for name, share in log_shares(fit).items()}
        self.columns: dict[str, Array] = {}
        self._z: dict[str, Array] = {}
        self._late: dict[str, float] = {}
        self._own_columns()
        self._form_columns()
        for member in every.members.values():
            if member.waits and member.layout.name not in fit.terms:
                self._late_columns(member)

    # --- columns ---

    def _own_columns(self) -> None:
        """Effects of the fit, and all that act from the start, by one derivative of the model."""
        fit, inside_fit = self.fit, self.fit.terms
        others = [
            m.term for m in self.every.members.values()
            if not m.waits and not part_of(m.key) and m.layout.name not in inside_fit
        ]  # fmt: skip
        every = Terms([*inside_fit, *others])
        rates = fit.data.derivatives(fit.state.of(every))
        for term in every:
            key = member_key(term.layout)
            own = np.flatnonzero(every.own(term.name))[amplitudes(term)]
            self._take(key, term, rates[:, own], term.sizes[amplitudes(term)])

    def _form_columns(self) -> None:
        """Forms of effects, whose columns are those of the effect in the rows of each part."""
        keys = self.every.keys_of(self.fit.terms)
        for member in self.every.members.values():
            layout = member.layout
            if member.waits or member.key in self.columns:
                continue
            own = self.columns.get(keys.get(layout.name, layout.name))
            if own is None:
                continue
            if keys.get(layout.name, layout.name) != layout.name:  # the fit has another form of it
                form = self.fit.terms[layout.name].layout
                assert isinstance(form, ApartLayout)
                count = own.shape[1] // len(form.parts)
                own = own.reshape(len(own), -1, count).sum(axis=1)
            if isinstance(layout, ApartLayout):
                part = self.problem.data.parts[layout.kind][self.problem.row_of]
                own = np.hstack([own * (part == name)[:, None] for name in layout.parts])
            self._take(member.key, member.term, own, np.zeros(own.shape[1]))

    def _late_columns(self, member: Member) -> None:
        """An effect that waits, at the shape that promises most.

        Shapes are told apart by what the readings lack, and hardly by where the other effects have
        moved the robot: their columns are computed once, those of the best shape about each fit.
        """
        shapes = member.layout.effect.shapes(self.fit.state.prediction.setup)
        starts = [Term(member.layout, member.layout.start(s)) for s in shapes]
        if not member.layout.shape.any() and all(_at_null(t).sum() < len(t.layout) for t in starts):
            starts.append(member.term)  # one of its values may act without the others
        if not starts:
            return
        met = self.every.shapes_met
        first = member.key not in met or len(met[member.key]) != len(starts)
        if first:
            met[member.key] = [self.added(term) for term in starts]
        gains = self._gains(starts, met[member.key])
        at_size = self._gain_at_its_size(member)
        best = int(np.argmax(gains))
        columns = met[member.key][best] if first else self.added(starts[best])
        if not first:
            gains[best] = self._gains([starts[best]], [columns])[0]
        gains = np.maximum(gains, at_size)
        mean = averaged(gains)
        self.prices[member.key] = float(gains[best]) - mean
        self._late[member.key] = mean
        self._take(member.key, starts[best], columns, np.zeros(columns.shape[1]))

    def _take(self, key: str, term: Term, columns: Array, z: Array) -> None:
        if key not in self.every.members and term.name not in self.every.stood:
            return
        self.starts[key] = term
        seen = np.max(np.abs(columns), initial=0.0) > _UNSEEN
        if columns.shape[1] and (seen or term.name in self.fit.terms):
            self.columns[key], self._z[key] = columns, z

    def added(self, term: Term) -> Array:
        """(N, k) derivatives by z of the amplitudes of an added effect that are at null."""
        columns = amplitude_columns(self.problem, self.fit.state, term) * term.layout.scale
        return np.asarray(columns[:, _at_null(term)])

    # --- what an effect promises by itself ---

    @cached_property
    def promises(self) -> dict[str, float]:
        """ln evidence that members outside the fit gain beside it, each by itself."""
        had = {*self.every.keys_of(self.fit.terms).values(), *self._late}
        others = {key: x for key, x in self.columns.items() if key not in had}
        gains = self._gains([self.starts[key] for key in others], list(others.values()))
        return dict(zip(others, gains.tolist(), strict=True)) | self._late

    @cached_property
    def _own(self) -> tuple[tuple[Array, Array], tuple[Array, Array], Array]:
        """The fit's free columns in units of their width and its residual, split, and V."""
        fit, free = self.fit, self.fit.free
        own = fit.metric.split(fit.jacobian[:, free] * fit.width[free])
        normal = own[0].T @ own[0] - own[1].T @ own[1]
        return own, fit.metric.split(fit.state.white), inverse_of(normal + np.eye(len(normal)))

    def _gains(self, terms: Sequence[Term], columns: Sequence[Array]) -> Array:
        """(k,) ln evidence that columns (N, .) of effects gain beside the fit, each by itself."""
        (own, own_field), (left, left_field), inverse = self._own
        along = own.T @ left - own_field.T @ left_field
        out = np.full(len(terms), -np.inf)
        for k, (term, x) in enumerate(zip(terms, columns, strict=True)):
            if not x.shape[1]:
                continue
            white, field = self.fit.metric.split(x)
            cross = own.T @ white - own_field.T @ field
            rate = inverse @ cross
            out[k] = log_gain(
                white.T @ white - field.T @ field - cross.T @ rate,
                white.T @ left - field.T @ left_field - rate.T @ along,
                widths_for(term.layout, self.fit.data.free),
                (term.layout.lower == term.layout.null)[_at_null(term)],
            )
        return out

    def _gain_at_its_size(self, member: Member) -> float:
        """The same by what an expected size changes, for one amplitude with no shape or history.

        Sag grows with the square of the weight: its derivative at no weight says next to nothing.
        """
        if len(member.layout) != 1 or member.layout.shape.any():
            return -np.inf
        there = at_its_size(member.layout)
        if self.problem.experiment.setup([there.effect()]).has_history:
            return -np.inf
        moved = self.fit.data.state(self.fit.terms.with_term(there), self.fit.state)
        if not moved.valid:
            return -np.inf
        return float(self._gains([member.term], [(self.fit.state.white - moved.white)[:, None]])[0])

    # --- the linear model ---

    @cached_property
    def linear(self) -> Linear:
        """Normal equations of all members and fields, with the fit's noise."""
        members = {
            key: AmplitudeColumns(self.starts[key], self.seen(self.starts[key]), x, self._z[key])
            for key, x in self.columns.items()
        }
        return linear_of(self.fit, members, self.every.fields)[0]

    def seen(self, term: Term) -> NDArray[np.bool_]:
        """(p,) the amplitudes of a member that the linear model has."""
        return amplitudes(term) if term.name in self.fit.terms else _at_null(term)

    def moves(self, key: str) -> tuple[float, Array]:
        """The ln evidence that a member gains beside the fit, and how far values then move.

        Returns:
            The gain, and the moves (p,) of the fit's values in their units.
        """
        fit, x = self.fit, self.columns[key]
        free, scale = np.flatnonzero(fit.free), fit.terms.scale
        normal, gradient = fit.metric.normal(np.hstack([fit.jacobian[:, free], x]), fit.state.white)
        p = len(free)
        spread = fit.spread[np.ix_(free, free)]
        cross = spread @ normal[:p, p:]
        left = normal[p:, p:] - normal[p:, :p] @ cross + np.eye(x.shape[1])
        value = np.linalg.solve(left, gradient[p:])
        out = np.zeros(len(fit.width))
        out[free] = -(cross @ value) * scale[free]
        return self.promises.get(key, -np.inf), out

    def values(self, solved: Solved, part: float = 1.0, off: float = 0.03) -> dict[str, Term]:
        """The members of a set part of the way from the fit to their values in the linear model."""
        out = {}
        for key in solved.chosen:
            if is_field(key):
                continue
            term = self.starts[key]
            layout, vector, own = term.layout, term.vector.copy(), np.flatnonzero(self.seen(term))
            linear = layout.null[own] + solved.values[solved.place(key)] * layout.scale[own]
            vector[own] += part * (linear - vector[own])
            term = term.with_vector(np.clip(vector, layout.lower, layout.upper))
            out[key] = inside(term, off)
        return out

    def solved(self, widths: Mapping[str, float]) -> Solved:
        """A set in the linear model, with its best widths."""
        seen = {k: w for k, w in widths.items() if k in self.linear.groups}
        return best_widths(self.linear, seen)


def _at_null(term: Term) -> NDArray[np.bool_]:
    """(p,) amplitudes that are at null."""
    return np.asarray(amplitudes(term) & (term.vector == term.layout.null))


def log_shares(fit: Fit) -> dict[str, float]:
    """ln of the fraction of its prior to which each effect's shape is determined, at most 0.

    A fit takes the shape (a period, a time constant) that explains most, of noise too. All shapes
    that a search starts from are equally probable, and so is what lies between them.
    """
    shaped = [term for term in fit.terms if term.layout.shape.any()]
    if not shaped:
        return {}
    errors = np.sqrt(np.diag(fit.spread)) * fit.terms.scale
    setup = fit.state.prediction.setup
    return {t.name: _log_share(t, errors[fit.terms.own(t.name)], setup) for t in shaped}


def _log_share(term: Term, errors: Array, setup: Setup) -> float:
    """The same for one effect whose values have standard errors (p,), 0 for those that stay."""
    total, layout = 0.0, term.layout
    starts = np.array([layout.start(s) for s in layout.effect.shapes(setup)])
    for k in np.flatnonzero(layout.shape & (errors > 0.0)):
        values = np.unique(starts.reshape(-1, len(layout))[:, k])
        if len(values) > 1:
            middles = [0.5 * (a + b) for a, b in pairwise(values)]
            apart = float(np.interp(term.vector[k], middles, np.diff(values)))
            part = np.sqrt(2.0 * np.pi) * errors[k] / (len(values) * apart)
            total += float(np.log(min(part, 1.0)))
    return total
