"""The evidence that a parameter costs which cannot be negative and is stopped at zero.

Friction on a cable behind the exit point, with zero friction, is that cable alone. If both also had
the same evidence, then data that would show friction, and show none, could not tell them apart.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from crosscheck.calibration.joint_fit.joint import JointFit, Setting
from crosscheck.calibration.joint_fit.linearised import Linear
from crosscheck.fit.effects.evidence import WIDTHS, half_gaussian, held_at_nothing
from crosscheck.fit.least_squares.definite import inverse_of
from crosscheck.fit.least_squares.known import known_readings
from seecr.effects import Term
from seecr.pose import Array


def log_absent(
    setting: Setting, joint: JointFit, linear: Linear, widths: Mapping[str, float]
) -> float:
    """ln evidence that parameters stopped at zero cost beside the others; never above 0.

    Args:
        setting: the data.
        joint: a fit. linear: the model linearised about it.
        widths: prior widths of the effects that have free parameters.
    """
    held = held_at_nothing(joint.terms) & (joint.width > 0.0)
    if not held.any():
        return 0.0
    white = joint.whitened(setting.chain, joint.jacobian[:, held])
    x = np.concatenate([white, known_readings(joint.terms)[0][:, held]])
    wide = np.where(linear.width > 0.0, _each(joint, widths), 0.0)
    free = np.flatnonzero(wide > 0.0)
    columns = linear.x[:, free]
    inverse = inverse_of(columns.T @ columns + np.diag(wide[free] ** -2.0))
    cross = columns.T @ x
    left = linear.y - columns @ (inverse @ (columns.T @ linear.y))
    power = np.sum(x**2, axis=0) - np.sum(cross * (inverse @ cross), axis=0)
    # an optimum is pressed against the bound: what pulls away from it, the fit did not find
    along = np.minimum(x.T @ left, 0.0)
    of_parameter = zip(_owners(joint, held), np.maximum(power, 0.0), along, strict=True)
    return float(sum(_gain(p, a, widths.get(term.name)) for term, p, a in of_parameter))


def _gain(power: Array, along: Array, width: float | None) -> float:
    """Gain of one parameter; averaged over all widths if its effect has no free parameter."""
    every = np.array(WIDTHS if width is None else [width])
    return float(np.logaddexp.reduce(half_gaussian(power, along, every)) - np.log(len(every)))


def _each(joint: JointFit, widths: Mapping[str, float]) -> Array:
    """(p,) prior widths of the parameters; shapes keep those of the fit."""
    parts = [
        np.where(t.layout.shape, joint.width[joint.terms.part(t.name)], widths.get(t.name, 1.0))
        for t in joint.terms
    ]
    return np.concatenate([np.zeros(0), *parts])


def _owners(joint: JointFit, which: NDArray[np.bool_]) -> list[Term]:
    return [term for term in joint.terms for k in which[joint.terms.part(term.name)] if k]
