"""Two models of one robot, from other days or data: which values moved, which nobody knows.

With independent data the difference of the values, d = b - a, has the covariance V = Ca + Cb.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from scipy import linalg, special

from crosscheck.given import GivenRobot, robot_of
from crosscheck.model.fitted import Fitted, diagnosis_document, listed_in
from crosscheck.model.write import provenance_of, with_fit
from seecr.counted import counted, some
from seecr.description.fingerprint import check_robot, described
from seecr.description.robot import Robot
from seecr.effects import ApartLayout, Term, Terms
from seecr.errors import InputError
from seecr.files import path_of
from seecr.pose import Array
from seecr.prediction.effect_tables import number_of
from seecr.prediction.model import CALIBRATION, Model, load_model, new_model, read_document
from seecr.prediction.uncertainty import covariance_of
from seecr.result import Record, Result
from seecr.units import measured, parameter_name, significant

GivenValues: TypeAlias = Model | str | Path | Any
"""A model, a result that has one, the path of a model's TOML, or of a ``diagnosis.json``."""

LEVEL = 0.05
"""In all but one of twenty pairs of models of a robot that has not changed nothing is said to have
moved. Where the correlations are known half of that is for all values together (Bonferroni).
"""

# Correlations are kept with ten digits: a combination of values whose variance, relative to those
# of the values, is smaller than this may be rounding.
_ROUNDING = 1e-8
# A value is settled where the data tell more of it than its expected size did. Variances add up as
# 1/stderr^2 = 1/size^2 + (what the data tell), so that stderr < size/sqrt(2).
_SETTLED = 1.0 / np.sqrt(2.0)
_MOST_NAMED = 6


@dataclass(frozen=True)
class ComparedValue:
    """One value in two models.

    Attributes:
        effect, parameter, unit: as in model files.
        before, now: (value, standard error) in either.
        difference, stderr: now less before, and its standard error.
        chance: probability of so large a difference in any of the values, had none moved (Holm).
        moved: whether it moved beyond its error. settled: whether either data tell what it is.
    """

    effect: str
    parameter: str
    unit: str
    before: tuple[float, float]
    now: tuple[float, float]
    difference: float
    stderr: float
    chance: float
    moved: bool
    settled: bool

    @property
    def label(self) -> str:
        """Its effect and name, such as ``drum_gain.gain_3``."""
        return f"{self.effect}.{self.parameter}"

    @property
    def words(self) -> str:
        """By how much it differs, and both values."""
        way = "larger" if self.difference > 0.0 else "smaller"
        by = measured(abs(self.difference), self.stderr, self.unit)
        was, now = (measured(*one, self.unit) for one in (self.before, self.now))
        times = significant(abs(self.difference) / self.stderr, 2)
        name = parameter_name(self.parameter, self.unit)
        return (
            f"{self.effect}: {name} is {by} {way} now, {times} times its error ({was} before, "
            f"{now} now)"
        )


