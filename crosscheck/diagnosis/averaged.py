"""How far values may be off because an effect that is not listed may be there all the same.

The errors of a fit hold if just the listed effects are missing. A heavier platform beside a wrong
length takes a part of what the length explains: if the data leave it a chance of 30 %, the length
is known no better than the two models agree on it. (Averaging over models, Hoeting et al. 1999.)
"""

from __future__ import annotations

import numpy as np

from crosscheck.diagnosis.chances import Chances
from crosscheck.fit.effects.gauss_newton import Fit
from crosscheck.fit.effects.systematic import moves_by_effect
from crosscheck.fit.least_squares.problem import Problem
from seecr.pose import Array

# What is less probable is outside an interval of 95 % whatever it does to a value.
_MATTERS = 0.05


def spread_by_others(problem: Problem, fit: Fit, chances: Chances) -> Array:
    """How far values (p,) are, rms, from those of models with a further effect, by its probability.

    Args:
        problem: the data. fit: the model with the listed effects.
        chances: probabilities; of a class the likeliest member stands for all.
    """
    likely = {
        members[0]: p
        for members, p in chances.classes
        if p > _MATTERS and not set(members) & set(fit.terms.names)
    }
    moves = moves_by_effect(problem, fit, likely) if likely else {}
    square = [likely[name] * move**2 for name, (_fall, move) in moves.items()]
    return np.asarray(np.sqrt(np.sum(square, axis=0))) if square else np.zeros(len(fit.terms))
