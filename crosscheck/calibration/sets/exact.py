"""Sets of effects that are fitted exactly, with their evidence; each set is fitted once."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np

from crosscheck.calibration.joint_fit.joining import at_null, inside
from crosscheck.calibration.joint_fit.joint import JointFit, Setting, settle
from crosscheck.calibration.joint_fit.linearised import (
    Linear,
    column_groups,
    left_to_gain,
    linearised,
)
from crosscheck.calibration.linear_evidence.gram import (
    ColumnGroup,
    Gram,
    averaged,
    best_widths,
    gram_of,
)
from crosscheck.calibration.linear_evidence.priors import width_of, widths_for
from crosscheck.calibration.sets.bounds import log_absent
from crosscheck.calibration.sets.catalogue import Catalogue, gram_about
from crosscheck.calibration.sets.linear_search import Names, Scores
from crosscheck.calibration.sets.shapes import log_shares, prices_about
from crosscheck.fit.effects.possible import can_be
from crosscheck.fit.least_squares.state import State, evaluate
from seecr.effects import Term, Terms
from seecr.pose import Array
from seecr.prediction.parted import forget
from seecr.processes import Shared, shared_out

_STEPS = 12
# If a refit is worse than its linear evidence by this much, it may have ended in a local minimum,
# and is repeated from other starting points.
LOCAL_MINIMUM = 8.0
# Sets up to this size are tried from more starting points.
FEW = 5
# Parts of the way to the values of a linear model at which fits may begin.
_PARTS = (1.0, 0.5, 0.25, 0.125)
# Fits begin so far off a bound, in plausible sizes.
_OFF = 0.03


# The members of a set, each with the term whose shape the fit started from.
Shapes = tuple[tuple[str, Term | None], ...]


@dataclass(frozen=True, eq=False)
class Refit:
    """A set of effects that was fitted exactly.

    Attributes:
        names: the set. joint: its fit.
        widths: prior width of each member.
        score: ln evidence plus ln prior.
        wished: widths that promise more, but for values far from the fit; None if there are none.
    """

    names: Names
    joint: JointFit
    widths: dict[str, float]
    score: float
    wished: dict[str, float] | None = None


@dataclass(eq=False)
class Exact:
    """Sets of effects fitted exactly, all with the same noise and weights.

    Attributes:
        setting, joint, catalogue, plain, report: as in
            :func:`crosscheck.calibration.sets.refits.compare_sets`.
        given: further starting values of some sets.
        fitted: the fit of each set; None if it could not be solved.
    """

    setting: Setting
    joint: JointFit
    catalogue: Catalogue
    plain: State
    report: Callable[[str], None]
    given: Mapping[Names, Terms] = field(default_factory=dict)
    fitted: dict[Names, Refit | None] = field(default_factory=dict)
    _begun: dict[Names, set[Shapes]] = field(default_factory=dict)

    @property
    def possible(self) -> dict[Names, Refit]:
        """Fits with values that a robot can have (no negative mass), and the model as it stands."""
        always = frozenset(self.plain.terms.names)
        return {
            names: found
            for names, found in self.fitted.items()
            if found is not None and (names == always or self.can_be(found))
        }

    def size(self, name: str) -> int:
        """How many parameters an effect has."""
        return self.catalogue.size(name)

    def can_be(self, found: Refit) -> bool:
        """Whether a robot can have all values of a fit."""
        return can_be(self.setting.problem.robot, found.joint.terms, self.plain.terms)

    def scores_about(self, joint: JointFit, own_shapes: bool = False) -> Scores:
        """Linear scores of the whole catalogue about a fit of some of it.

        Args:
            joint: the fit.
            own_shapes: start fits of sets from the shapes that effects have in this fit, also of
                sets that were fitted from other shapes before.
        """
        always = frozenset(self.plain.terms.names)
        gram = gram_about(self.setting, joint, self.catalogue)
        own = joint.terms if own_shapes else ()
        shapes = {t.name: at_null(t) for t in own if t.name in self.catalogue.later}
        return Scores(
            gram, len(set(self.catalogue.names) - always), always, shapes,
            prices_about(self.setting, joint, self.catalogue),
        )  # fmt: skip

    def best_of(self, scores: Scores, some: Iterable[Names]) -> Refit:
        """Fit these sets, and return the best of all that were ever fitted."""
        self.fit_all(scores, some)
        return self.best

    def fit(self, scores: Scores, names: Names) -> Refit | None:
        """The exact fit of a set, or None if it has no solution.

        A set is fitted again if other shapes of its members promise far more.
        """
        return self.fit_all(scores, [names])[0]

    def fit_all(self, scores: Scores, some: Iterable[Names]) -> list[Refit | None]:
        """Fit these sets, each as :meth:`fit` does, several at a time."""
        wanted = list(some)
        begin = [names for names in dict.fromkeys(wanted) if self._is_to_fit(scores, names)]
        self._take(begin, shared_out(partial(self._fit, scores), begin, self._shared, self._told))
        for names in wanted:
            self._begun.setdefault(names, set()).add(_shapes(scores, names))
        return [self.fitted[names] for names in wanted]

    @property
    def best(self) -> Refit:
        """The best of all sets that were ever fitted."""
        return max(self.possible.values(), key=lambda r: r.score)

    def take(self, scores: Scores, *starts: Terms) -> None:
        """Fit sets from these values, several at a time; each result is kept if it is better.

        Values that no robot can have are worse than any others, however much they explain: a set
        with such values is not compared.
        """

        def fit(start: Terms) -> Refit | None:
            return self._from_start(scores, self._at(start))

        names = [frozenset(start.names) for start in starts]
        fits = shared_out(fit, starts, self._shared, lambda one: self._told(frozenset(one.names)))
        self._take(names, fits)

    def _take(self, some: Iterable[Names], fits: Iterable[Refit | None]) -> None:
        for names, found in zip(some, fits, strict=True):
            self.fitted[names] = self._better(self.fitted.get(names), found)

    def _from_start(self, scores: Scores, start: State) -> Refit | None:
        names = frozenset(start.terms.names)
        # the linear model may hold an effect near null that only acts away from there
        wide = {name: max(width, 1.0) for name, width in scores.widths(names).items()}
        return self._from(scores, names, start, wide)

    def _better(self, *fits: Refit | None) -> Refit | None:
        fitted = [refit for refit in fits if refit is not None]
        return max(fitted, key=lambda refit: (self.can_be(refit), refit.score), default=None)

    def _told(self, names: Names) -> None:
        self.report(" + ".join(sorted(names)) or "the model as it is")

    @cached_property
    def _all(self) -> Shared:
        """All that is there before the first set is fitted, and that all fits have in common."""
        return Shared(self.setting, self.joint, self.catalogue, self.plain, self.given)

    def _shared(self) -> Shared:
        return self._all

    def _is_to_fit(self, scores: Scores, names: Names) -> bool:
        if names not in self.fitted:
            return True
        begun = _shapes(scores, names) in self._begun.get(names, set())
        return not begun and self._promises_more(scores, names)

    def _promises_more(self, scores: Scores, names: Names) -> bool:
        """Whether other shapes of its members may explain far more than the present fit."""
        own = self.fitted[names]
        other = names & scores.shapes.keys()
        return bool(other) and (own is None or own.score < scores.score(names) - LOCAL_MINIMUM)

    def _fit(self, scores: Scores, names: Names) -> Refit | None:
        """A set fitted from its linear values, at first also from given ones, and from null.

        From null only if all that ends badly.
        """
        if names in self.fitted:
            return self._from_start(scores, self._linear(scores, names))
        linear, widths = scores.score(names), scores.widths(names)
        best = self._from(scores, names, self._linear(scores, names), widths)
        if names in self.given:
            best = self._better(best, self._from_start(scores, self._at(self.given[names])))
        few = 0 < len(names - scores.always) <= FEW
        if few and (best is None or best.score < linear - LOCAL_MINIMUM):
            null = Terms(inside(self.catalogue.start(name), _OFF) for name in names)
            best = self._better(best, self._from_start(scores, self._at(null)))
        return best

    def _at(self, terms: Terms) -> State:
        return evaluate(self.setting.problem, terms, self.setting.factor, self.plain, trial=True)

    def _linear(self, scores: Scores, names: Names) -> State:
        """A set at the values of the linear model, or part of the way to them.

        Far from where the readings were linearised, a large set can have values with which it
        explains less than the model as it stands does. No fit leads back from there. If even an
        eighth of the way explains less, the fit begins where least is left.
        """
        most, tried = self._left(self.plain), list[State]()
        for part in _PARTS:
            tried.append(self._at(_linear_terms(self.catalogue, scores, names, part)))
            if tried[-1].valid and self._left(tried[-1]) <= most:
                break
        return min(tried, key=self._left)

    def _left(self, state: State) -> float:
        """What a model leaves, with the noise and the weights of all fits."""
        if not state.valid:
            return float("inf")
        white = self.joint.whitened(self.setting.chain, state.white)
        return float(white @ white) + state.log_det

    def _from(
        self, scores: Scores, names: Names, start: State, widths: dict[str, float]
    ) -> Refit | None:
        if not start.valid:
            return None
        refit = self._settled(scores, names, start, widths)
        if refit.wished is None:
            return refit
        # what other widths promise is far from a fit with these: it is looked for there
        wished = refit.widths | refit.wished
        again = self._settled(scores, names, refit.joint.state, wished, refit.joint.jacobian)
        return max(refit, again, key=lambda one: (self.can_be(one), one.score))

    def _settled(
        self, scores: Scores, names: Names, start: State, widths: dict[str, float],
        jacobian: Array | None = None,
    ) -> Refit:  # fmt: skip
        width = width_of(start.terms, widths)
        found = settle(self.setting, start, width, self.joint.colour, _STEPS, jacobian)
        out = scored(self.setting, found, names, widths, scores)
        forget(found.state.prediction)  # hundreds of sets are kept, few are looked at again
        return out


def _shapes(scores: Scores, names: Names) -> Shapes:
    return tuple((name, scores.shapes.get(name)) for name in sorted(names))


def _linear_terms(catalogue: Catalogue, scores: Scores, names: Names, part: float) -> Terms:
    """The set part of the way to the values of the linear model, from null or the model's own."""
    solved = scores.gram.solved(scores.widths(names))
    values, out, first = solved.values, [], 0
    for name in solved.chosen:
        term = scores.shapes.get(name, catalogue.start(name))
        layout, start = term.layout, term.vector
        count = len(scores.gram.groups[name].columns)
        own = np.flatnonzero(~layout.shape & ~term.knowledge.fixed)
        if count < len(own):  # only amplitudes at null are in the linear model
            own = own[start[own] == layout.null[own]]
        vector = start.copy()
        linear = layout.null[own] + values[first : first + count] * layout.scale[own]
        vector[own] = start[own] + part * (linear - start[own])
        out.append(inside(term.with_vector(np.clip(vector, layout.lower, layout.upper)), _OFF))
        first += count
    return Terms([*out, *(catalogue.start(name) for name in names if name not in solved.chosen)])


