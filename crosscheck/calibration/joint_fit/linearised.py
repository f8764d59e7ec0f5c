"""Linearises a joint fit about its optimum: whitened columns, readings, effects as groups.

Parameters on a bound are not at the optimum that the linear model assumes, and held ones are not
fitted: both stay where they are. Independent measurements count as readings.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crosscheck.calibration.joint_fit.joint import JointFit, Setting
from crosscheck.calibration.linear_evidence.gram import ColumnGroup
from crosscheck.fit.least_squares.definite import solved
from crosscheck.fit.least_squares.known import known_left, known_readings
from seecr.effects.base import Layout
from seecr.pose import Array


@dataclass(frozen=True, eq=False)
class Linear:
    """y = X z + white noise, about an optimum.

    Attributes:
        x: (N, p) derivatives by z; 0 for parameters that stay.
        y: (N,) residuals plus the signal of the free parameters.
        width: (p,) prior standard deviations of z; 0 for parameters that stay.
    """

    x: Array
    y: Array
    width: Array


def free_of(joint: JointFit) -> NDArray[np.bool_]:
    """(p,) parameters that are neither held nor on a bound."""
    terms = joint.terms
    on_bound = (terms.vector <= terms.lower) | (terms.vector >= terms.upper)
    return np.asarray((joint.width > 0.0) & ~on_bound)


def unwhitened(joint: JointFit) -> Linear:
    """The linear model in units of the stated noise, with the autocorrelation left in.

    Independent measurements enter the prior: they narrow it and move its mean, and ``y`` with it.
    """
    free = free_of(joint)
    x, width = joint.jacobian * free, joint.width * free
    columns, readings = known_readings(joint.terms)
    power = np.sum(columns**2, axis=0)
    inverse2 = np.divide(1.0, width**2, out=np.zeros_like(width), where=free)
    narrow = np.where(free, 1.0 / np.sqrt(np.maximum(inverse2 + power, 1e-300)), 0.0)
    middle = narrow**2 * (columns.T @ readings)
    return Linear(x, joint.state.white + x @ (joint.z - middle), narrow)


def linearised(setting: Setting, joint: JointFit) -> Linear:
    """The linear model with whitened noise; independent measurements are its last readings."""
    free = free_of(joint)
    chain = setting.chain
    columns = known_readings(joint.terms)[0] * free
    x = np.concatenate([joint.whitened(chain, joint.jacobian * free), columns])
    left = np.concatenate([joint.whitened(chain, joint.state.white), known_left(joint.terms)])
    return Linear(x, left + x @ joint.z, joint.width * free)


def left_to_gain(linear: Linear, z: Array) -> float:
    """How much further the objective would fall from z (p,) if the model were linear.

    It is next to nothing where a fit converged, unless its derivatives point the wrong way: the sag
    of a cable grows with the square of its weight.
    """
    free = linear.width > 0.0
    x, inverse2 = linear.x[:, free], linear.width[free] ** -2.0
    slope = x.T @ (linear.y - linear.x @ z) - z[free] * inverse2
    return float(slope @ solved(x.T @ x + np.diag(inverse2), slope))


def column_groups(joint: JointFit, widths: Callable[[Layout], Array]) -> dict[str, ColumnGroup]:
    """The free columns of each effect without shapes, with the prior widths it may have."""
    free = free_of(joint)
    out = {}
    for term in joint.terms:
        layout = term.layout
        own = np.flatnonzero(joint.terms.own(term.name))
        own = own[free[own] & ~layout.shape]
        if len(own):
            first = joint.terms.part(term.name).start
            one_sided = (layout.lower == layout.null)[own - first]
            out[term.name] = ColumnGroup(own, widths(layout), one_sided)
    return out
