"""What the values of all cables have in common, where another effect explains that part as well.

Drums that are all about 1 % too large pay out 1 % more of every cable; so does a tracker whose
image is 1 % too large, if the exit points may be elsewhere too. No rival explains how the drums
differ, so none stands in for them as a whole, but of what they share these data cannot say which.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.calibration.sets.equals import EQUAL
from crosscheck.diagnosis.rivals import TOLD_APART
from crosscheck.diagnosis.search import Search
from crosscheck.fit.effects.gauss_newton import PRIOR_SIZES, Fit
from crosscheck.fit.effects.possible import can_be, is_plausible
from crosscheck.fit.effects.starts import amplitude_columns
from crosscheck.fit.least_squares.imitation import basis, imitated, left_over
from crosscheck.fit.words import measured, shown
from crosscheck.units import parameter_name
from seecr.effects import Term
from seecr.effects.base import Layout
from seecr.pose import Array

# A common part with a smaller signal [chi2] beside the rest of the model is not worth a word.
_SEEN = 25.0
# An effect whose own values can do all that another does is no other reading of them.
_CONTAINED = 1.0 - 1e-6


@dataclass(frozen=True, eq=False)
class CommonPart:
    """The mean of an effect's values over the cables, and what may stand for it.

    Attributes:
        term: the effect. mean, stderr: mean of the values in their unit, and its standard error.
        rivals: effects of one parameter that explain the mean as well, with their values then.
    """

    term: Term
    mean: float
    stderr: float
    rivals: tuple[Term, ...]

    @property
    def note(self) -> str:
        """What cannot be told apart, in words."""
        layout = self.term.layout
        mean = measured(self.mean, self.stderr, layout.units[0])
        other = " or ".join(f"{one.name} ({_value(one)})" for one in self.rivals)
        return (
            f"{layout.name}: what all cables have in common, {mean} on average, may as well be "
            f"{other}; these data cannot tell which"
        )

    @property
    def advice(self) -> str:
        """How to find out which it is."""
        every = [self.term.name, *(one.name for one in self.rivals)]
        direct = dict.fromkeys(one.layout.effect.by_hand() for one in (self.term, *self.rivals))
        return (
            f"to tell what all cables have in common, {' or '.join(every)}: {' or '.join(direct)}"
        )

    def as_json(self) -> dict[str, Any]:
        """The item ``common_part`` of a missing effect: SI."""
        either = {one.name: dict(zip(one.layout.names, one.vector, strict=True))
                  for one in self.rivals}  # fmt: skip
        return {"mean": self.mean, "stderr": self.stderr, "indistinguishable": either}


def _value(term: Term) -> str:
    """A term's only value, in words: factor = 0.988."""
    layout = term.layout
    name = parameter_name(layout.names[0], layout.units[0])
    return f"{name} = {shown(float(term.vector[0]), layout.units[0])}"


def common_part(found: Search, term: Term, fit: Fit) -> CommonPart | None:
    """What the values of all cables have in common, if another effect explains it as well.

    Args:
        found: the search, with the data and the effects that may be missing.
        term: an effect of the model. fit: the model.

    Returns:
        None for effects that are not one value per cable, if the data do not see the common part
        beside the rest of the model, or if no other effect explains it.
    """
    every, own = term.layout.cable_by_cable, fit.terms.own(term.name)
    if len(every) != 1 or len(every[0]) != len(term.layout) or len(term.layout) < 2:
        return None
    columns, inflation = fit.jacobian[:, own], found.last.whiteness.inflation
    # directions that stay: everything but the common part
    stays = np.eye(len(own))
    stays[np.ix_(own, own)] -= 1.0 / len(term.layout)
    signal = columns.sum(axis=1) * float(np.mean(term.sizes))
    if left_over(signal, basis(fit.jacobian @ stays)) < _SEEN * inflation**2:
        return None
    rivals = list[Term]()
    for layout in _small(found, fit):
        column = amplitude_columns(found.problem, fit, layout, layout.null)[:, 0] * layout.scale
        if imitated(column, basis(columns)) < _CONTAINED:
            rivals += _in_its_place(found, fit, signal, stays, Term(layout, layout.null), column)
    if not rivals:
        return None
    variance = float(fit.covariance[np.ix_(own, own)].mean())
    return CommonPart(term, float(term.vector.mean()), inflation * variance**0.5, tuple(rivals))


def _in_its_place(
    found: Search, fit: Fit, signal: Array, stays: Array, null: Term, column: Array
) -> Iterator[Term]:
    """The rival with its value, if it explains what the common part does and is as plausible.

    Args:
        found, fit: as above. signal: (N,) what the common part does.
        stays: (p, p) projection of the model's sizes on those without the common part.
        null: the rival at null. column: (N,) its derivative.
    """
    free = np.column_stack([fit.jacobian @ stays, column])
    # of values that do the same, those that are the most plausible
    kept = stays @ fit.terms.sizes
    weak = np.eye(len(kept) + 1) / PRIOR_SIZES
    target = np.concatenate([signal, -weak @ np.append(kept, 0.0)])
    change = np.linalg.lstsq(np.concatenate([free, weak]), target, rcond=None)[0]
    left = float(np.sum((signal - free @ change) ** 2)) / found.last.whiteness.inflation**2
    sizes = kept + stays @ change[:-1]
    rival = null.with_vector(null.vector + change[-1] * null.layout.scale)
    loss = 0.5 * left + _price(change[-1:]) + sum(
        _price(sizes[part]) - _price(fit.terms.sizes[part])
        for part in (fit.terms.own(name) for name in fit.terms.names)
    )  # fmt: skip
    possible = can_be(found.problem.robot, fit.terms.with_term(rival), fit.terms)
    if left < TOLD_APART and loss < EQUAL and is_plausible(rival) and possible:
        yield rival


def _price(sizes: Array) -> float:
    """What values (k,) in plausible sizes cost of ln evidence, their prior as wide as they need."""
    k, square = len(sizes), float(sizes @ sizes)
    return 0.5 * square if square < k else 0.5 * k * (1.0 + float(np.log(square / k)))


def _small(found: Search, fit: Fit) -> Iterator[Layout]:
    """Effects of one parameter that may be missing and are not in the model."""
    for candidate in found.trials.candidates(found.problem):
        is_new = candidate.why_not is None and candidate.name not in fit.terms
        if is_new and len(candidate.layout) == 1 and not candidate.layout.shape.any():
            yield candidate.layout