@dataclass(frozen=True, eq=False, repr=False)
class ModelComparison(Result):
    """What differs between two models of one robot.

    Attributes:
        before, now: what the models are called.
        values: those that both have, with errors.
        only_before, only_now: effects that one of them has alone.
        together: (chi2, directions, probability) of all differences at once, had nothing moved;
            None if there is nothing to compare, or nobody kept how the errors go together.
        pooled: the values of both in one model, each weighted by its inverse covariance, of the
            effects that both have; None where something moved, or there is nothing in common.
        notes: what was left out or assumed.
    """

    before: str
    now: str
    values: tuple[ComparedValue, ...]
    only_before: tuple[str, ...]
    only_now: tuple[str, ...]
    together: tuple[float, int, float] | None
    pooled: Model | None = None
    notes: tuple[str, ...] = ()

    @property
    def moved(self) -> tuple[ComparedValue, ...]:
        """Values that moved beyond their errors, the surest first."""
        return tuple(sorted((v for v in self.values if v.moved), key=lambda v: v.chance))

    @property
    def unsettled(self) -> tuple[ComparedValue, ...]:
        """Values that neither data tell better than their expected size does."""
        return tuple(value for value in self.values if not value.settled)

    @property
    def differs(self) -> bool:
        """Whether a value moved, or all together differ by more than their errors."""
        return bool(self.moved) or (self.together is not None and self.together[2] < LEVEL / 2)

    @property
    def sentence(self) -> str:
        """The answer in one sentence."""
        count = counted(len(self.values), "value")
        if not self.values:
            return f"{self.before} and {self.now} have no value in common that can be compared."
        if self.moved:
            whose = "its error" if len(self.moved) == 1 else "their errors"
            return f"{len(self.moved)} of {count} moved beyond {whose}."
        if self.differs:
            return f"Together the {count} moved, but their errors go together: none can be named."
        if len(self.unsettled) == len(self.values):
            return f"Neither settles any of {count}: nothing can be said to have moved or stayed."
        return f"Nothing moved: {count} in common, alike within their errors."

    def lines(self) -> list[str]:
        """The answer, the values that moved, what one has alone, and those that nobody knows."""
        return [f"{self.before} → {self.now}: {self.sentence}", *self.details]

    @property
    def details(self) -> list[str]:
        """What follows the answer."""
        out = [one.words for one in self.moved]
        for name, effects in ((self.before, self.only_before), (self.now, self.only_now)):
            out += [f"only in {name}: {', '.join(effects)}"] if effects else []
        if self.unsettled:
            names = some([one.label for one in self.unsettled], _MOST_NAMED)
            out.append(f"neither settles {names}: errors as large as what is plausible")
        return [*out, *(f"note: {note}" for note in self.notes)]

    def records(self) -> Sequence[Record]:
        """A record for each value: both, the difference and its error, SI."""
        return [vars(one) for one in self.values]

    def as_json(self) -> Record:
        """The content of ``models.json``, in SI."""
        more = {
            "moved": [one.label for one in self.moved],
            "unsettled": [one.label for one in self.unsettled],
            "pooled": None if self.pooled is None else self.pooled.records(),
        }
        return {"sentence": self.sentence, "differs": self.differs, **vars(self), **more}


def compare_models(
    before: GivenValues, now: GivenValues, robot: GivenRobot | None = None
) -> ModelComparison:
    """Compare the values that two fits found, of other days or data, with their correlations.

    The probability to call any value moved of a robot that has not changed is at most 5 %: half of
    it for all values together (chi2 of d with its covariance), half for the single ones by Holm's
    step-down rule (Scandinavian Journal of Statistics 6, 1979), which holds however they go
    together. Where a model keeps no covariance only the latter is applied.

    Args:
        before, now: models, results that have one such as a diagnosis, or the files of models
            (TOML) or diagnoses (``diagnosis.json``).
        robot: the robot, or its MJCF; by default what the models say of it.

    Returns:
        what moved, what neither settles, and one pooled model where nothing moved.

    Raises:
        InputFileError: a file that is missing, is neither, or is of another robot.
        InputError: something else, or models that do not say which robot they are of.

    Example:
        ``crosscheck.compare_models("monday.toml", "friday.toml").moved``
    """
    machine = _machine(before, now) if robot is None else robot_of(robot)
    names = [str(one) if isinstance(one, str | Path) else "" for one in (before, now)]
    if not all(names) or names[0] == names[1]:
        names = ["before", "now"]
    one, other = (_side(*side, machine) for side in zip((before, now), names, strict=True))
    in_both = [name for name in one.terms.names if name in other.terms]
    apart = [n for n in in_both if any(_is_apart(side.terms[n]) for side in (one, other))]
    kept = [name for name in in_both if name not in apart]
    first, second = one.only(kept), other.only(kept)
    values, together = _compared(first, second)
    notes = [*one.notes, *other.notes]
    if shared := _data_of(before) & _data_of(now):
        notes.append(
            f"both were fitted to {', '.join(sorted(shared))}: if that is the same file, their "
            "errors are not independent, and those of a pooled model are too small"
        )
    if apart:
        notes.append(f"{', '.join(apart)}: separate values for files or runs are not compared")
    if lacking := len(first.stderr) - len(values):
        notes.append(f"{counted(lacking, 'value')} without an error in either: not compared")
    found = ModelComparison(
        names[0], names[1], values,
        tuple(n for n in one.terms.names if n not in other.terms),
        tuple(n for n in other.terms.names if n not in one.terms),
        together, notes=tuple(notes),
    )  # fmt: skip
    if found.differs or not values:
        return found
    source = provenance_of(" + ".join(names), "crosscheck compare")
    fitted, covariance = _pooled(first, second)
    return replace(found, pooled=with_fit(new_model(machine), fitted, kept, source, {}, covariance))


