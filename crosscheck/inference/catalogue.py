"""What may be missing: the effects, the forms of them that are other in each file or run, fields.

All are members of one catalogue. A member has a key, by which hypotheses name it: an effect's name,
``exit_point_error@run`` for other values in each run, ``~3`` for the third field. About a fit the
readings are nearly linear in what every member does, y = r + X z, whether the fit has the member or
not. Effects with history, with shapes or with weight only act on their own way through the rows, or
at the right shape: their columns are those at their most promising shape beside the fit.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from math import lgamma, log

import numpy as np
from numpy.typing import NDArray

from crosscheck.fit.algebra import inverse_of
from crosscheck.fit.problem import Problem
from crosscheck.fit.reasons import Reason, Why
from crosscheck.fit.state import State, derivatives, known_readings
from crosscheck.inference.evidence import (
    Linear,
    MemberColumns,
    Solved,
    averaged,
    best_widths,
    log_gain,
)
from crosscheck.inference.fields import Varying, fields_about
from crosscheck.inference.fit import FLAT, TRACKER, Data, Fit
from crosscheck.inference.priors import ANEW, FIELD_WIDTHS, UNKNOWN, WIDTHS
from crosscheck.measurements.data import Measurements
from seecr.effects import ApartLayout, Term, Terms, apart, considered_of, layout_of
from seecr.effects.base import Layout
from seecr.effects.setup import Setup
from seecr.pose import Array

Key = frozenset[str]
"""A hypothesis: the keys of its members, with at most one field."""

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
# A form with values for each file or run needs so many rows in each.
_ROWS = 5


def is_field(key: str) -> bool:
    """Whether a key is that of a field."""
    return key.startswith("~")


def bare(key: Key) -> Key:
    """A hypothesis without its field."""
    return frozenset(k for k in key if not is_field(k))


def name_of(key: str) -> str:
    """The effect of a member's key."""
    return key.partition("@")[0]


def part_of(key: str) -> str:
    """What a member has other values for: "file", "run", or "" if all rows share them."""
    return key.partition("@")[2]


@dataclass(frozen=True, eq=False)
class Member:
    """An effect that may be missing, or a form of it.

    Attributes:
        key: by which hypotheses name it. layout: its parameters.
        waits: whether it has history, shapes or weight.
    """

    key: str
    layout: Layout
    waits: bool = False

    @property
    def term(self) -> Term:
        """The effect at null."""
        return Term(self.layout, self.layout.null)


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


def lacking(problem: Problem, layout: Layout) -> Reason | None:
    """Why these data cannot show an effect, or None."""
    if layout.name not in problem.considered:
        return Reason(Why.EXCLUDED)
    return input_lacking(problem.data, layout)


def input_lacking(data: Measurements, layout: Layout) -> Reason | None:
    """The first column that the effect depends on and the data do not have; None if it is there."""
    needs = layout.effect.needs
    still = data.temperature_C is not None and np.ptp(data.temperature_C) == 0
    timeless = data.t_s is None or np.ptp(data.t_s) == 0
    lacks = (
        ("poses", data.absolute, Why.NEEDS_POSES),
        ("time", timeless, Why.NEEDS_TIME),
        ("temperature", data.temperature_C is None, Why.NEEDS_TEMPERATURE),
        ("temperature", still, Why.CONSTANT_TEMPERATURE),
        ("tensions", not data.has_tension, Why.NEEDS_TENSIONS),
    )
    return next((Reason(why) for need, is_so, why in lacks if need in needs and is_so), None)


def candidates(problem: Problem) -> list[tuple[Layout, Reason | None]]:
    """All effects of the catalogue, each with the reason why these data cannot show it, if any."""
    rows = int(problem.use.sum())
    out = list[tuple[Layout, Reason | None]]()
    for effect in considered_of(problem.considered):
        layout = layout_of(effect, problem.robot)
        why = lacking(problem, layout)
        is_long = len(layout) > min(problem.n_readings, rows) or rows < 2
        if is_long and (why is None or why.why is not Why.EXCLUDED):
            why = Reason(Why.TOO_MANY_PARAMETERS, parameters=len(layout), rows=rows)
        out.append((layout, why))
    return out


