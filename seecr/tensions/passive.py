"""The balance of the driven cables alone: what passive lines pull is part of the load.

At a given pose their wrench is known, since their rest lengths are. Winches balance what is left.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from seecr.compiled.columns import ARM, EXTERNAL_FORCE, EXTERNAL_MOMENT, FORCE
from seecr.description.robot import Robot
from seecr.pose import Array, cross
from seecr.statics import batch
from seecr.statics.tables import Tables


def driven_tables(tables: Tables, robot: Robot) -> Tables:
    """The tables of the k driven cables, with the passive lines' wrench among the external ones.

    They hold at the poses of the tables alone, (n, k) cables. A robot without passive lines has
    the same tables.
    """
    if robot.all_driven:
        return tables
    others = replace(tables, cables=np.ascontiguousarray(tables.cables[:, ~robot.driven]))
    each = batch.rates_of_cables(others, batch.Evaluation.at_commands(others))
    force, arm = each[..., FORCE : FORCE + 3], each[..., ARM : ARM + 3]
    load = tables.load.copy()
    load[:, EXTERNAL_FORCE : EXTERNAL_FORCE + 3] += force.sum(axis=1)
    load[:, EXTERNAL_MOMENT : EXTERNAL_MOMENT + 3] += cross(arm, force).sum(axis=1)
    return replace(tables, cables=np.ascontiguousarray(tables.cables[:, robot.driven]), load=load)


def with_passive(robot: Robot, lengths: Array) -> Array:
    """Lengths (n, m) [m] of all lines, from those (n, k) of the driven ones."""
    if robot.all_driven:
        return lengths
    out = np.tile(robot.rest_lengths, (len(lengths), 1))
    out[:, robot.driven] = lengths
    return out
