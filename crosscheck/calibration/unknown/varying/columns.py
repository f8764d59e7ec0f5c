"""Columns of what changes readings: derivatives by an effect, products with shapes, their size."""

from __future__ import annotations

import numpy as np

from crosscheck.calibration.joint_fit.joint import JointFit, Setting
from crosscheck.fit.least_squares.state import derivatives
from seecr.effects import Term, Terms, catalogue, layout_of
from seecr.pose import Array

SMOOTH = 0.3
"""Prior width of each degree of a smooth field over that of the degree before."""


def rates_by(setting: Setting, joint: JointFit, name: str) -> Array:
    """(N, k) derivatives of the readings by the parameters of an effect at null."""
    layout = layout_of(catalogue()[name], setting.problem.robot)
    terms = Terms([*joint.terms.without(name), Term(layout, layout.null)])
    rates = derivatives(setting.problem, joint.state.of(terms), frozen=True)
    return np.asarray(rates[:, terms.own(name)])


def products(columns: Array, shapes: Array) -> Array:
    """(N, k l) products of each column (N, k) with each shape (N, l)."""
    return np.asarray((columns[:, :, None] * shapes[:, None, :]).reshape(len(columns), -1))


def in_units_of_noise(columns: Array) -> Array:
    """Columns (N, k), scaled so that all together move a reading by its noise, in the rms."""
    power = float(np.sum(columns**2)) / max(len(columns), 1)
    return columns / np.sqrt(power) if power > 0.0 else columns
