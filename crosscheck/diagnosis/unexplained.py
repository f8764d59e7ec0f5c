"""The diagnosis of data in which structure remains that no effect explains.

Of the effects that were added one at a time, those are listed that are small, have a plausible
size, remove most of what was unexplained, and do more than any smooth field over the workspace.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import takewhile

import numpy as np

from crosscheck.calibration.judgement.verdict import SURE
from crosscheck.calibration.search import SetSearch
from crosscheck.calibration.sets.equals import SMALL
from crosscheck.calibration.sets.linear_search import Names
from crosscheck.comparison.associations import Association, associations
from crosscheck.diagnosis.chances import Chances, chances_of
from crosscheck.diagnosis.listed import diagnosis_of, missing_of, not_listed
from crosscheck.diagnosis.result import Diagnosis, MissingEffect
from crosscheck.diagnosis.search import Search
from crosscheck.diagnosis.small import share_of, small_effects_alone, spoils
from crosscheck.diagnosis.words import and_what_is_left, none_of, words_of
from crosscheck.fit.effects.possible import is_plausible
from crosscheck.fit.least_squares.problem import KINDS, Rms, rms_by_kind
from crosscheck.fit.noise.smooth import beyond_smooth
from crosscheck.fit.preparation.prepare import noise_floor
from crosscheck.fit.reasons import DiagnosisVerdict

# Least part of the unexplained chi2 that a small effect must have removed to be listed; among small
# effects only, the part for the first one and that of the rest for each later one.
_LEAST_SHARE, _LEAST_ALONE = 0.5, (2.0 / 3.0, 1.0 / 3.0)
# Most quantities that the unexplained part is said to be associated with.
_MOST_WHERE = 5


def unexplained(found: Search, sought: SetSearch, notes: Sequence[str]) -> Diagnosis:
    """The diagnosis of a search that leaves structure.

    Args:
        found: the steps. sought: the compared sets. notes: notes to begin with.
    """
    chances = chances_of(sought)
    missing, shown = _warranted(found, chances, sought.outdone)
    found = shown if missing else found
    return diagnosis_of(
        DiagnosisVerdict.UNKNOWN_EFFECT,
        structure_words(missing, found.tried, chances),
        missing,
        found,
        before=rms_by_kind(found.problem, found.steps[0].fit.state.raw),
        floor=estimated_floor(sought),
        candidates=not_listed(found, [m.effect for m in missing]),
        notes=notes,
        chances=chances,
        shown=shown,
        where=where_of(shown),
    )


def estimated_floor(sought: SetSearch) -> Rms:
    """The rms errors of the noise at its estimated size.

    Beside something unknown it is no larger than assumed: the estimate takes what is unknown for
    noise, which would then never be large enough to matter.
    """
    floor = noise_floor(sought.calibration.setting.problem, sought.calibration.joint.state)
    scale = sought.found.best.joint.colour.scale
    if sought.judgement.verdict is DiagnosisVerdict.UNKNOWN_EFFECT:
        scale = np.minimum(scale, 1.0)
    return {
        kind.key: None if floor[kind.key] is None else float(scale[k]) * (floor[kind.key] or 0.0)
        for k, kind in enumerate(KINDS)
    }


def beside_imitated(found: Search, sought: SetSearch) -> SetSearch:
    """Compared sets with the small effects of the steps that are there beside something unknown.

    They may be listed though structure remains, and nothing unknown may stand in their place.
    """
    said, chances = sought.judgement, chances_of(sought)
    if said.imitated is None or said.sure:
        return sought
    own = sought.found.best.names - said.imitated.replaced - said.implausible
    missing, _search = _warranted(found, chances, sought.outdone)
    sure = tuple(m.effect for m in missing if m.effect in own and m.probability > SURE)
    return replace(sought, judgement=replace(said, sure=sure))


def _warranted(
    found: Search, chances: Chances, outdone: Names
) -> tuple[list[MissingEffect], Search]:
    """The effects that may be listed though structure remains, and the search up to these.

    None are of which something unknown leaves hardly anything.
    """

    def fine(name: str) -> bool:
        return name not in outdone and _is_warranted(found, name)

    # an effect that was found beside one that may not be listed may not be listed either
    first = list(takewhile(fine, found.found))
    if first:
        search: Search | None = replace(found, steps=found.steps[: 1 + len(first)])
    else:
        search = small_effects_alone(found, SMALL, _LEAST_ALONE)
    if search is None or outdone.intersection(search.found):
        return [], replace(found, steps=found.steps[:1])
    return [missing_of(search, name, chances) for name in search.found], search


def _is_warranted(found: Search, name: str) -> bool:
    index = 1 + found.found.index(name)
    before, step = found.steps[index - 1], found.steps[index]
    best, part = found.last.fit, found.last.fit.terms.part(name)
    few = len(best.terms[name].layout) <= SMALL and is_plausible(best.terms[name])
    stopped = bool(np.any(best.at_bound[part]))
    if not few or stopped or share_of(before, step) <= _LEAST_SHARE or spoils(before, step):
        return False
    # with a share of 0: all that the field leaves may be something unknown
    return beyond_smooth(found.problem, before.fit.state, step.fit.state, 0.0)


def structure_words(missing: Sequence[MissingEffect], tried: int, chances: Chances) -> str:
    """The sentence about structure that remains beside what is listed."""
    like = chances.looks_like
    if not missing:
        return f"Structure remains that {none_of(tried)}: an unknown effect is missing.{like}"
    left = "structure remains that no known effect explains"
    return and_what_is_left(words_of(missing), left, tried) + like


def where_of(found: Search) -> tuple[Association, ...]:
    """What the residuals of the last model are associated with."""
    last = found.last.fit.state
    return tuple(associations(found.problem, last.white, last.prediction)[:_MOST_WHERE])
