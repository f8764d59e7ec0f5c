"""Searches hypotheses: linear evidence about a fit proposes, exact fits decide.

All fits go into one cache. About a fit, the linear model of the whole catalogue
(:class:`crosscheck.inference.about.About`) gives the evidence of any hypothesis by linear
algebra; adding, dropping and exchanging members climbs from the model as it stands and from the
fit itself. What the climb meets with a score within WITHIN of its best is fitted exactly, and the
search goes on about the best fit of all until it stays the best.

Single effects are fitted first, from the model as it stands: where cables go slack or the noise of
the plain model is a hundred times the stated, its linear model ranks sets wrongly, and one effect
that removes most of the error makes it right. So does the fit of all effects together, which is
made where no few effects leave noise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from crosscheck.fit.problem import KINDS
from crosscheck.fit.registration import registered, registered_each
from crosscheck.fit.state import State
from crosscheck.inference.about import About, inside
from crosscheck.inference.catalogue import Catalogue, Key, bare, is_field, name_of, part_of
from crosscheck.inference.fit import TRACKER, Data, Fit, cooled, fit, unfitted
from crosscheck.inference.hypothesis import Hypothesis, scored, wider
from crosscheck.inference.noise import Noise, NoisePrior
from crosscheck.inference.priors import EQUAL, FEW, MAY_BE_UNKNOWN, WITHIN
from crosscheck.inference.scores import LARGE, Scores, ranked
from seecr.effects import Term
from seecr.pose import Array

# Single effects that are fitted beside a model, and how many of these are searched about.
_SINGLES, _BEAM = 4, 2
# Fields that are tried beside a set.
_FIELDS = 2
# Parts of the way to the linear values at which fits may begin: one that explains less than the
# model as it stands leads nowhere.
_PARTS = (1.0, 0.3, 0.1)
# A fit that is worse than promised by this much may be in a local minimum.
_MINIMUM = 8.0
# An effect that waits joins the fit of all effects if it promises this much ln evidence.
_PAYS = 2.0
# Fits of more effects than are a diagnosis take longer, and only what all of them do together is
# asked of them: one counts as so many.
_LONG = 4
# Effort: most hypotheses that are fitted about one linear model, and most linear models about
# better and better hypotheses.
_FITS, _ROUNDS = 8, 4
# Sets with one more member that promises to lose, which are fitted all the same: with its own noise
# the member may explain more. The linear model about the smaller set is good enough for others.
_LOSING = 2
# Most fits of one hypothesis: the second with the prior widths that the first asks for.
_REFITS = 2


@dataclass(eq=False)
class Search:
    """The search of one diagnosis, with its cache of fitted hypotheses.

    Attributes:
        data: what is fitted. every: the catalogue. report: called with what is being fitted.
        cache: fitted hypotheses; None for one that has no solution.
    """

    data: Data
    every: Catalogue
    report: Callable[[str], None] = lambda _text: None
    cache: dict[Key, Hypothesis | None] = field(default_factory=dict)
    _centres: list[Key] = field(default_factory=list)
    _again: set[tuple[Key, Key]] = field(default_factory=set)
    _challenged: dict[Key, tuple[Key, float]] = field(default_factory=dict)

    @property
    def stood(self) -> Key:
        """The hypothesis that nothing is missing."""
        return self.every.stood_keys

    @property
    def fitted(self) -> dict[Key, Hypothesis]:
        """The hypotheses that a robot can have."""
        return {k: h for k, h in self.cache.items() if h is not None and h.possible}

    @property
    def best(self) -> Hypothesis:
        """The best hypothesis."""
        return max(self.fitted.values(), key=lambda h: (h.score, sorted(h.key)))

    @cached_property
    def plain(self) -> State:
        """The model as it stands."""
        return self.data.state(self.every.stood)

    @cached_property
    def unfitted(self) -> Fit:
        """The model as it stands, in the form of a fit."""
        return unfitted(self.data, self.every.stood, self.plain)

    @cached_property
    def none_about(self) -> About:
        """What every member does about the model as it stands."""
        return About(self.every, self.none.fit)

    @property
    def none(self) -> Hypothesis:
        """The hypothesis that nothing is missing, as fitted."""
        return self.at(self.stood)

    def at(self, key: Key) -> Hypothesis:
        """A fitted hypothesis."""
        found = self.cache[key]
        assert found is not None
        return found

    def begin(self) -> Hypothesis:
        """Fit the model as it stands, which is returned, and single effects beside it."""
        none = self._take(
            scored(self.every, self.stood, self._fitted(self.stood, self.plain, {}), {})
        )
        self._register()
        self._singles(self.best)
        self._ask_rows_far_off(none)
        return none

    def _ask_rows_far_off(self, found: Hypothesis) -> None:
        """Try what outliers ask for: they may be no outliers, but what is missing in some rows."""
        if found.fit.outlying.any():
            self._singles(_with_rows_alike(found), forms=True)

    def _ask_fields_of_rows_far_off(self) -> None:
        """Try beside the best what something unknown would do in rows that now hardly count."""
        best = self.best
        if best.field is None and best.fit.outlying.any():
            scores = self.scores_about(_with_rows_alike(best))
            near = scores.with_fields(best.key)
            for key in ranked(near)[:_FIELDS]:
                self.fit(scores, key)

    def run(self) -> Hypothesis:
        """Search until the best hypothesis stays the best."""
        none = self.begin()
        self.every = self.every.with_fields(none.fit)
        self._general_fields(none)
        alone = {k: h.score for k, h in self.fitted.items() if h.score > none.score + WITHIN}
        for one in [self.fitted[key] for key in ranked(alone)[:_BEAM]]:
            self.look_about(one)
        self._settle()
        if self.is_open:
            self.look_about(self.everything)
            self._settle()
        self._close()
        return self.best

    @property
    def is_open(self) -> bool:
        """Whether no few effects leave noise as stated: then all are fitted together as well."""
        best = self.best
        return (
            best.field is not None
            or len(best.key - self.stood) > FEW
            or NoisePrior.of(self.data.problem).is_unknown(best.fit.noise) > MAY_BE_UNKNOWN
        )

    def _settle(self) -> None:
        for k in range(_ROUNDS):
            if self.best.field is None:
                self._ask_rows_far_off(self.best)
            many = len(bare(self.best.key) - self.stood) > FEW
            if self.best.key in self._centres or (many and k >= _ROUNDS // 2):
                break
            if self._is_endless(self.best.key):
                break
            self.look_about(self.best)

    # --- one hypothesis ---

    def fit(self, scores: Scores, key: Key, width: float | None = None) -> Hypothesis | None:
        """Fit a hypothesis exactly from its values in a linear model; the best fit is kept.

        Args:
            scores: the linear model. key: the hypothesis.
            width: prior width of all its effects; by default those of greatest linear evidence.
        """
        widths = {k: w if width is None else width for k, w in scores.widths(key).items()}
        starts = []
        for part in _PARTS:
            values = scores.about.values(scores.solved[key][1], part)
            starts.append(self._state(key, values))
            if starts[-1].valid and starts[-1].chi2 <= self.plain.chi2:
                break
        solved = [s for s in starts if s.valid]
        if solved:
            self._fit_from(key, min(solved, key=lambda s: s.chi2), widths)
        promised = scores.promised(key)
        found, few = self.cache.get(key), 0 < len(bare(key) - self.stood) < FEW
        if few and (found is None or found.score < promised - _MINIMUM):
            null = {k: inside(scores.about.starts[k]) for k in bare(key) - self.stood}
            at = {k: t.with_vector(_null(t)) for k, t in null.items()}
            other = self._state(key, {k: inside(t) for k, t in at.items()})
            if other.valid:
                self._fit_from(key, other, widths)
        return self.cache.setdefault(key, None)

    def _state(self, key: Key, values: Mapping[str, Term]) -> State:
        return self.data.state(self.every.terms(key, values), self.plain, trial=True)

    def _fit_from(self, key: Key, start: State, widths: Mapping[str, float]) -> Hypothesis | None:
        """Fit from a start; again where the evidence wants other prior widths than it began with.

        What waits begins wide: about null a narrow prior would hold it where it does nothing.
        """
        held = {k: max(w, 1.0) if self._waits(k) else w for k, w in widths.items()}
        found = self._fitted(key, start, held)
        for _ in range(_REFITS):
            new = scored(self.every, key, found, held)
            if self._take(new) is not new or new.wanted is None or self._is_endless(key):
                return self.at(key)
            held = new.wanted
            found = self._fitted(key, found.state, held, found.noise)
        return self._take(scored(self.every, key, found, held))

    def _fitted(
        self, key: Key, start: State, widths: Mapping[str, float], noise: Noise | None = None
    ) -> Fit:
        self.report(" + ".join(sorted(key)) or "the model as it is")
        by_name = {name_of(k): w for k, w in widths.items() if not is_field(k)}
        kind = next((k for k in key if is_field(k)), None)
        columns = None if kind is None else self.every.fields[kind] * widths.get(kind, 3.0)
        return fit(self.data, start, by_name, columns, noise=noise)

    def _is_endless(self, key: Key) -> bool:
        """Whether so many effects imitate something unknown that none of them could be named."""
        return bare(key) != key and len(bare(key) - self.stood) > 2 * FEW

    def _waits(self, key: str) -> bool:
        return key in self.every.members and self.every.members[key].waits

    def _take(self, new: Hypothesis) -> Hypothesis:
        """Keep a fit in the cache unless a better one of the same hypothesis is there."""
        old = self.cache.get(new.key)
        some = [h for h in (old, new) if h is not None]
        self.cache[new.key] = best = max(some, key=lambda h: (h.possible, h.score))
        return best

    # --- where the search starts ---

    def _register(self) -> None:
        """The tracker's frame by rigid registration: a fit would need many steps to one far off."""
        for key in (TRACKER, f"{TRACKER}@file"):
            member = self.every.members.get(key)
            if member is None:
                continue
            every = np.ones(len(member.layout), dtype=bool)
            term = registered_each(self.data.problem, self.plain.prediction, member.term, every)
            state = self._state(self.stood | {key}, {key: term})
            if state.valid and state.chi2 < self.plain.chi2:
                self._fit_from(self.stood | {key}, state, {key: 10.0})

    def _singles(self, beside: Hypothesis, forms: bool = False) -> None:
        """The most promising effects beside a hypothesis, each fitted from one or two sizes."""
        about = About(self.every, beside.fit)
        promises = {k: p for k, p in about.promises.items() if forms or not part_of(k)}
        for name in sorted(promises, key=lambda k: (-promises[k], k))[:_SINGLES]:
            key, term = beside.key | {name}, about.starts[name]
            if promises[name] < 0.0 or key in self.cache:
                continue
            sized = term.layout.shape.any() or (term.layout.lower == term.layout.null).any()
            for by in (0.1, 1.0) if sized else (0.1,):
                values = {t.name: t for t in beside.fit.terms} | {name: inside(term, by)}
                state = self._state(key, self._by_key(values, key))
                if state.valid:
                    self._fit_from(key, state, {**beside.widths, name: 1.0})

    def _by_key(self, values: Mapping[str, Term], key: Key) -> dict[str, Term]:
        names = {name_of(k): k for k in key if not is_field(k)}
        return {names[n]: t for n, t in values.items() if n in names}

    def _general_fields(self, none: Hypothesis) -> None:
        """Fields beside nothing: what is known may only show once what is unknown is there."""
        scores = self.scores_about(none)
        near = scores.with_fields(self.stood)
        general = [k for k, kind in self.every.kinds.items() if kind.name == "READINGS"]
        likely = ranked(near)[:_FIELDS]
        for key in dict.fromkeys([*(self.stood | {k} for k in general), *likely]):
            self.fit(scores, key)
        if self.best.field is not None:
            self._singles(self.best)

    @cached_property
    def everything(self) -> Hypothesis:
        """All effects that act from the start, fitted together with expected sizes as priors.

        They are fitted from where nothing is known, and again from where a fit under noise that is
        cooled ends. The better of both counts.
        """
        members = self.every.members.values()
        names = [m.key for m in members if not m.waits and not part_of(m.key)]
        key = self.stood | frozenset(names)
        state = self._state(key, {})
        frame = registered(self.data.problem, self.plain.prediction) if TRACKER in key else None
        if frame is not None and TRACKER not in self.every.stood:
            turned = self._state(key, {TRACKER: frame})
            state = turned if turned.valid and turned.chi2 < state.chi2 else state
        starts = (state, cooled(self.data, state)) if state.valid else (state,)
        return max((self._together(key, one) for one in starts), key=lambda h: h.score)

    def _together(self, key: Key, state: State, noise: Noise | None = None) -> Hypothesis:
        """A hypothesis fitted with expected sizes as priors."""
        found = fit(self.data, state, noise=noise)
        return scored(self.every, key, found, dict.fromkeys(key, 1.0))

    @cached_property
    def calibrated(self) -> Hypothesis:
        """Every effect that the data see, fitted together: a model that predicts, and names none.

        It begins where nothing is known, or where the search ended; of both the better fit. Effects
        that wait join if they promise something beside it.
        """
        best = self._whole(self.everything)
        if self.best.field is None and not self.best.key <= self.stood:
            key = best.key | self.best.key
            names = {name_of(k) for k in self.best.key}
            key = frozenset(k for k in key if k in self.best.key or name_of(k) not in names)
            values = self._by_key({t.name: t for t in self.best.fit.terms}, key)
            state = self._state(key, values)
            if state.valid:
                other = self._whole(self._together(key, state, self.best.fit.noise))
                best = max(best, other, key=lambda h: h.score)
        return best

    def _whole(self, whole: Hypothesis) -> Hypothesis:
        """A fit of all effects with those that wait and pay, wider where that explains more."""
        about = About(self.every, whole.fit)
        pays = {k: p for k, p in about.promises.items() if self._waits(k) and p > _PAYS}
        order = sorted(pays, key=lambda k: (-pays[k], k))
        for some in [order, *([k] for k in order)] if len(order) > 1 else [order]:
            some = [k for k in some if k not in whole.key]
            if some:
                key = whole.key | set(some)
                values = {t.name: t for t in whole.fit.terms}
                values |= {k: inside(about.starts[k]) for k in some}
                state = self._state(key, self._by_key(values, key))
                if state.valid:
                    more = self._together(key, state, whole.fit.noise)
                    whole = max(whole, more, key=lambda h: h.score)
        widths = wider(self.every, whole)
        named = {name_of(k): w for k, w in widths.items()}
        found = fit(self.data, whole.fit.state, named, noise=whole.fit.noise)
        return max(whole, scored(self.every, whole.key, found, widths), key=lambda h: h.score)

    # --- looking about a fit ---

    def scores_about(self, centre: Hypothesis) -> Scores:
        """Linear scores about a hypothesis' fit."""
        return Scores(About(self.every, centre.fit), centre)

    def look_about(self, centre: Hypothesis) -> None:
        """Search linear evidence about a fit, and fit exactly what looks best."""
        self._centres.append(centre.key)
        scores = self.scores_about(centre)
        known = frozenset(scores.about.linear.groups) | self.stood
        ends = [scores.climb(self.stood), scores.climb(centre.key & known)]
        end = bare(max(ends, key=scores.score))
        fields, forms = dict[Key, float](), scores.with_forms(end)
        for key in {end, self.stood, *(end - {k} for k in end - self.stood)}:
            fields |= scores.with_fields(key)
        scores.meet({**fields, **forms})
        for key in ranked(forms)[:1]:
            if forms[key] > scores.score(end) - WITHIN:
                scores.climb(key, LARGE)
        kinds = list[str]()
        for key in ranked(fields):
            kind = next(k for k in key if is_field(k))
            if kind not in kinds:
                kinds.append(kind)
                scores.climb(key, LARGE)
                scores.climb(end | {kind}, LARGE)
            if len(kinds) >= _FIELDS:
                break
        own = [k for k in centre.key if is_field(k)]
        # with noise of its own a field may be worth more
        first = dict.fromkeys(end | {kind} for kind in [*kinds[:1], *own])
        self._fit_best(scores, centre, first)

    def _fit_best(self, scores: Scores, centre: Hypothesis, first: Iterable[Key]) -> None:
        """Fit some hypotheses, and what a linear model considers best, within the budget."""
        seen, done, added = scores.seen, 0, 0
        top = max(seen.values())
        for key in first:
            self._fit_new(scores, key)
        met = any(map(self._is_endless, first))
        for key in scores.best(4 * _FITS):
            loses = key > centre.key and seen[key] < seen.get(centre.key, top)
            if loses and (added == _LOSING or seen[key] < top - EQUAL):
                continue
            if done < _FITS and not (met and self._is_endless(key)):
                fitted = self._fit_new(scores, key)
                done, added = done + fitted, added + (loses and fitted > 0)
                met = met or self._is_endless(key)

    def _fit_new(self, scores: Scores, key: Key) -> int:
        """Fit a hypothesis unless that was done; what it counts.

        One that was fitted is fitted again if the linear model about a better fit promises far
        more: then it had ended in a local minimum.
        """
        if key in self.cache:
            found = self.cache[key]
            poor = found is not None and found.score < scores.promised(key) - _MINIMUM
            if not poor or (key, scores.centre.key) in self._again:
                return 0
            self._again.add((key, scores.centre.key))
        self.fit(scores, key)
        return 1 if len(bare(key) - self.stood) <= FEW else _LONG

    def _close(self) -> None:
        """Fit the neighbours of the best that are near, until none is better."""
        self._ask_fields_of_rows_far_off()
        for _ in range(_ROUNDS - 1):
            best = self.best
            scores = self.scores_about(best)
            base, near = scores.score(best.key), scores.neighbours(best.key)
            core = bare(best.key)
            for key in (core, *(core - {k} for k in sorted(core - self.stood))):
                near |= scores.with_fields(key)
            near |= scores.with_forms(best.key)
            if core != best.key:
                near[core] = base - 1.0
            done, added = 0, 0
            for key in ranked(near):
                loses = key > best.key and near[key] < base
                if loses and (added == _LOSING or near[key] < base - EQUAL):
                    continue
                if near[key] > base - WITHIN and done < _FITS:
                    fitted = self._fit_new(scores, key)
                    done, added = done + fitted, added + (loses and fitted > 0)
            self.last, self.near = scores, near
            if self.best is best and best.field is None and len(core - self.stood) <= FEW:
                scores.widen(best.key)
                near |= scores.near
                for key in scores.best(2 * _FITS):
                    if done < _FITS and scores.seen[key] > base - EQUAL:
                        done += self._fit_new(scores, key)
            if self.best is best:
                break
            if self.best.key not in self._centres:
                self.look_about(self.best)

    def challenge(self, some: Iterable[str]) -> float:
        """ln evidence that the best hypothesis without some members is worse by; fitted if near.

        Two effects together may do what two others do, and no exchange of single ones leads there.
        """
        some, best, scores = frozenset(some), self.best, self.last
        if some not in self._challenged:
            at = scores.climb(best.key - some, without=some)
            self._challenged[some] = at, scores.score(best.key) - scores.score(at)
        at, loss = self._challenged[some]
        if loss < WITHIN:
            self._fit_new(scores, at)
            fitted = self.cache.get(at)
            loss = loss if fitted is None else self.best.score - fitted.score
        return loss

    def needed(self, some: Iterable[str]) -> float:
        """ln evidence that members add beside all others, about the fit of all effects together."""
        scores = self._about_everything
        groups = scores.about.linear.groups
        every = self.stood | {k for k in groups if not is_field(k) and not part_of(k)}
        return scores.score(every) - scores.score(every - frozenset(some))

    @cached_property
    def _about_everything(self) -> Scores:
        return self.scores_about(self.everything)


def _with_rows_alike(found: Hypothesis) -> Hypothesis:
    """A hypothesis in which no row is an outlier, with noise as large as that takes.

    What a model lacks may be far off in some rows only, as when a tracker is bumped between two
    runs; once these count as outliers nothing asks for it.
    """
    fit, chain = found.fit, found.fit.data.chain
    scale = np.ones(len(KINDS))
    for k in np.unique(chain.kind):
        scale[k] = float(np.sqrt(np.mean(fit.left[chain.kind == k] ** 2)))
    noise = Noise(np.maximum(scale, 1e-3), np.zeros(len(KINDS)))
    return replace(found, fit=replace(fit, noise=noise, weight=np.ones(len(fit.weight))))


def _null(term: Term) -> Array:
    """(p,) a term's values with its amplitudes at null."""
    held = term.layout.shape | term.knowledge.fixed
    return np.where(held, term.vector, term.layout.null)
