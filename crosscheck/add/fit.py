"""Fits effects to measurements, together with those that a model has."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Protocol, TypeAlias, runtime_checkable

from crosscheck.add.weigh import Addition, weigh
from crosscheck.errors import CrosscheckError, UnsolvedError
from crosscheck.fit.state import State
from crosscheck.given import GivenModel, GivenRobot, basis_of, model_of, robot_of
from crosscheck.inference.catalogue import Catalogue, candidates
from crosscheck.inference.fit import TRACKER, Data, Fit, fit, unfitted
from crosscheck.inference.held_out import blocks_note
from crosscheck.inference.noise import Noise
from crosscheck.inference.search import Search
from crosscheck.measurements.data import GivenSigma
from crosscheck.measurements.read import GivenData, measurements_of
from crosscheck.preparation.prepare import Progress, prepare
from seecr.arguments import silent
from seecr.description.robot import Robot
from seecr.effects import (
    ApartLayout,
    Effect,
    GivenEffect,
    Own,
    Term,
    Terms,
    catalogue,
    class_of,
    layout_of,
)
from seecr.effects.base import Layout
from seecr.errors import InputError

# Prior width of values, in expected sizes: the user knows that the effects are there.
_WIDE = 10.0


@runtime_checkable
class HasTerms(Protocol):
    """A result with effects and their values, such as a diagnosis."""

    @property
    def terms(self) -> Terms:
        """The effects."""


GivenSeveral: TypeAlias = Iterable[Term | GivenEffect] | Term | GivenEffect | HasTerms
"""Names or classes of effects, effects with their values, or a result that has some."""


def add_effect(
    robot: GivenRobot,
    data: GivenData,
    name: GivenEffect,
    model: GivenModel = (),
    progress: Progress = silent,
    *,
    per: str | None = None,
    sigma: GivenSigma = None,
) -> Addition:
    """Fit an effect to data, jointly with those that the model has.

    Args:
        robot: a robot, or its MJCF file.
        data: measurements, or their file.
        name: the effect, by its name, its class or an instance, whose values the fit starts from.
        model: effects of the model, or their file; by default the plain model. If the named effect
            is among them, it is fitted again.
        progress: called with what is being done and the fraction that is done.
        per: "file" or "run" gives the effect separate values for each; by default it has them if
            the model says so.
        sigma: noise of the readings, in place of what the files state: metres, ``"0.1mm"`` or a
            :class:`crosscheck.Sigma`.

    Returns:
        the fit, with the new model and the errors before and after.

    Raises:
        InputError: there is no effect of that name, or ``per`` is neither.
        CrosscheckError: the data do not allow the fit.
        UnsolvedError: rows have no equilibrium, or the fit does not converge.

    Example:
        ``crosscheck.add_effect("robot.xml", "measured.csv", "pulley_radius").model``
    """
    robot = robot_of(robot)
    valued, named = _several(name, robot)
    return _added(robot, data, valued, named, model, progress, per, sigma)


def add_effects(
    robot: GivenRobot,
    data: GivenData,
    effects: GivenSeveral,
    model: GivenModel = (),
    progress: Progress = silent,
    *,
    sigma: GivenSigma = None,
) -> Addition:
    """Fit several effects to data at once, starting from the values that they have.

    Effects that are only named have none: they are fitted one after the other beside the others,
    from their most promising starts, and then all at once.

    Args:
        robot: a robot, or its MJCF file.
        data: measurements, or their file.
        effects: names or classes of effects, or effects with their values, or a result such as a
            diagnosis.
        model: effects of the model, or their file; by default the plain model.
        progress: called with what is being done and the fraction that is done.
        sigma: noise of the readings, in place of what the files state: metres, ``"0.1mm"`` or a
            :class:`crosscheck.Sigma`.

    Returns:
        the fit, with the new model and the errors before and after.

    Raises:
        InputError: there is no effect of a name, or something else than effects was given.
        CrosscheckError: no effects were given, or the data do not allow the fit.
        UnsolvedError: rows have no equilibrium, or the fit does not converge.

    Example:
        ``crosscheck.add_effects(robot, data, ["pulley_radius", "stiffness"])``
    """
    robot = robot_of(robot)
    valued, named = _several(effects, robot)
    return _added(robot, data, valued, named, model, progress, sigma=sigma)


def _several(effects: GivenSeveral, robot: Robot) -> tuple[list[Term], list[Layout]]:
    """Effects with values, and parameters of those that are only named."""
    given = effects.terms if isinstance(effects, HasTerms) else effects
    some = list(given) if isinstance(given, Iterable) and not isinstance(given, str) else [given]
    wrong = [one for one in some if not isinstance(one, Term | str | type | Effect)]
    if wrong:
        raise InputError(
            "expected names of effects, effects with their values, or a result such as a "
            f"diagnosis, got {type(wrong[0]).__name__}"
        )
    if not some:
        raise CrosscheckError("expected at least one effect to add, got none")
    terms = [Term.of(robot, one) if isinstance(one, Effect) else one for one in some]
    valued = [one for one in terms if isinstance(one, Term)]
    has = {term.name for term in valued}
    classes = dict.fromkeys(class_of(one) for one in terms if not isinstance(one, Term))
    return valued, [layout_of(one, robot) for one in classes if one.name not in has]


def _added(
    robot: Robot, given: GivenData, valued: Sequence[Term], named: Sequence[Layout],
    model: GivenModel, progress: Progress, per: str | None = None, sigma: GivenSigma = None,
) -> Addition:  # fmt: skip
    data = measurements_of(given, robot, sigma)
    terms, said = model_of(model, robot)
    names, had = [*(t.name for t in valued), *(one.name for one in named)], terms.names
    if per is not None:
        named, valued = [*(t.layout for t in valued), *named], []
        terms = Terms([*terms.without(names[0]), _apart(terms, named[0], per)])
    ready = prepare(robot, data, terms, frozenset({*catalogue(), *names}))
    what = " + ".join(names)
    if ready.refusal is not None:
        raise ready.refusal.error(data.path, f"{what} was not fitted")
    for layout, why in candidates(ready.problem):
        if why is not None and layout.name in names:
            cannot = f"{layout.name} cannot be fitted to these data: {why.words}"
            raise CrosscheckError(f"{data.path}: {cannot}")
    progress(f"fitting {what}", 0.0)
    adding = _Adding(Data.of(ready.problem, ready.terms), f"{data.path}")
    best = adding.fitted(ready.terms, valued, named)
    progress("predicting test runs", 0.6)
    # effects that are free in the data were fitted in advance: they are not in the model before
    before = ready.terms.only(n for n in ready.terms.names if n in had or n not in names)
    base = adding.without(best, names, before)
    notes = [*said, *ready.notes, *blocks_note(ready.problem)]
    return weigh(best, base, before, names, notes, basis_of(model, robot))


def _apart(terms: Terms, layout: Layout, kind: str) -> Term:
    """An effect with separate values for each file or run."""
    term = terms[layout.name] if layout.name in terms else Term(layout, layout.null)
    known = term.own is not None and term.own.kind == kind
    return term if known else replace(term, own=Own(kind, {}))


class _Adding:
    """Fits of effects beside others, each from its most promising starts."""

    def __init__(self, data: Data, path: str) -> None:
        self.data, self.path = data, path

    def fitted(self, terms: Terms, valued: Sequence[Term], named: Sequence[Layout]) -> Fit:
        """The fit of a model with effects that have values, and others that are only named."""
        every = {t.name: t for t in (*terms, *valued)}
        known = {t.name: t for t in terms if t.knowledge.any}
        start = Terms((every | known).values())
        new = [one for one in named if not (one.name in start and _is_placed(start[one.name]))]
        best = (
            self._to_the_end(start, None, " + ".join(start.names))
            if len(new) < len(named) or not new
            else None
        )
        for layout in new:
            best = self._from_starts(start, layout)
            start = best.terms
        assert best is not None
        return best

    def without(self, best: Fit, names: Sequence[str], before: Terms) -> Fit:
        """The model without the named effects, refitted if it has others."""
        rest = before.only(n for n in before.names if n not in names)
        if rest:
            return self._to_the_end(rest, None, f"the model without {' + '.join(names)}")
        return replace(unfitted(self.data, rest), noise=best.noise, weight=best.weight)

    def _from_starts(self, terms: Terms, layout: Layout) -> Fit:
        """The best fit with one more effect, from its present values and its promising starts."""
        rest = terms.without(layout.name)
        fits = []
        if layout.name in terms:
            fits.append(self._to_the_end(terms, None, layout.name))
        alone = self.data.problem.considering(frozenset({layout.name}))
        considered = replace(self.data, problem=alone)
        search = Search(considered, Catalogue.of(considered, rest))
        key = search.stood | {layout.name}
        if search.plain.valid:
            base = search.begin()
            scores = search.scores_about(base)
            if layout.name in scores.about.columns:
                search.fit(scores, key, _WIDE)
            found = search.cache.get(key)
            if found is not None:
                fits.append(self._to_the_end(found.fit.terms, found.fit.state, layout.name))
            # where another effect is missing, a fit from far off may give up one kind of readings
            # to explain the others; beginning at nothing, with the noise that was, it does not
            begun = base.fit.terms.with_term(Term(layout, layout.null))
            if self.data.state(begun, base.fit.state).valid:
                fits.append(self._to_the_end(begun, base.fit.state, layout.name, base.fit.noise))
        if not fits:
            raise UnsolvedError(
                f"{self.path}: {layout.name} cannot be fitted to these data: no start of it has a "
                "solution, or it moves no reading"
            )
        return min(fits, key=lambda one: one.cost)

    def _to_the_end(
        self, terms: Terms, near: State | None, what: str, noise: Noise | None = None
    ) -> Fit:
        """A fit from given values with exact derivatives, until it converges; or UnsolvedError."""
        state = self.data.state(terms, near)
        if not state.valid:
            raise UnsolvedError(
                f"{self.path}: {what}: some rows could not be solved at the start of the fit"
            )
        # a tracker's frame and what is free in the data have no expected size: they stay as wide
        sizeless = (TRACKER, *self.data.free)
        widths = {name: _WIDE for name in terms.names if name not in sizeless}
        found = fit(self.data, state, widths, noise=noise)
        found = fit(replace(self.data, frozen=False), found.state, widths, noise=found.noise)
        if not found.settled:
            raise UnsolvedError(
                f"{self.path}: the fit of {what} did not converge; nothing was added: find what "
                "else is missing with crosscheck diagnose, or fix known values in the model"
            )
        return found


def _is_placed(term: Term) -> bool:
    """Whether an independent measurement, or separate values, tell where to start the fit."""
    return term.knowledge.any or isinstance(term.layout, ApartLayout)