# --- what is given --------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Side:
    """Values of one model: effects, standard errors (p,), inf unseen and NaN unknown, and
    covariance (p, p), which is ``whole`` if their correlations are known.
    """

    terms: Terms
    stderr: Array
    covariance: Array
    whole: bool
    notes: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, name: str, terms: Terms, stderr: Array, notes: tuple[str, ...],
        covariance: Array | None = None,
    ) -> _Side:  # fmt: skip
        known = covariance is not None or len(stderr) < 2
        if covariance is None:
            covariance = np.diag(np.where(np.isfinite(stderr), stderr, 0.0) ** 2)
        if not known:
            notes = (*notes, f"{name} keeps no covariance: its values are taken one by one")
        return cls(terms, stderr, covariance, known, notes)

    def only(self, names: Sequence[str]) -> _Side:
        """Of some effects."""
        at = np.flatnonzero([effect in names for effect, _key in self.terms.labels])
        covariance = self.covariance[np.ix_(at, at)]
        return _Side(self.terms.only(names), self.stderr[at], covariance, self.whole)


def _document(given: GivenValues) -> tuple[Path | None, Mapping[str, Any], Model | None]:
    """The file that was given if any, its content, and the model if it was none."""
    if not isinstance(given, str | Path):
        model = given if isinstance(given, Model) else getattr(given, "model", None)
        if isinstance(model, Model):
            return None, model.document, model
        why = ", which has no model" if hasattr(given, "model") else ""
        raise InputError(
            "expected a model, a result that has one, or the path of a model (TOML) or of a "
            f"diagnosis.json, got {type(given).__name__}{why}"
        )
    path = path_of(given, "a model")
    is_diagnosis = path.suffix.lower() == ".json"
    return path, diagnosis_document(path) if is_diagnosis else read_document(path)[1], None


def _data_of(given: GivenValues) -> set[str]:
    """The data that a model's values were fitted to, by name."""
    document = _document(given)[1]
    tables = [*document.get("effect", ()), document.get(CALIBRATION, {})]
    sources = [table.get("provenance", {}) for table in tables if isinstance(table, Mapping)]
    return {str(one["data"]) for one in sources if isinstance(one, Mapping) and one.get("data")}


def _machine(*given: GivenValues) -> Robot:
    """The robot of the first that says which."""
    for path, document, _model in map(_document, given):
        if document.get("robot") is not None:
            return described(path or Path("the model"), document["robot"])
    raise InputError(
        "neither model says which robot it was made for; expected a table [robot] in one of them, "
        "as crosscheck writes it, or in Python robot="
    )


def _side(given: GivenValues, name: str, robot: Robot) -> _Side:
    path, document, model = _document(given)
    if path is not None and path.suffix.lower() == ".json":
        notes = check_robot(path, document.get("robot"), robot)
        terms = listed_in(path, document, robot)
        cells = {
            (item["effect"], key): number_of(cell.get("stderr"))
            for item in document["missing"] for key, cell in item["parameters"].items()
        }  # fmt: skip
        given_errors = [cells.get(label) for label in terms.labels]
        stderr = np.array([np.inf if one is None else abs(one) for one in given_errors])
        return _Side.of(name, terms, stderr, notes)
    if model is None:
        assert path is not None
        model = load_model(path, robot)
        notes = model.notes
    else:
        notes = check_robot(Path(name), document.get("robot"), robot)
    errors = [np.where(t.knowledge.fixed, 0.0, model.errors_of(t.name)) for t in model.terms]
    stderr = np.concatenate([np.zeros(0), *errors])
    return _Side.of(name, model.terms, stderr, notes, covariance_of(model))


def _is_apart(term: Term) -> bool:
    return term.own is not None or isinstance(term.layout, ApartLayout)


