"""How large an effect must be to show, and to be told from another, by sensitivities alone.

With columns G of an effect (whitened, by plausible sizes) the squared signal to be expected is
lam = |G|^2, and what another effect's columns H cannot imitate is lam_gh = |G - H H^+ G|^2. A
chi2 test of the family-wise level finds the effect in four of five cases where lam is at least
``needed``; so the smallest visible size is the plausible one times sqrt(needed/lam).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy import optimize, stats

from crosscheck.fit import imitation
from crosscheck.fit.candidates import candidates_for
from crosscheck.fit.imitation import basis, beside
from crosscheck.fit.known import free_derivatives
from crosscheck.fit.reasons import Reason, Why
from crosscheck.fit.starts import amplitude_columns
from crosscheck.planning.planned import Planned
from seecr.effects.base import Layout
from seecr.pose import Array

LEVEL, POWER = 0.05, 0.8
"""Family-wise chance of a false alarm, and chance to find what is there."""

NAMED = 2.0
"""Times the smallest size that shows at which diagnoses name nine in ten effects, themselves or as
what the data cannot tell from them: measured, ``scripts/score_success.py``, docs/diagnosis.md."""

# A direction this much weaker than the strongest is no direction.
_RANK = 1e-5
# What an exact twin leaves, of the signal.
EXACT = 1e-6


@dataclass(frozen=True, eq=False)
class Signal:
    """What an effect does to planned readings.

    Attributes:
        layout: the effect. shape: values of the shape parameters it was computed at.
        columns: (N, p) whitened change of each reading by each plausible size; 0 for shapes.
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
        """Squared signal to be expected of plausible sizes."""
        return float(np.sum(self.columns**2))

    @property
    def directions(self) -> int:
        """How many directions of its parameters show."""
        s = np.linalg.svd(self.columns, compute_uv=False)
        return max(1, int(np.sum(s > _RANK * s[0]))) if len(s) and s[0] > 0 else 1


@lru_cache(maxsize=256)
def needed(directions: int, tried: int) -> float:
    """Squared signal that a test finds: noncentrality for POWER at LEVEL/tried."""
    limit = stats.chi2.isf(LEVEL / tried, directions)
    return float(
        optimize.brentq(lambda nc: stats.ncx2.sf(limit, directions, nc) - POWER, 1e-6, 1e4)
    )


def signals(plan: Planned) -> tuple[dict[str, Signal], dict[str, Reason]]:
    """Signals of all effects of the catalogue, and why some have none."""
    found: dict[str, Signal] = {}
    missing: dict[str, Reason] = {}
    span = _of_model(plan)
    for candidate in candidates_for(plan.problem):
        layout = candidate.layout
        if layout.name in plan.base.terms:
            continue
        if candidate.why_not is not None:
            missing[layout.name] = candidate.why_not
            continue
        shape = _middle_shape(plan, layout)
        if shape is None:
            missing[layout.name] = Reason(Why.NOT_MOVED)
            continue
        found[layout.name] = Signal(layout, shape, beside(_columns(plan, layout, shape), span))
    return found, missing


def signals_like(plan: Planned, like: Mapping[str, Signal]) -> dict[str, Signal]:
    """Signals of the same effects, of the same sizes, in another plan."""
    span = _of_model(plan)
    return {
        name: Signal(s.layout, s.shape, beside(_columns(plan, s.layout, s.shape), span))
        for name, s in like.items()
    }


def _of_model(plan: Planned) -> Array:
    """Basis (N, k) of what the model's own effects can imitate: they are fitted along."""
    return basis(free_derivatives(plan.problem, plan.base.state))


def _middle_shape(plan: Planned, layout: Layout) -> dict[str, float] | None:
    shapes = layout.effect.shapes(plan.base.state.prediction.setup)
    return shapes[len(shapes) // 2] if shapes else None


def _columns(plan: Planned, layout: Layout, shape: dict[str, float]) -> Array:
    start = layout.start(shape)
    columns = amplitude_columns(plan.problem, plan.base, layout, start)
    # a length behind the exit point is only where friction is looked for: its own signal is
    # another effect's
    given = (start != layout.null) | layout.shape
    return np.asarray(np.where(given, 0.0, columns * layout.scale))


def left_over(g: Signal, h: Signal) -> float:
    """lam_gh: squared signal of g that h cannot imitate."""
    return imitation.left_over(g.columns, h.basis)


def joined(a: Mapping[str, Signal], b: Mapping[str, Signal]) -> dict[str, Signal]:
    """Signals of two sets of readings together; an effect that one lacks is 0 in it."""
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
