"""How large an effect must be to show, or to be told from another, by sensitivities alone.

With the whitened derivatives G of an effect by its expected sizes, the expected squared signal is
lam = |G|^2, and the part that another effect's derivatives H cannot imitate is
lam_gh = |G - H H^+ G|^2. A chi2 test of the family-wise level finds the effect in four of five
cases if lam is at least ``needed``. So the smallest visible size is the plausible one times
sqrt(needed/lam).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy import special

from crosscheck.fit.algebra import basis, beside, left_over
from crosscheck.fit.reasons import Reason, Why
from crosscheck.fit.state import amplitude_columns, free_derivatives
from crosscheck.inference.catalogue import candidates
from crosscheck.planning.planned import Planned
from seecr.effects import Term
from seecr.effects.base import Layout
from seecr.pose import Array

LEVEL, POWER = 0.05, 0.8
"""Family-wise false-alarm rate, and power: the probability of finding an effect that is there."""

NAMED = 2.0
"""From this multiple of the smallest visible size on, diagnoses name nine in ten effects, or their
equivalents: measured by ``scripts/score.py``, see docs/diagnosis.md."""

# A direction does not count if it is this much weaker than the strongest.
_RANK = 1e-5
# Relative signal that is left of an exact twin by rounding.
EXACT = 1e-6


@dataclass(frozen=True, eq=False)
class Signal:
    """What an effect does to planned readings.

    Attributes:
        layout: the effect. shape: values of its shape parameters.
        columns: (N, p) whitened change of each reading by each expected size; 0 for shapes.
    """

    layout: Layout
    shape: dict[str, float]
    columns: Array

    @cached_property
    def basis(self) -> Array:
        """Orthonormal basis (N, d) of all that the effect can do to the readings."""
        return basis(self.columns)

    @property
    def power(self) -> float:
        """Expected squared signal of expected sizes."""
        return float(np.sum(self.columns**2))

    @property
    def directions(self) -> int:
        """How many directions of its parameters change the readings."""
        s = np.linalg.svd(self.columns, compute_uv=False)
        return max(1, int(np.sum(s > _RANK * s[0]))) if len(s) and s[0] > 0 else 1


@lru_cache(maxsize=256)
def needed(directions: int, tried: int) -> float:
    """Squared signal that a test finds: the noncentrality for POWER at the level LEVEL/tried."""
    from scipy import optimize  # takes a while to import

    limit = special.chdtri(directions, LEVEL / tried)
    return float(
        optimize.brentq(lambda nc: 1.0 - special.chndtr(limit, directions, nc) - POWER, 1e-6, 1e4)
    )


def signals(plan: Planned) -> tuple[dict[str, Signal], dict[str, Reason]]:
    """Signals of all effects of the catalogue, and the reasons why some have none."""
    found: dict[str, Signal] = {}
    missing: dict[str, Reason] = {}
    span = _of_model(plan)
    for layout, why_not in candidates(plan.problem):
        if layout.name in plan.base.terms:
            continue
        if why_not is not None:
            missing[layout.name] = why_not
            continue
        shapes = layout.effect.shapes(plan.base.prediction.setup)
        if not shapes:
            missing[layout.name] = Reason(Why.NOT_MOVED)
            continue
        shape = shapes[len(shapes) // 2]
        found[layout.name] = Signal(layout, shape, beside(_columns(plan, layout, shape), span))
    return found, missing


def signals_like(plan: Planned, like: Mapping[str, Signal]) -> dict[str, Signal]:
    """Signals of the same effects, at the same sizes, in another plan."""
    span = _of_model(plan)
    return {
        name: Signal(s.layout, s.shape, beside(_columns(plan, s.layout, s.shape), span))
        for name, s in like.items()
    }


def _of_model(plan: Planned) -> Array:
    """Basis (N, k) of what the model's own effects can imitate, since they are fitted together."""
    return basis(free_derivatives(plan.problem, plan.base))


def _columns(plan: Planned, layout: Layout, shape: dict[str, float]) -> Array:
    start = layout.start(shape)
    columns = amplitude_columns(plan.problem, plan.base, Term(layout, start))
    # a length behind the exit point only makes friction possible: its own signal is that of
    # another effect
    given = (start != layout.null) | layout.shape
    return np.asarray(np.where(given, 0.0, columns * layout.scale))


def signal_left(g: Signal, h: Signal) -> float:
    """lam_gh: squared signal of g that h cannot imitate."""
    return left_over(g.columns, h.basis)


def signals_together(a: Mapping[str, Signal], b: Mapping[str, Signal]) -> dict[str, Signal]:
    """Signals of two sets of readings together; 0 where one of them lacks an effect."""
    out = {}
    rows = [len(next(iter(s.values())).columns) if s else 0 for s in (a, b)]
    for name in {**a, **b}:
        one = a.get(name) or b[name]
        parts = [
            s[name].columns if name in s else np.zeros((n, len(one.layout)))
            for s, n in zip((a, b), rows, strict=True)
        ]
        out[name] = Signal(one.layout, one.shape, np.concatenate(parts))
    return out


@dataclass(frozen=True)
class Wanted:
    """An effect that readings do not show yet, or two effects that they do not tell apart.

    Attributes:
        effect: the effect that should show. other: the one to tell it from; "" if it should only be
            seen.
        now: squared signal so far. needed: squared signal that a test finds.
    """

    effect: str
    other: str
    now: float
    needed: float