def scored(
    setting: Setting, joint: JointFit, names: Names, widths: dict[str, float], scores: Scores
) -> Refit:
    """A fit with its evidence, linearised about its own optimum and averaged over prior widths.

    What the linear model would still gain there, the fit did not find: it is taken off.
    """
    linear = linearised(setting, joint)
    gram = own_gram(linear, joint, setting.free)
    # what moves readings at this fit need not have been in the linear model of the search
    held = {n: widths.get(n, _only(gram.groups[n].widths)) for n in gram.names}
    better, wished = widths_near(gram, held, joint.z)
    share = sum(log_shares(joint, linear).values()) + log_absent(setting, joint, linear, better)
    score = averaged(gram, better) + share + scores.log_prior(names)
    score -= 0.5 * (joint.state.log_det + left_to_gain(linear, joint.z))
    return Refit(names, joint, widths | better, score, wished)


def _only(widths: Array) -> float:
    """The width of an effect that the search knows none of: one size, or the only one it has."""
    return float(widths[0]) if len(widths) == 1 else 1.0


def widths_near(
    gram: Gram, fitted: dict[str, float], z: Array
) -> tuple[dict[str, float], dict[str, float] | None]:
    """The widths that maximise the evidence, if the optimum with these is near the fit.

    The linear model holds about the fit. Other widths may promise much for values far from there:
    without its mass and with cables that do not pull, no force would be needed on a platform.

    Args:
        gram: normal equations about a fit. fitted: its widths. z: (p,) its values.

    Returns:
        The widths, and None; or, where the optimum is far off, the fitted ones and the others.
    """
    best = best_widths(gram, fitted)
    if gram.solved(best).left_to_gain(z) > LOCAL_MINIMUM:
        return fitted, best
    return best, None


def own_gram(linear: Linear, joint: JointFit, free: Collection[str] = ()) -> Gram:
    """Normal equations of a fit's own effects about its optimum, without parameters on a bound."""
    groups = column_groups(joint, partial(widths_for, free=free))
    return gram_of(linear.x, own_readings(linear, joint, groups), groups)


def own_readings(linear: Linear, joint: JointFit, groups: Mapping[str, ColumnGroup]) -> Array:
    """(N,) signal of the amplitudes of a fit's effects plus noise; shapes stay fixed."""
    z = np.zeros(len(joint.z))
    for group in groups.values():
        z[group.columns] = joint.z[group.columns]
    return np.asarray(linear.y - linear.x @ (joint.z - z))
