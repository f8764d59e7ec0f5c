"""What data can show of each effect, whatever they say: this is stated before any verdict."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.least_squares.state import State
from crosscheck.fit.reasons import Reason, Why, by_reason
from crosscheck.planning.planned import Planned, Reads
from crosscheck.planning.result import Visible
from crosscheck.planning.visibility import EXACT, Signal, needed, signal_left, signals
from seecr.counted import counted, some
from seecr.pose import Array

_MOST = 8


@dataclass(frozen=True, eq=False)
class Sight:
    """What data can show.

    Attributes:
        effects: effects that could be looked for. missing: those that cannot, and why.
    """

    effects: tuple[Visible, ...]
    missing: Mapping[str, Reason]

    @property
    def hidden(self) -> tuple[str, ...]:
        """Effects that would not show at a plausible size."""
        return tuple(found.name for found in self.effects if not found.visible)

    @property
    def alike(self) -> dict[str, tuple[str, ...]]:
        """Effects that others imitate, exactly or within the noise, and the names of these."""
        return {
            found.name: (*found.twins, *(name for name, _left in found.confused))
            for found in self.effects
            if found.visible and (found.twins or found.confused)
        }

    def lines(self) -> list[str]:
        """The same in sentences: what shows, what does not, what cannot be told apart."""
        asked = [why for why in self.missing.values() if why.why is not Why.EXCLUDED]
        total = len(self.effects) + len(asked)
        seen = len(self.effects) - len(self.hidden)
        effects = f"{seen} of {counted(total, 'effect')}"
        out = [f"In these data {effects} would be visible at a plausible size."]
        large = [n for n, why in self.missing.items() if why.why is Why.TOO_MANY_PARAMETERS]
        lacking = by_reason({n: why for n, why in self.missing.items() if n not in large})
        if lacking or self.hidden:
            small = [(f"{', '.join(self.hidden)} (too small compared with the noise)")] * bool(
                self.hidden
            )
            out.append(f"Not visible: {'; '.join([*lacking, *small])}.")
        if large:
            out.append(
                "Some have more parameters than these data have rows, and rest on plausible sizes: "
                f"{some(large, _MOST)}."
            )
        pairs = [f"{name} from {' or '.join(others[:3])}" for name, others in self.alike.items()]
        if pairs:
            alike = some(pairs, _MOST, "; ")
            out.append(f"At a plausible size the data could not distinguish {alike}.")
        return out

    def as_json(self) -> dict[str, Any]:
        """``can_show`` of ``diagnosis.json``."""
        return {
            "visible": [found.name for found in self.effects if found.visible],
            "not_visible": list(self.hidden),
            "cannot_be_told_from": {name: list(others) for name, others in self.alike.items()},
            "not_with_these_data": {name: why.words for name, why in self.missing.items()},
        }


def sight_of(problem: Problem, base: State, factor: Array) -> Sight:
    """What data can show beside a model.

    Args:
        problem: the data. base: the model on them. factor: noise factors.
    """
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
    confused: list[tuple[str, float]] = []
    if power >= need:
        near = sorted((value, o) for o, value in rest.items() if value < need)
        confused = [(o, value) for value, o in near]
    return Visible(
        g, need, _size(need, power), _size(need, least), imitator, tuple(confused), twins
    )


def _size(need: float, power: float) -> float:
    return float(np.sqrt(need / power)) if power > 0 else np.inf
