"""What it costs that a parameter which cannot be negative is nothing, where it could be there.

Friction on a cable behind the exit point, with no friction, is that cable alone: if its evidence
were too, data that show friction and show none could not tell the two apart.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy import special

from crosscheck.calibration.joint import JointFit, Setting
from crosscheck.calibration.linearised import Linear
from crosscheck.fit.definite import inverse_of
from crosscheck.fit.evidence import WIDTHS, half_gaussian, held_at_nothing
from crosscheck.fit.known import known_readings
from seecr.effects import Term
from seecr.pose import Array


def log_absent(
    setting: Setting, joint: JointFit, linear: Linear, widths: Mapping[str, float]
) -> float:
    """ln evidence that parameters at nothing take off that of the others, at most about 0.

    Args:
        setting: the data.
        joint: a fit. linear: the model about it.
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
    along = x.T @ left
    of_parameter = zip(_owners(joint, held), np.maximum(power, 0.0), along, strict=True)
    return float(sum(_gain(p, a, widths.get(term.name)) for term, p, a in of_parameter))


def _gain(power: Array, along: Array, width: float | None) -> float:
    """Of one parameter; an effect that is nothing altogether may have any width."""
    every = np.array(WIDTHS if width is None else [width])
    return float(special.logsumexp(half_gaussian(power, along, every)) - np.log(len(every)))


def _each(joint: JointFit, widths: Mapping[str, float]) -> Array:
    """(p,) prior widths of the parameters; those of shapes are their own."""
    parts = [
        np.where(t.layout.shape, joint.width[joint.terms.part(t.name)], widths.get(t.name, 1.0))
        for t in joint.terms
    ]
    return np.concatenate([np.zeros(0), *parts])


def _owners(joint: JointFit, which: NDArray[np.bool_]) -> list[Term]:
    return [term for term in joint.terms for k in which[joint.terms.part(term.name)] if k]
