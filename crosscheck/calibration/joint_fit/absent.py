"""Says which effects are not in the fit of all, and why."""

from __future__ import annotations

from collections.abc import Iterable

from crosscheck.calibration.joint_fit.all_effects import Calibration
from crosscheck.fit.effects.candidates import candidates_for
from crosscheck.fit.reasons import Reason, Why


def absent_effects(found: Calibration, kept: Iterable[str]) -> dict[str, Reason]:
    """The effects of the catalogue that a model of all effects does not have, with the reasons.

    Args:
        found: the fit of all effects.
        kept: names of those that the model has.
    """
    kept, fitted = set(kept), set(found.terms.names)
    out = {}
    for one in candidates_for(found.setting.problem):
        if one.name in kept:
            continue
        # effects with more parameters than rows are fitted all the same: their sizes hold them
        lacking = one.why_not if one.name not in fitted else None
        out[one.name] = lacking or Reason(Why.GAINS_NOTHING)
    return out
