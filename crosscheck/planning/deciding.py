"""What to measure to find out which of several models a robot has, if all explain its data."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

from crosscheck.fit.least_squares.state import evaluate
from crosscheck.planning.adding import Adding, Extension
from crosscheck.planning.planned import Planned
from crosscheck.planning.proposer import GAINS, NEEDED, Gain, Suggestion
from seecr.effects import Terms


def telling_models_apart(
    plan: Planned, options: Sequence[Extension], models: Sequence[Terms]
) -> list[Suggestion]:
    """Measurements that tell every two of some models apart, the strongest first.

    Added poses are not among them: models that agree at many poses differ little at a few more.

    Args:
        plan: the data.
        options: :func:`crosscheck.planning.extensions.extensions`.
        models: two or more, each with the values that explain the data.
    """
    now, out = _least_signal(plan, models), []
    for option in options:
        then = _least_signal(option.plan, models) if option.kind is not Adding.POSES else 0.0
        if then >= max(NEEDED, GAINS * now):
            out.append(Suggestion(option.kind, option.words, (Gain("", "", now, then, NEEDED),)))
    return sorted(out, key=lambda one: -one.gains[0].then)


def _least_signal(plan: Planned, models: Sequence[Terms]) -> float:
    """Squared difference of what two models predict, in units of the noise: of the closest two."""
    states = [evaluate(plan.problem, terms, plan.factor) for terms in models]
    if not all(state.valid for state in states):
        return 0.0
    pairs = combinations([state.white for state in states], 2)
    return min((float((one - other) @ (one - other)) for one, other in pairs), default=0.0)
