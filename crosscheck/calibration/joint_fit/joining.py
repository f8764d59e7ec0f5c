"""Effects that join the joint fit later: those with history, with shapes, and cables with weight.

Their derivatives need a walk through all rows, or only make sense at the right shape (a period, a
time constant). The residuals of the joint fit tell which of them are worth it, and at which shape.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from crosscheck.calibration.joint_fit.joint import JointFit, Setting
from crosscheck.calibration.linear_evidence.priors import widths_for
from crosscheck.calibration.linear_evidence.worth import log_gain
from crosscheck.fit.effects.candidates import input_lacking
from crosscheck.fit.least_squares.definite import root_beside_one
from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.least_squares.state import derivatives, evaluate
from seecr.effects import Term, catalogue, layout_of
from seecr.effects.base import Layout
from seecr.effects.setup import Setup
from seecr.pose import Array

# An effect joins if it gains this much ln evidence.
PAYS = 2.0


@dataclass(frozen=True, eq=False)
class Promising:
    """What an effect promises beside a joint fit.

    Attributes:
        term: the effect at its most promising shape, amplitudes at null.
        gain: ln evidence that it gains, averaged over its shapes.
        price: how much more ln evidence it gains at that shape than on average.
    """

    term: Term
    gain: float
    price: float


def layouts(problem: Problem) -> tuple[list[Layout], list[Layout]]:
    """The effects that are fitted from the start, and those that join later."""
    at_once: list[Layout] = []
    later: list[Layout] = []
    for effect in catalogue().values():
        layout = layout_of(effect, problem.robot)
        if layout.name in problem.considered and not input_lacking(problem.data, layout):
            (later if _waits(problem, layout) else at_once).append(layout)
    return at_once, later


def _waits(problem: Problem, layout: Layout) -> bool:
    if layout.shape.any():
        return True
    setup = _at_its_size(problem, layout)
    return bool(setup.has_history or np.any(setup.cable_weight))


def has_history(problem: Problem, layout: Layout) -> bool:
    """Whether an effect makes rows depend on those before them."""
    return bool(_at_its_size(problem, layout).has_history)


def _at_its_size(problem: Problem, layout: Layout) -> Setup:
    """The setup with an effect of its plausible size."""
    moved = np.clip(layout.null + layout.scale, layout.lower, layout.upper)
    return problem.experiment.setup([layout.build(moved)])


def promising_beside(setting: Setting, joint: JointFit, later: Sequence[Layout]) -> list[Promising]:
    """What each of these effects promises beside a joint fit, at its most promising shape."""
    beside = _Beside(setting, joint)
    out = []
    for layout in later:
        starts = [layout.start(s) for s in layout.effect.shapes(joint.state.prediction.setup)]
        if not starts:
            continue
        gains = [
            max(beside.gain(one), beside.gain_at_its_size(one))
            for one in (Term(layout, start) for start in starts)
        ]
        gain = float(np.logaddexp.reduce(gains) - np.log(len(gains)))
        term = Term(layout, starts[int(np.argmax(gains))])
        out.append(Promising(term, gain, max(gains) - gain))
    return out


def at_null(term: Term) -> Term:
    """An effect with its shape and its fixed values, all other parameters at null."""
    layout = term.layout
    held = layout.shape | term.knowledge.fixed
    return term.with_vector(np.where(held, term.vector, layout.null))


def inside(term: Term, by: float = 0.1) -> Term:
    """Move a start off its bound, where laws with history have two-sided derivatives.

    Args:
        term: the start. by: how far amplitudes at null are moved, in plausible sizes.
    """
    layout = term.layout
    at_bound = (term.vector <= layout.lower) & ~layout.shape & ~term.knowledge.fixed
    return term.with_vector(np.where(at_bound, term.vector + by * layout.scale, term.vector))


class _Beside:
    """What is left of additional columns beside those of a joint fit."""

    def __init__(self, setting: Setting, joint: JointFit) -> None:
        self.setting, self.joint = setting, joint
        self.left = joint.whitened(setting.chain, joint.state.white)
        self.columns = joint.whitened(setting.chain, joint.jacobian) * joint.width
        self.root = root_beside_one(self.columns)

    def gain(self, term: Term) -> float:
        """ln evidence that an effect's amplitudes at null gain, with all others integrated out."""
        return self._gain(term, added_columns(self.setting, self.joint, term))

    def gain_at_its_size(self, term: Term) -> float:
        """The same by what a plausible size changes, for one amplitude with no shape or history.

        Sag grows with the square of the weight: on a robot that only slides, its derivative at no
        weight says next to nothing.
        """
        setting, state, layout = self.setting, self.joint.state, term.layout
        if len(layout.names) != 1 or not amplitudes_at_null(term).all():
            return -np.inf
        if has_history(setting.problem, layout):
            return -np.inf
        there = term.with_vector(np.clip(layout.null + layout.scale, layout.lower, layout.upper))
        moved = evaluate(setting.problem, self.joint.terms.with_term(there), setting.factor, state)
        if not moved.valid:
            return -np.inf
        return self._gain(term, (state.white - moved.white)[:, None])

    def _gain(self, term: Term, columns: Array) -> float:
        """The ln evidence that columns (N, k) of an effect's amplitudes gain."""
        x = self.joint.whitened(self.setting.chain, columns)
        cross = linalg.solve_triangular(
            self.root, self.columns.T @ x, lower=True, check_finite=False
        )
        normal = x.T @ x - cross.T @ cross
        layout = term.layout
        one_sided = (layout.lower == layout.null)[amplitudes_at_null(term)]
        return log_gain(normal, x.T @ self.left, widths_for(layout, self.setting.free), one_sided)


def amplitudes(term: Term) -> NDArray[np.bool_]:
    """(p,) parameters that the linear model treats: neither shapes nor fixed ones."""
    return np.asarray(~term.layout.shape & ~term.knowledge.fixed)


def amplitudes_at_null(term: Term) -> NDArray[np.bool_]:
    """(p,) those of them that are at null."""
    return np.asarray(amplitudes(term) & (term.vector == term.layout.null))


def added_columns(setting: Setting, joint: JointFit, term: Term) -> Array:
    """(N, k) derivatives by z of those amplitudes of an added effect that are at null."""
    layout = term.layout
    own = np.flatnonzero(amplitudes_at_null(term))
    terms = joint.terms.with_term(term)
    state = joint.state.of(terms)
    wanted = (terms.part(term.name).start + own).tolist()
    return np.asarray(derivatives(setting.problem, state, wanted, frozen=True) * layout.scale[own])