# --- what differs ---------------------------------------------------------------------------------


def _compared(
    one: _Side, other: _Side
) -> tuple[tuple[ComparedValue, ...], tuple[float, int, float] | None]:
    """The values that both have with errors, and the test of all differences at once."""
    terms, both = one.terms, np.stack([one.stderr, other.stderr])
    kept = np.flatnonzero(~np.isnan(both).any(axis=0) & (both > 0.0).any(axis=0))
    settled = (both < _SETTLED * terms.scale).any(axis=0)
    difference, spread = other.terms.vector - terms.vector, np.hypot(*both)
    # what neither settles is not tested: that is known before any difference is looked at
    tested = np.array([k for k in kept if settled[k] and np.isfinite(spread[k])], dtype=int)
    chances = np.ones(len(terms))
    sizes = np.abs(difference[tested]) / spread[tested]
    chances[tested] = _holm(special.erfc(sizes / np.sqrt(2.0)))
    known = one.whole and other.whole
    level = LEVEL / 2 if known else LEVEL
    places = [(term.layout, i) for term in terms for i in range(len(term.layout))]
    values = tuple(
        ComparedValue(
            layout.name, layout.names[i], layout.units[i],
            (float(terms.vector[k]), float(one.stderr[k])),
            (float(other.terms.vector[k]), float(other.stderr[k])),
            float(difference[k]), float(spread[k]), float(chances[k]),
            bool(chances[k] < level), bool(settled[k]),
        )
        for k in kept for layout, i in [places[k]]
    )  # fmt: skip
    if not known or not len(tested):
        return values, None
    whole = (one.covariance + other.covariance)[np.ix_(tested, tested)]
    size, direction, variance = _directions(whole)
    chi2 = float(np.sum((direction.T @ (difference[tested] / size)) ** 2 / variance))
    return values, (chi2, len(variance), float(special.chdtrc(len(variance), chi2)))


def _holm(chances: Array) -> Array:
    """Family-wise probabilities (k,) of single ones (k,), by Holm's step-down rule."""
    order = np.argsort(chances)
    stepped = chances[order] * np.arange(len(chances), 0, -1)
    out = np.empty(len(chances))
    out[order] = np.minimum(np.maximum.accumulate(stepped), 1.0)
    return out


def _directions(whole: Array) -> tuple[Array, Array, Array]:
    """Sizes (k,) of values, and the directions (k, d) and variances (d,) of their correlations."""
    size = np.sqrt(np.diag(whole))
    size = np.where(size > 0.0, size, 1.0)
    variance, direction = linalg.eigh(whole / np.outer(size, size))
    kept = variance > _ROUNDING * variance[-1]
    return size, direction[:, kept], variance[kept]


def _pooled(one: _Side, other: _Side) -> tuple[list[Fitted], Array]:
    """Values of both, each weighted by its inverse covariance, and their covariance (p, p).

    With K = Ca V^-1 the values are a + K d, with the covariance Ca - K Ca: what Ca^-1 + Cb^-1
    gives, but a combination that both know to the rounding of their digits needs no inverse. What
    one of them does not know is the other's.
    """
    terms = one.terms
    unknown = ~np.isfinite(one.stderr)
    vector = np.where(unknown, other.terms.vector, terms.vector)
    stderr = np.where(unknown, other.stderr, one.stderr)
    covariance = np.diag(np.where(np.isfinite(stderr), stderr, 0.0) ** 2)
    both = np.flatnonzero(~unknown & np.isfinite(other.stderr))
    if len(both):
        a, b = (side.covariance[np.ix_(both, both)] for side in (one, other))
        size, direction, variance = _directions(a + b)
        gain = a @ ((direction / variance) @ direction.T / np.outer(size, size))
        vector[both] += gain @ (other.terms.vector - terms.vector)[both]
        covariance[np.ix_(both, both)] = a - gain @ a
        stderr[both] = np.sqrt(np.maximum(np.diag(covariance)[both], 0.0))
    vector = np.clip(vector, terms.lower, terms.upper)
    return [
        Fitted(term, stderr[terms.part(term.name)], np.zeros(len(term.layout), dtype=bool))
        for term in terms.with_vector(vector)
    ], covariance
