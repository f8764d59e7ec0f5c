"""The kinds of measurements that could be added, each with words and a plan of its readings."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TypeAlias

import numpy as np

from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.planning.planned import Planned, Reads, planned
from seecr.pose import Array

Limits: TypeAlias = tuple[float, float]
NO_LIMITS: Limits = (0.0, np.inf)
"""Lowest and highest tension [N]."""


MORE_POSES = 6
"""Most poses that are added."""


class Adding(StrEnum):
    """Kinds of measurements that could be added, in the words of ``plan.json``."""

    TENSIONS = "tensions"
    POSE = "pose"
    PAYLOAD = "payload"
    PAYLOAD_ASIDE = "payload_aside"
    WAY_BACK = "way_back"
    WAY_POINTS = "way_points"
    LATER = "later"
    POSES = "poses"


@dataclass(frozen=True, eq=False)
class Extension:
    """Readings that could be added.

    Attributes:
        kind: what is added. words: what to do. plan: the added readings.
        poses: (k, 7) commanded poses, if poses are added.
    """

    kind: Adding
    words: str
    plan: Planned
    poses: Array | None = None


def like(
    plan: Planned, data: Measurements, reads: Reads | None = None, sigma: Sigma | None = None
) -> Planned:
    """A plan with other rows or sensors, everything else unchanged."""
    return planned(
        plan.problem.robot, data, sigma or plan.problem.sigma, reads or plan.reads,
        plan.base.terms,
    )  # fmt: skip
