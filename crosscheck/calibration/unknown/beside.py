"""A test for effects that are not in the catalogue: something that varies beside all that is.

What varies is a smooth field over the workspace, or something in time (a tracker or exit points
that move, readings that lag behind the last step). Each is compared with nothing by evidence, with
all effects integrated out and the noise re-estimated: what drifts looks like autocorrelated noise
to a fit that knows no drift. A higher evidence means that something remains that no effect of the
catalogue explains.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import special

from crosscheck.calibration.joint_fit.joint import JointFit, Setting
from crosscheck.calibration.joint_fit.linearised import Linear, unwhitened
from crosscheck.calibration.noise.colour import Colour
from crosscheck.calibration.noise.restricted import estimate, log_evidence
from crosscheck.calibration.unknown.field import FIELD_WIDTHS, UNKNOWN
from crosscheck.calibration.unknown.varying import Varying, in_all_readings, varying_in_time
from seecr.pose import Array
from seecr.processes import Shared, shared_out

# Prior standard deviation of ln(true sigma/stated sigma) if the noise was stated.
_STATED = 0.35
# Part of the prior of something unknown that a smooth field over the workspace has.
_SMOOTH = 0.5


@dataclass(frozen=True)
class UnknownOdds:
    """Something unknown beside a fit.

    Attributes:
        odds: its ln odds, with equal priors for something unknown and nothing.
        each: ln odds of all that may vary, each by itself.
    """

    odds: float
    each: dict[Varying, float] = field(default_factory=dict)

    @property
    def is_there(self) -> bool:
        """Whether something unknown is taken to be there."""
        return self.odds > UNKNOWN

    @property
    def likeliest(self) -> Varying | None:
        """What varies if it is something in time, and no smooth field; None if nothing is there."""
        if not self.is_there:
            return None
        first = max(self.each, key=lambda what: self.each[what])
        return None if first is Varying.READINGS else first


def unknown_beside(setting: Setting, joint: JointFit, stated: bool = True) -> UnknownOdds:
    """Compare all that may vary beside a fit with nothing, its effects integrated out.

    Args:
        setting, joint: the fit.
        stated: whether the size of the noise was stated.
    """
    return _Comparison(setting, joint, unwhitened(joint), stated).of_all()


@dataclass(frozen=True, eq=False)
class _Comparison:
    """Evidence of a fit with further columns; arguments as in :func:`unknown_beside`."""

    setting: Setting
    joint: JointFit
    about: Linear
    stated: bool

    def of_all(self) -> UnknownOdds:
        """The odds of everything that may vary."""
        some = [
            (Varying.READINGS, in_all_readings(self.setting, self.joint)),
            *varying_in_time(self.setting, self.joint),
        ]
        nothing = np.zeros((len(self.about.y), 0))
        columns = [nothing, *(part for _what, part in some)]
        without, *beside = shared_out(self._log_evidence, columns, Shared)
        each = dict[Varying, float]()
        for (what, _part), found in zip(some, beside, strict=True):
            each[what] = max(found - without, each.get(what, -np.inf))
        share = {what: (1.0 - _SMOOTH) / (len(each) - 1) for what in each if len(each) > 1}
        share[Varying.READINGS] = _SMOOTH if len(each) > 1 else 1.0
        total = special.logsumexp(list(each.values()), b=[share[what] for what in each])
        return UnknownOdds(float(total), each)

    def _log_evidence(self, columns: Array) -> float:
        """ln evidence with columns (N, k), averaged over prior widths; with none there are none."""
        found = self._scores(columns, FIELD_WIDTHS if columns.shape[1] else (1.0,))
        return float(np.logaddexp.reduce(found) - np.log(len(found)))

    def _scores(self, columns: Array, some: Sequence[float]) -> list[float]:
        """ln evidence with columns (N, k) of some prior widths.

        With the noise of the fit or as it is estimated beside the columns, whichever explains more:
        that of the fit may be the noise beside other effects.
        """
        setting, joint, free = self.setting, self.joint, self.about.width > 0.0
        x, y = np.concatenate([self.about.x[:, free], columns], axis=1), self.about.y

        def widths(width: float) -> Array:
            return np.concatenate([self.about.width[free], np.full(columns.shape[1], width)])

        def score(width: float, colour: Colour) -> float:
            total = log_evidence(setting.chain, colour, joint.weight, x, y, widths(width))
            off = np.log(colour.scale[np.unique(setting.chain.kind)])
            return total - (0.5 * float(np.sum((off / _STATED) ** 2)) if self.stated else 0.0)

        tried = [score(width, joint.colour) for width in some]
        best = some[int(np.argmax(tried))]
        own = estimate(setting.chain, joint.colour, joint.weight, x, y, widths(best))
        return [max(score(w, own), t) for w, t in zip(some, tried, strict=True)]
