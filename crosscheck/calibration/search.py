"""From data to sets of effects: everything at once, then which of it is needed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crosscheck.calibration.calibrate import PLAIN, Calibration, Progress, calibrate
from crosscheck.calibration.catalogue import Catalogue
from crosscheck.calibration.field import UNKNOWN, log_odds
from crosscheck.calibration.judgement import Judgement, judge
from crosscheck.calibration.later import layouts, promising
from crosscheck.calibration.probability import Classes, all_scores, probabilities
from crosscheck.calibration.refits import Found, compare_sets
from crosscheck.fit.problem import Problem, kinds_read
from crosscheck.fit.state import evaluate
from crosscheck.measurements.data import Sigma
from seecr.effects import Term, Terms

# Sets refitted about one linear model; fewer where something unknown leaves no hope of an end.
_REFITTED, _REFITTED_UNKNOWN = 20, 6


@dataclass(frozen=True, eq=False)
class Sought:
    """The effects that data need.

    Attributes:
        calibration: everything at once. found: the sets compared.
        classes: probabilities. field_odds: ln odds of something smooth and unknown.
        judgement: the verdict.
    """

    calibration: Calibration
    found: Found
    classes: Classes
    field_odds: float
    judgement: Judgement


def seek(problem: Problem, stated: Sigma, progress: Progress = lambda _text, _part: None) -> Sought:
    """Fit everything at once, then compare sets of effects.

    Args:
        problem: readings, from :func:`crosscheck.fit.prepare.prepare`.
        stated: the noise that the user stated; what was estimated is missing in it.
        progress: called with what is being done and the part of it that is done.
    """
    whole = calibrate(problem, PLAIN, lambda text, part: progress(text, 0.4 * part))
    setting, joint = whole.setting, whole.joint
    every = all(getattr(stated, kind.sigma) is not None for kind in kinds_read(problem))
    odds = log_odds(setting, joint, every)
    at_once, later = layouts(problem)
    catalogue = Catalogue(
        Terms(Term(a, a.null) for a in at_once), Terms(promising(setting, joint, later))
    )
    plain = evaluate(problem, Terms(), setting.factor)
    most = _REFITTED if odds < UNKNOWN else _REFITTED_UNKNOWN
    found = compare_sets(
        setting, joint, catalogue, plain, lambda text: progress(f"trying {text}", 0.7), most
    )
    classes = probabilities(all_scores(found), found.best.names, catalogue.names)
    surprise = float(np.max(whole.held_out.surprise, initial=0.0))
    return Sought(whole, found, classes, odds, judge(found, classes, odds, surprise))