def amplitude_columns(problem: Problem, state: State, layout: Layout, start: Array) -> Array:
    """(N, p) whitened derivatives by an effect's parameters at a start; columns of shapes are 0."""
    terms = state.terms.with_term(Term(layout, start))
    wanted = np.flatnonzero(terms.own(layout.name))[~layout.shape]
    out = np.zeros((len(state.white), len(layout)))
    if len(wanted):
        rates = derivatives(problem, state.of(terms), wanted.tolist(), frozen=True)
        out[:, ~layout.shape] = rates
    return out


@dataclass(frozen=True, eq=False)
class Catalogue:
    """Everything that may be missing in some data.

    Attributes:
        data: the data. stood: effects of the model as it stands, which every hypothesis has.
        members: those that may be missing, by key. reasons: why others cannot be.
        fields: columns (N, k) of what an unknown effect may change, by key.
        kinds: what each field changes.
        shapes_met: columns of each shape of what waits, about the first fit that asked for them.
    """

    data: Data
    stood: Terms
    members: Mapping[str, Member]
    reasons: Mapping[str, Reason]
    fields: Mapping[str, Array] = field(default_factory=dict)
    kinds: Mapping[str, Varying] = field(default_factory=dict)
    shapes_met: dict[str, list[Array]] = field(default_factory=dict)

    @classmethod
    def of(cls, data: Data, stood: Terms) -> Catalogue:
        """The catalogue of some data, without fields yet."""
        members, reasons = dict[str, Member](), dict[str, Reason]()
        for effect in considered_of(data.problem.considered):
            layout = layout_of(effect, data.problem.robot)
            if layout.name in stood:
                continue
            why = lacking(data.problem, layout)
            if why is not None:
                reasons[layout.name] = why
            else:
                members[layout.name] = Member(layout.name, layout, _waits(data.problem, layout))
        for layout in [*(m.layout for m in members.values()), *(t.layout for t in stood)]:
            for form in _forms(data.problem, layout):
                members[form.key] = form
        return cls(data, stood, members, reasons)

    def with_fields(self, fit: Fit) -> Catalogue:
        """The same with the fields of unknown effects about a fit."""
        every = {f"~{k}": one for k, one in enumerate(fields_about(fit))}
        columns = {key: part for key, (_kind, part) in every.items()}
        kinds = {key: kind for key, (kind, _part) in every.items()}
        return replace(self, fields=columns, kinds=kinds)

    @cached_property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects that may be missing."""
        return tuple(dict.fromkeys(name_of(k) for k in self.members if k not in self.stood))

    @cached_property
    def log_shares(self) -> Mapping[str, float]:
        """ln prior of a form over that of its effect, and of each field over that of none."""
        count = list(self.kinds.values())
        kinds = len(set(count))
        out = {
            key: UNKNOWN - np.log(kinds) - np.log(count.count(k)) for key, k in self.kinds.items()
        }
        return out | {key: ANEW for key in self.members if part_of(key)}

    def log_prior(self, key: Key) -> float:
        """ln prior of a hypothesis: all numbers of effects are equally probable, and so are all
        sets of one number (Scott and Berger, Annals of Statistics 38, 2010).
        """
        own = {name_of(k) for k in key if not is_field(k)} - set(self.stood.names)
        return log_choices(len(own), len(self.effects)) + sum(
            self.log_shares.get(k, 0.0) for k in key
        )

    def terms(self, key: Key, values: Mapping[str, Term]) -> Terms:
        """The effects of a hypothesis with given values; the rest as it stands, or at null."""
        chosen = {t.name: values.get(t.name, t) for t in self.stood}
        for k in sorted(key):
            if k in values:
                chosen[name_of(k)] = values[k]
            elif k in self.members:
                chosen[name_of(k)] = self.members[k].term
        return Terms(chosen.values())

    def keys_of(self, terms: Terms) -> dict[str, str]:
        """The key of each effect of a model, by its name."""
        return {t.name: _key_of(t.layout) for t in terms}

    @property
    def stood_keys(self) -> Key:
        """The keys of the model as it stands."""
        return frozenset(self.keys_of(self.stood).values())

    def about(self, fit: Fit) -> About:
        """What every member does about a fit."""
        return About(self, fit)


def log_choices(count: int, of: int) -> float:
    """ln prior of one set of ``count`` out of ``of`` effects."""
    return -log(of + 1) - lgamma(of + 1) + lgamma(count + 1) + lgamma(of - count + 1)


def _key_of(layout: Layout) -> str:
    return f"{layout.name}@{layout.kind}" if isinstance(layout, ApartLayout) else layout.name


def _waits(problem: Problem, layout: Layout) -> bool:
    """Whether an effect has shapes or, at its expected size, history or weight."""
    setup = problem.experiment.setup([_at_its_size(layout).effect()])
    return bool(layout.shape.any() or setup.has_history or np.any(setup.cable_weight))


def _at_its_size(layout: Layout) -> Term:
    return Term(layout, np.clip(layout.null + layout.scale, layout.lower, layout.upper))


def _forms(problem: Problem, layout: Layout) -> Iterator[Member]:
    """The forms of an effect with other values in each file or run, where there are several."""
    if isinstance(layout, ApartLayout):
        return
    files = len(np.unique(problem.data.file[problem.use]))
    for kind in layout.effect.anew:
        parts = np.unique(problem.data.parts[kind][problem.use])
        enough = len(parts) * _ROWS <= problem.use.sum()
        enough &= len(parts) * len(layout) <= problem.n_readings
        if len(parts) > 1 and enough and not (kind == "run" and len(parts) == files):
            names = tuple(str(name) for name in parts)
            form = apart(layout, kind, names, layout.null)
            yield Member(f"{layout.name}@{kind}", form)


def inside(term: Term, by: float = _INSIDE) -> Term:
    """Move a start off its bound, where laws with history have two-sided derivatives."""
    layout = term.layout
    at_bound = (term.vector <= layout.lower) & ~layout.shape & ~term.knowledge.fixed
    return term.with_vector(np.where(at_bound, term.vector + by * layout.scale, term.vector))


def amplitudes(term: Term) -> NDArray[np.bool_]:
    """(p,) parameters that the linear model treats: neither shapes nor fixed ones."""
    return np.asarray(~term.layout.shape & ~term.knowledge.fixed)


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
            key = _key_of(term.layout)
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
        terms = self.fit.terms.with_term(term)
        own = np.flatnonzero(_at_null(term))
        wanted = (terms.part(term.name).start + own).tolist()
        rates = derivatives(self.problem, self.fit.state.of(terms), wanted, frozen=True)
        return np.asarray(rates * term.layout.scale[own])

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
        there = _at_its_size(member.layout)
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
        fit, columns = self.fit, self.columns
        groups, first = dict[str, MemberColumns](), 0
        parts = [np.zeros((len(fit.state.white), 0)), *columns.values()]
        for key, x in columns.items():
            term = self.starts[key]
            seen = amplitudes(term) if term.name in fit.terms else _at_null(term)
            one_sided = (term.layout.lower == term.layout.null)[seen]
            own = first + np.arange(x.shape[1])
            groups[key] = MemberColumns(own, widths_for(term.layout, fit.data.free), one_sided)
            first += x.shape[1]
        y = fit.state.white + np.hstack(parts) @ np.concatenate([np.zeros(0), *self._z.values()])
        known, readings = self._known(first)
        for key, x in self.every.fields.items():
            groups[key] = MemberColumns(first + np.arange(x.shape[1]), np.array(FIELD_WIDTHS))
            first += x.shape[1]
            parts.append(x)
        white = fit.metric.white(np.column_stack([*parts, y]))
        known = np.hstack([known, np.zeros((len(known), first - known.shape[1]))])
        x = np.concatenate([white[:, :-1], known])
        return Linear.of(x, np.concatenate([white[:, -1], readings]), groups)

    def _known(self, count: int) -> tuple[Array, Array]:
        """Independent measurements: columns (k, count) by all amplitudes, and readings (k,)."""
        every = [self.starts[key] for key in self.columns]
        out, readings = [np.zeros((0, count))], [np.zeros(0)]
        first = 0
        for term, x in zip(every, self.columns.values(), strict=True):
            if term.knowledge.measured.any() and not isinstance(term.layout, ApartLayout):
                columns, values = known_readings(Terms([term]))
                rows = np.zeros((len(columns), count))
                rows[:, first : first + x.shape[1]] = columns[:, amplitudes(term)]
                out.append(rows)
                readings.append(values)
            first += x.shape[1]
        return np.concatenate(out), np.concatenate(readings)

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
            seen = amplitudes(term) if term.name in self.fit.terms else _at_null(term)
            layout, vector, own = term.layout, term.vector.copy(), np.flatnonzero(seen)
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
