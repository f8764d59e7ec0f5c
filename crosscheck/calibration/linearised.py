"""A joint fit as a linear model about its optimum: white columns, readings, effects as groups.

A parameter on its bound is not at the optimum that linear algebra is about, and one that is held
is not fitted: both stay where they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crosscheck.calibration.colour import whitened
from crosscheck.calibration.gram import ColumnGroup
from crosscheck.calibration.joint import JointFit, Setting
from seecr.effects.base import Layout
from seecr.pose import Array


@dataclass(frozen=True, eq=False)
class Linear:
    """y = X z + white noise, about an optimum.

    Attributes:
        x: (N, p) derivatives by z; columns of parameters that stay are 0.
        y: (N,) residuals plus what the parameters that are free explain.
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
    """The linear model in units of the stated noise, its correlation left in."""
    free = free_of(joint)
    x = joint.jacobian * free
    return Linear(x, joint.state.white + x @ joint.z, joint.width * free)


def linearised(setting: Setting, joint: JointFit) -> Linear:
    """The linear model with the noise made white."""
    about = unwhitened(joint)
    chain, colour, weight = setting.chain, joint.colour, joint.weight
    return Linear(
        whitened(chain, colour, weight, about.x),
        whitened(chain, colour, weight, about.y),
        about.width,
    )


def groups_of(joint: JointFit, widths: Callable[[Layout], Array]) -> dict[str, ColumnGroup]:
    """The columns of each effect that are free and no shapes, with the widths they may have."""
    free = free_of(joint)
    out = {}
    for term in joint.terms:
        layout = term.layout
        own = np.flatnonzero(joint.terms.own(term.name))
        own = own[free[own] & ~layout.shape]
        if len(own):
            one_sided = len(own) == 1 and bool(layout.lower[0] == layout.null[0])
            out[term.name] = ColumnGroup(own, widths(layout), one_sided)
    return out
