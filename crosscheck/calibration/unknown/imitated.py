"""Tests whether known effects imitate something unknown: a field in place of some of them.

Members of the best set may have absorbed an unknown effect, and a field beside them then has
nothing left to explain: a tracker image that widens can look like a length scale with eccentric
drums. So a field is also tried in place of members, one for each thing that may change over the
workspace (:mod:`crosscheck.calibration.unknown.varying`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from scipy import special

from crosscheck.calibration.joint_fit.joint import JointFit, Setting
from crosscheck.calibration.joint_fit.linearised import column_groups, linearised
from crosscheck.calibration.linear_evidence.gram import (
    ColumnGroup,
    Gram,
    Solved,
    averaging,
    gram_of,
)
from crosscheck.calibration.linear_evidence.priors import widths_for
from crosscheck.calibration.sets.exact import own_readings
from crosscheck.calibration.sets.linear_search import Names, Scores
from crosscheck.calibration.unknown.field import FIELD_WIDTHS, UNKNOWN
from crosscheck.calibration.unknown.varying import Varying, varying
from seecr.processes import Shared, shared_out

# Fields that are worth so much less ln evidence than the best one are left out. It is large, and so
# many are told: what is really there follows none of them exactly, and then odds tell little.
_NEGLIGIBLE, _MOST_SEEN = 20.0, 3
# From this probability of a field on, it is open whether the members that it could replace are
# there: in the place of members that are, a field hardly ever explains as much (in 34 diagnoses of
# known effects alone, with odds of 0.5 at most, which are 1 %). From _DOUBT on it is told.
_OPEN, _DOUBT = 0.25, 0.05


@dataclass(frozen=True, eq=False)
class Imitated:
    """A field in place of some members of a set, or of none.

    Attributes:
        odds: ln odds of the field with the rest of the set over the whole set, with equal priors
            for an unknown effect and none; -inf if the set has no members of its own.
        replaced: the members that the field replaces.
        seen: what the field changes, the likeliest first; empty if no field was tried.
        worth: ln evidence that each other member is worth beside the field.
    """

    odds: float
    replaced: Names
    seen: tuple[Varying, ...] = ()
    worth: Mapping[str, float] = field(default_factory=dict)

    @property
    def words(self) -> str:
        """What the field changes; several where these data cannot tell which."""
        return "; or ".join(self.seen)

    @property
    def probability(self) -> float:
        """Posterior probability of the field with prior odds of e^-5."""
        return float(special.expit(self.odds - UNKNOWN))

    @property
    def chance(self) -> float:
        """The probability, or 0 if it is too small to leave the members it replaces open."""
        return self.probability if self.probability > _OPEN else 0.0

    @property
    def is_likelier(self) -> bool:
        """Whether the field is likelier than the members it replaces."""
        return self.odds > UNKNOWN

    @property
    def is_doubt(self) -> bool:
        """Whether the field is much less likely than these members, but not excluded."""
        return not self.chance and self.probability > _DOUBT


NOT_ASKED = Imitated(-np.inf, frozenset())


def field_in_place(
    setting: Setting, joint: JointFit, widths: Mapping[str, float], scores: Scores
) -> Imitated:
    """The members of a set that a field replaces best.

    Members that cost more evidence than they gain are dropped first. The others are dropped one
    after the other, each time the one whose loss costs least beside a field.

    Args:
        setting, joint: the data, and the fit of the set.
        widths: prior width of each member.
        scores: priors of sets, and the effects that the model has already.
    """
    sets, best = _Sets.of(setting, joint, widths, scores), NOT_ASKED
    whole = rest = sets.needed(frozenset(joint.terms.names))
    without = sets.whole(whole)
    while sets.fields and rest - scores.always:
        fewer = [rest - {name} for name in sorted(rest - scores.always)]
        tried = shared_out(sets.beside, fewer, Shared)
        k = max(range(len(tried)), key=lambda k: tried[k][0])
        rest, (total, seen) = fewer[k], tried[k]
        if total - without > best.odds:
            best = Imitated(total - without, whole - rest, seen)
    if not best.chance:
        return best
    rest, total = whole - best.replaced, without + best.odds
    return replace(best, worth=sets.worths_beside(rest, total))


def field_beside(
    setting: Setting, joint: JointFit, widths: Mapping[str, float], scores: Scores
) -> Imitated:
    """A field beside a set, in place of no member, and what each member is worth beside it.

    Members that cost more evidence than they gain are left out. Args: as in
    :func:`field_in_place`.
    """
    sets = _Sets.of(setting, joint, widths, scores)
    whole = sets.needed(frozenset(joint.terms.names))
    if not sets.fields or not whole - scores.always:
        return NOT_ASKED
    total, seen = sets.beside(whole)
    worth = sets.worths_beside(whole, total)
    return Imitated(total - sets.whole(whole), frozenset(), seen, worth)


@dataclass(frozen=True, eq=False)
class _Sets:
    """Subsets of a set in the model linearised about it, with and without a field.

    Attributes:
        gram: normal equations of its members and of all fields.
        fields: what each field varies, by its name in the normal equations.
        scores: priors of sets.
        chosen: prior width of each member.
        averaged: how much averaging over widths changes ln Z, by member. Both stay the same in
            subsets: with a wider prior, each member by itself would absorb what only the members
            left out explain.
    """

    gram: Gram
    fields: Mapping[str, Varying]
    scores: Scores
    chosen: Mapping[str, float]
    averaged: Mapping[str, float]

    @classmethod
    def of(
        cls, setting: Setting, joint: JointFit, widths: Mapping[str, float], scores: Scores
    ) -> _Sets:
        """The subsets of a set that was fitted."""
        gram, fields = _with_fields(setting, joint)
        chosen = {n: widths.get(n, 1.0) for n in gram.names if n in joint.terms.names}
        solved = gram.solved(chosen)
        averaged = {name: averaging(solved, name) for name in chosen}
        return cls(gram, fields, scores, chosen, averaged)

    def needed(self, names: Names) -> Names:
        """The subset that is left when members are dropped that cost more than they explain."""
        while some := sorted(names - self.scores.always):
            fewer = max((names - {name} for name in some), key=self.whole)
            if self.whole(fewer) < self.whole(names):
                break
            names = fewer
        return names

    def whole(self, names: Names) -> float:
        """ln evidence plus ln prior of a subset."""
        return self._solved(names).log_evidence + self._before(names)

    def beside(self, names: Names) -> tuple[float, tuple[Varying, ...]]:
        """The same with a field, averaged over all fields, and what is likely to vary."""
        own, every = self._solved(names), dict.fromkeys(self.fields, -np.inf)
        gains = {name: own.gains(name) for name in self.fields}
        least = max(float(gain.max()) for gain in gains.values()) - _NEGLIGIBLE
        for name, gain in gains.items():
            if gain.max() < least:
                continue
            width = self.gram.groups[name].widths[int(np.argmax(gain))]
            # solve with the field: a member that cannot be negative may be so without it
            there = self.gram.solved({**own.chosen, name: float(width)})
            every[name] = there.log_evidence + averaging(there, name)
        total = float(np.logaddexp.reduce(list(every.values())) - np.log(len(every)))
        return total + self._before(names), self._likely(every)

    def worths_beside(self, names: Names, total: float) -> dict[str, float]:
        """ln evidence that each member of a subset is worth beside a field.

        Args:
            names: the subset. total: what :meth:`beside` gives for it.
        """
        own = sorted(names - self.scores.always)
        fewer = [names - {name} for name in own]
        totals = [one for one, _seen in shared_out(self.beside, fewer, Shared)]
        return {name: total - one for name, one in zip(own, totals, strict=True)}

    def _likely(self, every: Mapping[str, float]) -> tuple[Varying, ...]:
        """What is likely to vary, the likeliest first, by the ln evidence of each field."""
        by = dict[Varying, list[float]]()
        for name, part in every.items():
            by.setdefault(self.fields[name], []).append(part)
        total = {what: float(np.logaddexp.reduce(parts)) for what, parts in by.items()}
        order = sorted(total, key=lambda what: -total[what])[:_MOST_SEEN]
        return tuple(what for what in order if total[what] > total[order[0]] - _NEGLIGIBLE)

    def _solved(self, names: Names) -> Solved:
        return self.gram.solved({n: w for n, w in self.chosen.items() if n in names})

    def _before(self, names: Names) -> float:
        """ln prior of a subset, with the corrections for averaging over widths and shapes."""
        price = sum(self.scores.price(name) for name in names)
        return self.scores.log_prior(names) - price + sum(self.averaged.get(n, 0.0) for n in names)


def _with_fields(setting: Setting, joint: JointFit) -> tuple[Gram, dict[str, Varying]]:
    """Normal equations of a fit's own effects and of all fields; what each field varies."""
    linear, groups = (
        linearised(setting, joint),
        column_groups(joint, partial(widths_for, free=setting.free)),
    )
    y = own_readings(linear, joint, groups)
    fields, first = dict[str, ColumnGroup](), linear.x.shape[1]
    named = {f"field {k}": one for k, one in enumerate(varying(setting, joint))}
    for name, (_what, part) in named.items():
        own = first + np.arange(part.shape[1])
        fields[name] = ColumnGroup(own, np.array(FIELD_WIDTHS))
        first += part.shape[1]
    parts = (part for _what, part in named.values())
    columns = np.concatenate([np.zeros((len(joint.state.white), 0)), *parts], axis=1)
    # independent measurements come last, and no field moves them
    known = np.zeros((len(linear.y) - len(columns), columns.shape[1]))
    white = np.concatenate([joint.whitened(setting.chain, columns), known])
    return gram_of(np.concatenate([linear.x, white], axis=1), y, groups | fields), {
        name: what for name, (what, _part) in named.items()
    }
