"""The models that a diagnosis shows: from the one that stood, effect by effect, to what it found.

They are hypotheses of the search. Effects are added in the order in which that pays: each time the
one is next whose addition has the greatest score, that is, explains most for its parameters.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from crosscheck.fit.problem import KINDS, Problem, Rms, rms_by_kind
from crosscheck.fit.state import State
from crosscheck.inference.catalogue import Key, is_field, name_of, part_of
from crosscheck.inference.fit import Fit, fit
from crosscheck.inference.held_out import HeldOut, by_part, hold_out
from crosscheck.inference.hypothesis import Hypothesis, scored
from crosscheck.inference.priors import WITHIN
from crosscheck.inference.search import Search
from seecr.effects import ApartLayout, Term


@dataclass(frozen=True, eq=False)
class Stage:
    """One of the models.

    Attributes:
        label: what was added, in words. added: the effect, "" for the model as it stood.
        fit: its fit. held_out: its errors on test runs.
    """

    label: str
    added: str
    fit: Fit
    held_out: HeldOut

    @property
    def state(self) -> State:
        """The model on all rows."""
        return self.fit.state

    @property
    def rms(self) -> Rms:
        """Errors on all rows, by kind."""
        return rms_by_kind(self.fit.data.problem, self.state.raw)


@dataclass(frozen=True, eq=False)
class ModelPath:
    """The models from the one that stood to the last one.

    Attributes:
        search: the search that met them. stages: the models, outliers marked in their data.
    """

    search: Search
    stages: tuple[Stage, ...]

    @property
    def problem(self) -> Problem:
        """The data."""
        return self.first.fit.data.problem

    @property
    def base(self) -> tuple[str, ...]:
        """Names of the effects that the model had before."""
        return self.search.every.stood.names

    @property
    def first(self) -> Stage:
        """The model as it stood."""
        return self.stages[0]

    @property
    def last(self) -> Stage:
        """The last model: with all effects that are listed."""
        return self.stages[-1]

    @property
    def tried(self) -> int:
        """How many effects were tried beside the model as it stood."""
        return len(self.search.every.effects)

    def alone(self, name: str) -> tuple[float | None, Term] | None:
        """What an effect does when it alone is added to the model as it stood.

        Returns:
            The part of the excess chi2 that it removes on all rows, 0 to 1 (None without excess),
            and its values; None if it moves nothing. By the linear model if it was not fitted.
        """
        search, about = self.search, self.search.none_about
        none, fitted = about.fit, search.cache.get(search.stood | {name})
        if fitted is not None:
            left, term = fitted.fit.state.chi2, fitted.fit.terms[name]
        elif name in about.columns:
            widths = {k: about.linear.groups[k].middle for k in (*search.stood, name)
                      if k in about.linear.groups}  # fmt: skip
            solved = about.solved(widths)
            term = about.values(solved)[name]
            white = none.state.white - about.columns[name] @ solved.values[solved.place(name)]
            left = float(white @ white)
        else:
            return None
        excess = none.state.chi2 - self.problem.n_readings
        share = (none.state.chi2 - left) / excess if excess > 0.0 else None
        return None if share is None else float(np.clip(share, 0.0, 1.0)), term

    def removed_by(self, index: int) -> float:
        """The part, 0 to 1, of the chi2 beyond noise on test runs that a stage removes."""
        before, after = self.stages[index - 1].held_out, self.stages[index].held_out
        kinds = [self.problem.counted[:, kind.columns].sum() for kind in KINDS]
        noise = float(np.sum(np.array(kinds) * self.search.best.fit.noise.scale**2))
        excess = float(before.chi2.sum()) - noise
        fall = float(before.chi2.sum() - after.chi2.sum())
        return float(np.clip(fall / excess, 0.0, 1.0)) if excess > 0.0 else 0.0


def path_to(search: Search, listed: Sequence[str], whole: bool) -> ModelPath:
    """The path to the listed members; if these are the ``whole``, its end has expected sizes."""
    key, left = search.stood, list(listed)
    far = search.best.fit.outlying

    def stage(label: str, added: str, fit: Fit) -> Stage:
        fit = fit.with_far_off(far) if far.any() else fit
        return Stage(label, added, fit, hold_out(_by_part(fit) if added else fit))

    named = bool(search.every.stood)
    start = "the given model" if named else "plain SEECR"
    stages = [stage(start, "", search.unfitted if named else search.none.fit)]
    if named and _wants_refit(search):
        stages.append(stage(f"{start}, fitted", "", search.none.fit))
    while left:
        following = _next_of(search, key, left)
        if following is None:
            break
        best, found = following
        if whole and len(left) == 1:
            found = _at_plausible_sizes(search, found)
        label = f"+ {name_of(best)}" + (f" (each {part_of(best)})" if part_of(best) else "")
        key = found.key
        stages.append(stage(label, name_of(best), found.fit))
        left.remove(best)
    return ModelPath(search, tuple(stages))


def _next_of(search: Search, start: Key, members: Iterable[str]) -> tuple[str, Hypothesis] | None:
    """Which of some members is worth most beside a fitted hypothesis; None if none has a fit.

    As in the search, what the linear model considers worse by WITHIN is not fitted.
    """
    scores, found = search.scores_about(search.at(start)), dict[str, Hypothesis]()
    promised = {k: scores.promised(start | {k}) for k in members}
    for k in sorted(promised, key=lambda k: (-promised[k], k)):
        best = max((h.score for h in found.values()), default=-np.inf)
        if start | {k} not in search.cache and promised[k] > best - WITHIN:
            search.fit(scores, start | {k})
        one = search.cache.get(start | {k})
        if one is not None:
            found[k] = one
    best_of_all = max(found, key=lambda k: (found[k].score, k), default=None)
    return None if best_of_all is None else (best_of_all, found[best_of_all])


def _at_plausible_sizes(search: Search, found: Hypothesis) -> Hypothesis:
    """A hypothesis fitted anew with prior widths of one expected size at least.

    Narrow priors hold values near null that the readings hardly determine, and their errors
    are small only because of that: no reason to tell somebody with a caliper.
    """
    widths = {k: max(w, 1.0) for k, w in found.widths.items() if not is_field(k)}
    by_name = {name_of(k): w for k, w in widths.items()}
    exact = replace(search.data, frozen=False)
    again = fit(exact, found.fit.state, by_name, noise=found.fit.noise)
    return scored(search.every, found.key, again, widths)


def _wants_refit(search: Search) -> bool:
    """Whether the model as it stands explains the data only with other values than it has.

    The given values are a hypothesis of their own, without a parameter that the data chose
    (Akaike's criterion).
    """
    fitted = search.none.fit
    return bool(search.unfitted.cost > fitted.cost + 2.0 * len(fitted.terms))


def _by_part(fit: Fit) -> Fit:
    """A fit with blocks that are parts of each file or run, if effects have values for these."""
    kinds = {t.layout.kind for t in fit.terms if isinstance(t.layout, ApartLayout)}
    if not kinds:
        return fit
    parts = fit.data.problem.data.parts["run" if "run" in kinds else "file"]
    return by_part(fit, np.unique(parts, return_inverse=True)[1].astype(np.int64))
