"""The kinds of reading: position, orientation and tension, in SI and as people read them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crosscheck.fit.problem import ORIENTATION, POSITION, TENSION, Problem
from crosscheck.numbers import in_unit
from seecr.pose import Array

Rms = dict[str, float | None]


@dataclass(frozen=True)
class Kind:
    """A kind of reading.

    Attributes:
        name: in words. key: of its rms errors. sigma: name of its noise in :class:`Sigma`.
        columns: of the residuals. si: its unit.
    """

    name: str
    key: str
    sigma: str
    columns: slice
    si: str

    @property
    def factor(self) -> float:
        """From SI to ``unit``."""
        return in_unit(self.si)[0]

    @property
    def unit(self) -> str:
        """The unit people read it in."""
        return in_unit(self.si)[1]

    def sizes(self, problem: Problem, raw: Array) -> Array:
        """(n,) size of each row's error: length of the vector, or the largest tension; SI.

        Args:
            problem: which readings count.
            raw: (n, 6 + m) residuals.

        Returns:
            NaN where nothing of the kind was read or the row does not count.
        """
        some = problem.counted[:, self.columns]
        part = np.where(some, raw[:, self.columns], 0.0)
        if self.name == "tension":
            size = np.max(np.abs(part), axis=1, initial=0.0)
        else:
            size = np.linalg.norm(part, axis=1)
        return np.where(some.any(axis=1), size, np.nan)


KINDS = (
    Kind("position", "position_rms_m", "position_m", POSITION, "m"),
    Kind("orientation", "orientation_rms_rad", "orientation_rad", ORIENTATION, "rad"),
    Kind("tension", "tension_rms_N", "tension_N", TENSION, "N"),
)
BY_NAME = {kind.name: kind for kind in KINDS}


def kinds_read(problem: Problem) -> list[Kind]:
    """Kinds of reading that the data hold."""
    return [kind for kind in KINDS if problem.counted[:, kind.columns].any()]


def rms_by_kind(problem: Problem, raw: Array) -> Rms:
    """Root mean square of the counted residuals: position [m], orientation [rad], tension [N].

    Of single components, so that noise alone gives its sigma; None where nothing was read.
    """
    out: Rms = {}
    for kind in KINDS:
        values = raw[:, kind.columns][problem.counted[:, kind.columns]]
        out[kind.key] = float(np.sqrt((values**2).mean())) if len(values) else None
    return out
