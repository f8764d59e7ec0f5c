"""The result of planning: which effects will show, which can be named, what to add; its JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from crosscheck.fit.problem import Problem
from crosscheck.fit.reasons import Reason, Why, by_reason
from crosscheck.fit.state import State
from crosscheck.fit.words import belongs
from crosscheck.planning.planned import Planned, Reads
from crosscheck.planning.proposer import Gain, Suggestion
from crosscheck.planning.room import Demand
from crosscheck.planning.visibility import (
    EXACT,
    LEVEL,
    NAMED,
    POWER,
    Signal,
    needed,
    signal_left,
    signals,
)
from seecr.counted import counted, some
from seecr.pose import Array
from seecr.result import Record, Result
from seecr.units import in_unit, short

# Why effects do not show.
_SMALL = "too small compared with the noise"
_STILL = "whatever its size, it moves none of these readings, for instance as joints hold it"


@dataclass(frozen=True, eq=False, repr=False)
class Visible:
    """What a plan will show of an effect.

    Attributes:
        signal: what the effect does to the readings.
        needed: squared signal that a test finds.
        factor: smallest size that shows, in expected sizes, with all parameters scaled alike; inf
            if the poses do not see it at all.
        identifiable: the same beside the best imitator that is no exact twin.
        imitator: name of that imitator, "" if there is none.
        confused: (name, signal it cannot imitate) of effects that cannot be told from this one at
            its expected size, the best imitator first; without exact twins.
        twins: effects that imitate this one exactly in what the poses read.
    """

    signal: Signal
    needed: float
    factor: float
    identifiable: float
    imitator: str
    confused: tuple[tuple[str, float], ...]
    twins: tuple[str, ...]

    def __repr__(self) -> str:
        return f"{self.name}: from {short(self.factor)} expected sizes on"

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.signal.layout.name

    @property
    def visible(self) -> bool:
        """Whether an expected size would show."""
        return self.factor <= 1.0

    @property
    def named(self) -> bool:
        """Whether an expected size would show and be told from everything else."""
        return self.visible and not self.alike

    @property
    def alike(self) -> tuple[str, ...]:
        """Effects from which it cannot be told at its expected size, exact twins first."""
        return (*self.twins, *(name for name, _left in self.confused))

    def sizes(self, factor: float) -> dict[str, float]:
        """Parameters at a multiple of their expected sizes, without shapes."""
        layout = self.signal.layout
        own = np.any(self.signal.columns != 0.0, axis=0)
        own = own if own.any() else ~layout.shape
        return {k: factor * float(layout.scale[i]) for i, k in enumerate(layout.names) if own[i]}

    def words(self, factor: float) -> str:
        """The same in words, such as "radius 0.3 mm"; "none" if factor is inf."""
        if not np.isfinite(factor):
            return "none"
        effect, sizes = self.signal.layout.effect, self.sizes(factor)
        parts = []
        for item in fields(effect):
            unit = item.metadata["unit"]
            keys = [key for key in sizes if belongs(key, item.name, unit)]
            if not keys:
                continue
            null = float(item.metadata["null"])
            start = f"{null:g} ± " if null else ""
            each = " each" if len(keys) > 1 else ""
            times, word = in_unit(unit)
            size = short(times * sizes[keys[0]], 2)
            parts.append(f"{item.name} {start}{size} {word}".strip() + each)
        return ", ".join(parts)

    def as_json(self) -> dict[str, Any]:
        """An item of ``effects``."""
        return {
            "effect": self.name,
            "visible": self.visible,
            "plausible": self.sizes(1.0),
            "smallest_visible": self.sizes(self.factor),
            "smallest_visible_in_plausible_sizes": self.factor,
            "words": self.words(self.factor),
            "nine_in_ten_named": self.sizes(NAMED * self.factor),
            "smallest_identifiable": None if self.twins else self.sizes(self.identifiable),
            "best_imitator": self.imitator or None,
            "cannot_be_told_from": [
                *({"effect": name, "exact": True, "signal": 0.0} for name in self.twins),
                *({"effect": n, "exact": False, "signal": left} for n, left in self.confused),
            ],
            "signal": self.signal.power,
            "needed": self.needed,
            "shape": self.signal.shape,
        }


@dataclass(frozen=True, eq=False, repr=False)
class Plan(Result):
    """What planned commands will show.

    Attributes:
        planned: commands and noise. effects: effects, the best visible first.
        missing: effects that cannot be looked for, and why.
        confusion: names of effects, and a table (k, k): the part of the row's effect that the
            column's effect imitates.
        suggestions: what to add, the most useful first.
        slack: (line, cable) of cables about to go slack or taut.
        notes: what was assumed or left out.
        loose: (line, cables) of poses at which cables are slack.
        demand: tensions, and how far the robot rests from its commands; None if nowhere.
    """

    planned: Planned
    effects: tuple[Visible, ...]
    missing: Mapping[str, Reason]
    confusion: tuple[tuple[str, ...], Array]
    suggestions: tuple[Suggestion, ...]
    slack: tuple[tuple[int, str], ...]
    notes: tuple[str, ...]
    loose: tuple[tuple[int, tuple[str, ...]], ...] = ()
    demand: Demand | None = None

    @property
    def demanded(self) -> list[str]:
        """What the poses demand of the robot, in words: one line, or none."""
        return [] if self.demand is None else [f"these poses: {self.demand.words}"]

    @property
    def sentence(self) -> str:
        """The plan in a sentence."""
        if not self.effects and not self.planned.unsolved.all():
            rows = self.planned.problem.data.n_rows
            return (
                f"Nothing can be planned with so few rows ({rows}): an effect needs more rows "
                "than it has parameters; add poses, or have 40 rows chosen."
            )
        if not self.effects:
            return "Nothing can be planned: the model has no equilibrium at any of the rows."
        seen = [v for v in self.effects if v.visible]
        named = [v for v in seen if v.named]
        return (
            f"Of {counted(len(self.effects), 'effect')}, {len(seen)} would be visible at an "
            f"expected size and {len(named)} of these could be named. An effect of the smallest "
            f"visible size is found with a power of {100 * POWER:.0f} %, at a false-alarm rate of "
            f"{100 * LEVEL:.0f} % over all effects; from {NAMED:g} times that size on, a "
            "diagnosis names nine effects in ten, or an effect that these data cannot "
            "distinguish from them."
        )

    def lines(self) -> list[str]:
        """The sentence, what to add, and the notes."""
        add = []
        for item in self.suggestions:
            if item.reached:
                add += [f"add: {item.words}", *(f"     {place}" for place in item.places)]
        return [*self.demanded, self.sentence, *add, *(f"note: {note}" for note in self.notes)]

    def records(self) -> list[Record]:
        """A record for each effect: how large it must be to show and to be named."""
        return [
            {
                "effect": found.name,
                "visible": found.visible,
                "smallest_visible_in_plausible_sizes": found.factor,
                "smallest_named_in_plausible_sizes": found.identifiable,
                "cannot_be_told_from": ", ".join(found.alike),
            }
            for found in self.effects
        ]

    @property
    def converged(self) -> bool:
        """Whether the model rests at every planned row."""
        return not bool(self.planned.unsolved.any())

    def as_json(self) -> dict[str, Any]:
        """The content of ``plan.json``, SI."""
        problem = self.planned.problem
        names, table = self.confusion
        return {
            "sentence": self.sentence,
            "robot": problem.robot.name,
            "poses": str(problem.data.path),
            "rows": {"all": problem.data.n_rows, "used": int(problem.use.sum())},
            "reads": list(self.planned.reads.kinds),
            "sigma": problem.sigma,
            "demand": self.demand,
            "level": LEVEL,
            "power": POWER,
            "effects": self.effects,
            "not_with_these_data": {name: why.words for name, why in self.missing.items()},
            "confusion": {"effects": list(names), "containment": table},
            "add": self.suggestions,
            "near_slack": [{"line": line, "cable": cable} for line, cable in self.slack],
            "slack": [{"line": line, "cables": list(cables)} for line, cables in self.loose],
            "notes": list(self.notes),
        }


# What data can show of each effect, whatever they say: this is stated before any verdict.

_MOST = 8


@dataclass(frozen=True, eq=False, repr=False)
class Sight:
    """What data can show.

    Attributes:
        effects: effects that could be looked for. missing: those that cannot, and why.
        found: effects that a diagnosis lists: they show, being larger than is plausible.
    """

    effects: tuple[Visible, ...]
    missing: Mapping[str, Reason]
    found: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return "\n".join(self.lines())

    @property
    def hidden(self) -> tuple[str, ...]:
        """Effects that would not show at an expected size."""
        lost = (one.name for one in self.effects if not one.visible)
        return tuple(name for name in lost if name not in self.found)

    @property
    def alike(self) -> dict[str, tuple[str, ...]]:
        """Effects that others imitate, exactly or within the noise, and the names of these."""
        return {one.name: one.alike for one in self.effects if one.visible and one.alike}

    def lines(self) -> list[str]:
        """The same in sentences: what shows, what does not, what cannot be told apart."""
        asked = [why for why in self.missing.values() if why.why is not Why.EXCLUDED]
        total = len(self.effects) + len(asked)
        seen = len(self.effects) - len(self.hidden)
        effects = f"{seen} of {counted(total, 'effect')}"
        out = [f"In these data {effects} would be visible at an expected size."]
        large = [n for n, why in self.missing.items() if why.why is Why.TOO_MANY_PARAMETERS]
        lacking = by_reason({n: why for n, why in self.missing.items() if n not in large})
        still = [one.name for one in self.effects if not np.isfinite(one.factor)]
        for names, why in (
            ([name for name in self.hidden if name not in still], _SMALL),
            (still, _STILL),
        ):
            lacking += [f"{', '.join(names)} ({why})"] if names else []
        if lacking:
            out.append(f"Not visible: {'; '.join(lacking)}.")
        if large:
            out.append(
                "Some have more parameters than these data have rows, and rest on expected sizes: "
                f"{some(large, _MOST)}."
            )
        pairs = [f"{name} from {' or '.join(others[:3])}" for name, others in self.alike.items()]
        if pairs:
            alike = some(pairs, _MOST, "; ")
            out.append(f"At an expected size the data could not distinguish {alike}.")
        return out

    def as_json(self) -> dict[str, Any]:
        """``can_show`` of ``diagnosis.json``."""
        return {
            "visible": [one.name for one in self.effects if one.name not in self.hidden],
            "not_visible": list(self.hidden),
            "cannot_be_told_from": {name: list(others) for name, others in self.alike.items()},
            "not_with_these_data": {name: why.words for name, why in self.missing.items()},
        }


def sight_of(problem: Problem, base: State, factor: Array) -> Sight:
    """What data can show beside a model on them, with noise factors."""
    found, missing = signals(Planned(problem, base, factor, Reads.of(problem.data)))
    ranked = sorted(all_visible(found).values(), key=lambda one: one.factor)
    return Sight(tuple(ranked), missing)


def all_visible(own: Mapping[str, Signal]) -> dict[str, Visible]:
    """What signals show of each effect, and which effects they cannot tell apart."""
    return {name: _visible(name, own) for name in own}


def _visible(name: str, own: Mapping[str, Signal]) -> Visible:
    g = own[name]
    need = needed(g.directions, len(own))
    power = g.power
    left = {other: signal_left(g, s) for other, s in own.items() if other != name}
    twins = tuple(o for o, value in left.items() if power > 0 and value <= EXACT * power)
    rest = {o: value for o, value in left.items() if o not in twins}
    imitator = min(rest, key=lambda o: rest[o]) if rest else ""
    least = rest[imitator] if imitator else power
    near = sorted((value, o) for o, value in rest.items() if value < need <= power)
    confused = tuple((o, value) for value, o in near)
    return Visible(g, need, _size(need, power), _size(need, least), imitator, confused, twins)


def _size(need: float, power: float) -> float:
    return float(np.sqrt(need / power)) if power > 0 else np.inf


# The words of a plan that terminal and page share.


def alike(found: Visible) -> str:
    """Effects from which an effect cannot be told, exact twins first."""
    if not found.visible and not found.twins:
        return "(not visible at an expected size)"
    return some([f"{name} (exactly)" if name in found.twins else name for name in found.alike])


def signal_words(gain: Gain) -> str:
    """The signal now, after the measurement, and that which is needed, to two digits.

    The last is left out where the signal is as large now: prior sizes outweigh it.
    """
    # :g writes 2000, where :.2g alone writes 2e+03
    now, then = (f"{float(f'{value:.2g}'):g}" for value in (gain.now, gain.then))
    needed = f", {gain.needed:.2g} needed" if gain.now < gain.needed else ""
    return f"{now} now, {then} then{needed}"


def gain_words(gain: Gain) -> str:
    """What a measurement would gain, with numbers."""
    numbers = f"(signal {signal_words(gain)})"
    if gain.other:
        return f"tells {gain.effect} from {gain.other} {numbers}"
    return f"makes {gain.effect} visible {numbers}"
