"""What may be missing: the effects, the forms of them that are other in each file or run, fields.

All are members of one catalogue. A member has a key, by which hypotheses name it: an effect's name,
``exit_point_error@run`` for other values in each run, ``~3`` for the third field.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import lgamma, log

import numpy as np

from crosscheck.fit.problem import Problem
from crosscheck.fit.reasons import Reason, Why
from crosscheck.inference.fields import Varying, fields_about
from crosscheck.inference.fit import Data, Fit
from crosscheck.inference.priors import ANEW, UNKNOWN
from crosscheck.measurements.data import Measurements
from seecr.effects import ApartLayout, Term, Terms, apart, considered_of, layout_of
from seecr.effects.base import Layout
from seecr.pose import Array

Key = frozenset[str]
"""A hypothesis: the keys of its members, with at most one field."""

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
        return {t.name: member_key(t.layout) for t in terms}

    @property
    def stood_keys(self) -> Key:
        """The keys of the model as it stands."""
        return frozenset(self.keys_of(self.stood).values())


def log_choices(count: int, of: int) -> float:
    """ln prior of one set of ``count`` out of ``of`` effects."""
    return -log(of + 1) - lgamma(of + 1) + lgamma(count + 1) + lgamma(of - count + 1)


def member_key(layout: Layout) -> str:
    """The key of an effect with these parameters."""
    return f"{layout.name}@{layout.kind}" if isinstance(layout, ApartLayout) else layout.name


def _waits(problem: Problem, layout: Layout) -> bool:
    """Whether an effect has shapes or, at its expected size, history or weight."""
    setup = problem.experiment.setup([at_its_size(layout).effect()])
    return bool(layout.shape.any() or setup.has_history or np.any(setup.cable_weight))


def at_its_size(layout: Layout) -> Term:
    """An effect with all values at their expected sizes, as far as bounds allow."""
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
