"""Two models of one robot, from other days or data: which values moved, which nobody knows.

With independent data the difference of the values, d = b - a, has the covariance V = Ca + Cb.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, special

from crosscheck.given import GivenRobot, robot_of
from crosscheck.model.fitted import Fitted, diagnosis_document, listed_in
from crosscheck.model.write import provenance_of, with_fit
from seecr.counted import counted, some
from seecr.description.fingerprint import check_robot, described
from seecr.description.robot import Robot
from seecr.effects import ApartLayout, Layout, Term, Terms
from seecr.errors import InputError, InputFileError
from seecr.files import path_of
from seecr.pose import Array
from seecr.prediction.effect_tables import number_of
from seecr.prediction.model import Model, load_model, new_model, read_document
from seecr.prediction.uncertainty import covariance_of
from seecr.result import Record, Result
from seecr.units import measured, parameter_name, significant

GivenValues: TypeAlias = Model | str | Path | Any
"""A model, a result that has one, the path of a model's TOML, or of a ``diagnosis.json``."""

# In all but one of twenty pairs of models of a robot that has not changed nothing is said to have
# moved. Half of that is for the single values, half for all together (Bonferroni).
_LEVEL = 0.05 / 2
# Correlations are kept with ten digits: a combination of values whose variance, relative to those
# of the values, is smaller than this may be rounding.
_ROUNDING = 1e-8
# A value is settled where the data tell more of it than its plausible size did. Variances add up as
# 1/stderr^2 = 1/size^2 + (what the data tell), so that stderr < size/sqrt(2).
_SETTLED = 1.0 / np.sqrt(2.0)
_MOST_NAMED = 6


@dataclass(frozen=True)
class ComparedValue:
    """One value in two models.

    Attributes:
        effect, parameter, unit: as in model files.
        before, now: (value, standard error) in either.
        difference: now less before. stderr: its standard error.
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
        name = parameter_name(self.parameter, self.unit)
        way = "larger" if self.difference > 0.0 else "smaller"
        by = measured(abs(self.difference), self.stderr, self.unit)
        values = (measured(*one, self.unit) for one in (self.before, self.now))
        times = significant(abs(self.difference) / self.stderr, 2) if self.stderr else "many"
        return (
            f"{self.effect}: {name} is {by} {way} now, {times} times its error ("
            f"{' before, '.join(values)} now)"
        )


@dataclass(frozen=True, eq=False, repr=False)
class ModelComparison(Result):
    """What differs between two models of one robot.

    Attributes:
        before, now: what the models are called.
        values: those that both have, with errors.
        only_before, only_now: effects that one of them has alone.
        together: (chi2, directions, probability) of all differences at once, had nothing moved;
            None if there is nothing to compare.
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
        """Values that neither data tell better than their plausible size does."""
        return tuple(value for value in self.values if not value.settled)

    @property
    def differs(self) -> bool:
        """Whether a value moved, or all together differ by more than their errors."""
        return bool(self.moved) or (self.together is not None and self.together[2] < _LEVEL)

    @property
    def sentence(self) -> str:
        """The answer in one sentence."""
        if not self.values:
            return f"{self.before} and {self.now} have no value in common that can be compared."
        count = counted(len(self.values), "value")
        if self.moved:
            which = f"{len(self.moved)} of {count}"
            return f"{which} moved beyond {'its' if len(self.moved) == 1 else 'their'} error."
        if self.differs and self.together is not None:
            chance = significant(self.together[2], 1)
            return (
                f"Together the {count} moved (a chance of {chance} if not), but no single one can "
                "be named: their errors go together."
            )
        if len(self.unsettled) == len(self.values):
            return f"Neither settles any of {count}: nothing can be said to have moved or stayed."
        if len(self.values) == 1:
            return "Nothing moved: the one value in common agrees within its error."
        return f"Nothing moved: all of {count} agree within their errors."

    def lines(self) -> list[str]:
        """The answer, the values that moved, those that nobody knows, and what one has alone."""
        out = [f"{self.before} → {self.now}: {self.sentence}", *(v.words for v in self.moved)]
        if self.unsettled:
            out.append(f"neither settles: {some([v.label for v in self.unsettled], _MOST_NAMED)}")
        for name, effects in ((self.before, self.only_before), (self.now, self.only_now)):
            if effects:
                out.append(f"only in {name}: {', '.join(effects)}")
        return [*out, *(f"note: {note}" for note in self.notes)]

    def records(self) -> Sequence[Record]:
        """A record for each value: both, the difference and its error, SI."""
        return [
            {
                "effect": one.effect,
                "parameter": one.parameter,
                "unit": one.unit,
                "before": one.before[0],
                "before_stderr": _finite(one.before[1]),
                "now": one.now[0],
                "now_stderr": _finite(one.now[1]),
                "difference": one.difference,
                "stderr": _finite(one.stderr),
                "chance": one.chance,
                "moved": one.moved,
                "settled": one.settled,
            }
            for one in self.values
        ]

    def as_json(self) -> Record:
        """The content of ``models.json``, in SI."""
        keys = ("chi2", "directions", "chance")
        return {
            "before": self.before,
            "now": self.now,
            "sentence": self.sentence,
            "differs": self.differs,
            "moved": [one.label for one in self.moved],
            "unsettled": [one.label for one in self.unsettled],
            "values": self.records(),
            "together": None
            if self.together is None
            else dict(zip(keys, self.together, strict=True)),
            "only_before": list(self.only_before),
            "only_now": list(self.only_now),
            "pooled": None if self.pooled is None else self.pooled.records(),
            "notes": list(self.notes),
        }


def _finite(error: float) -> float | None:
    return error if np.isfinite(error) else None


@dataclass(frozen=True, eq=False)
class _Side:
    """Values of one model.

    Attributes:
        name: what it is called. terms: the effects. stderr: (p,) inf unseen, NaN unknown.
        covariance: (p, p). notes: what is said of it.
    """

    name: str
    terms: Terms
    stderr: Array
    covariance: Array
    notes: tuple[str, ...] = ()

    def part(self, names: Sequence[str]) -> tuple[Terms, Array, Array]:
        """Of some effects: themselves, their standard errors (q,) and covariance (q, q)."""
        at = np.flatnonzero([effect in names for effect, _key in self.terms.labels])
        return self.terms.only(names), self.stderr[at], self.covariance[np.ix_(at, at)]


def compare_models(
    before: GivenValues, now: GivenValues, robot: GivenRobot | None = None
) -> ModelComparison:
    """Compare the values that two fits found, of other days or data, with their correlations.

    The probability to call any value moved of a robot that has not changed is at most 5 %: half of
    it for all values together (chi2 of d with its covariance), half for the single ones by Holm's
    step-down rule (Scandinavian Journal of Statistics 6, 1979), which holds however they go
    together.

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
    tables = [_table_of(one) for one in (before, now)]
    machine = robot_of(robot) if robot is not None else _machine(tables)
    first, second = (
        _side(*one, machine) for one in zip((before, now), _names(before, now), strict=True)
    )
    notes = [*first.notes, *second.notes]
    in_both = [name for name in first.terms.names if name in second.terms]
    apart = [n for n in in_both if _is_apart(first.terms[n]) or _is_apart(second.terms[n])]
    if apart:
        notes.append(f"{', '.join(apart)}: separate values for files or runs are not compared")
    names = [name for name in in_both if name not in apart]
    parts = first.part(names), second.part(names)
    values, together = _compared(*parts)
    unknown = len(parts[0][1]) - len(values)
    if unknown:
        notes.append(f"{counted(unknown, 'value')} without an error in either: not compared")
    found = ModelComparison(
        before=first.name,
        now=second.name,
        values=values,
        only_before=tuple(n for n in first.terms.names if n not in second.terms),
        only_now=tuple(n for n in second.terms.names if n not in first.terms),
        together=together,
        notes=tuple(notes),
    )
    if found.differs or not values:
        return found
    fitted, covariance = _pooled(*parts)
    source = provenance_of(f"{first.name} + {second.name}", "crosscheck compare")
    pooled = with_fit(new_model(machine), fitted, names, source, {}, covariance)
    return replace(found, pooled=pooled)


# --- what is given --------------------------------------------------------------------------------


def _model_in(given: GivenValues) -> Model:
    """A model, or that of a result."""
    model = given if isinstance(given, Model) else getattr(given, "model", None)
    if isinstance(model, Model):
        return model
    why = ", which has no model" if hasattr(given, "model") else ""
    raise InputError(
        "expected a model, a result that has one, or the path of a model (TOML) or of a "
        f"diagnosis.json, got {type(given).__name__}{why}"
    )


def _is_diagnosis(path: Path) -> bool:
    return path.suffix.lower() == ".json"


def _table_of(given: GivenValues) -> tuple[Path | None, Any]:
    """What is said of the robot, and the file that says it."""
    if not isinstance(given, str | Path):
        return None, _model_in(given).document.get("robot")
    path = path_of(given, "a model")
    document = diagnosis_document(path) if _is_diagnosis(path) else read_document(path)[1]
    return path, document.get("robot")


def _machine(tables: Sequence[tuple[Path | None, Any]]) -> Robot:
    """The robot of the first that says which."""
    for path, table in tables:
        if table is not None:
            return described(path or Path("the model"), table)
    raise InputError(
        "neither model says which robot it was made for; expected a table [robot] in one of them, "
        "as crosscheck writes it, or in Python robot="
    )


def _names(before: GivenValues, now: GivenValues) -> tuple[str, str]:
    """What two models are called: their files as given, else before and now."""
    paths = [
        one if isinstance(one, str | Path) else getattr(one, "path", None) for one in (before, now)
    ]
    words = [
        str(one) if isinstance(one, str | Path) else word
        for one, word in zip(paths, ("before", "now"), strict=True)
    ]
    return (words[0], words[1]) if words[0] != words[1] else ("before", "now")


def _side(given: GivenValues, name: str, robot: Robot) -> _Side:
    if not isinstance(given, str | Path):
        model = _model_in(given)
        notes = check_robot(Path(name), model.document.get("robot"), robot)
        return _side_of_model(model, name, notes)
    path = path_of(given, "a model")
    if _is_diagnosis(path):
        return _side_of_diagnosis(path, name, robot)
    model = load_model(path, robot)
    return _side_of_model(model, name, model.notes)


def _side_of_model(model: Model, name: str, notes: tuple[str, ...]) -> _Side:
    terms = model.terms
    errors = [
        np.where(term.knowledge.fixed, 0.0, model.errors_of(term.name)).ravel() for term in terms
    ]
    stderr = np.concatenate(errors) if errors else np.zeros(0)
    covariance = covariance_of(model)
    if covariance is None:
        return _uncorrelated(name, terms, stderr, notes)
    return _Side(name, terms, stderr, covariance, notes)


def _uncorrelated(name: str, terms: Terms, stderr: Array, notes: tuple[str, ...]) -> _Side:
    """Values whose correlations nobody kept."""
    known = np.where(np.isfinite(stderr), stderr, 0.0)
    if np.count_nonzero(known) > 1:
        notes = (*notes, f"{name} keeps no covariance: its values are taken as uncorrelated")
    return _Side(name, terms, stderr, np.diag(known**2), notes)


def _side_of_diagnosis(path: Path, name: str, robot: Robot) -> _Side:
    document = diagnosis_document(path)
    notes = check_robot(path, document.get("robot"), robot)
    terms = listed_in(path, document, robot)
    cells = {
        f"{item['effect']}.{key}": cell.get("stderr")
        for item in document["missing"]
        for key, cell in item["parameters"].items()
    }
    labels = [f"{effect}.{key}" for effect, key in terms.labels]
    given = [number_of(cells.get(label)) for label in labels]
    stderr = np.array([np.inf if one is None or one < 0.0 else one for one in given], dtype=float)
    kept = _kept_in(path, document.get("fit"), labels)
    if kept is None:
        return _uncorrelated(name, terms, stderr, notes)
    known = np.where(np.isfinite(stderr), stderr, 0.0)
    return _Side(name, terms, stderr, kept * np.outer(known, known), notes)


def _kept_in(path: Path, fit: Any, labels: Sequence[str]) -> Array | None:
    """Correlations (p, p) of values that a diagnosis kept, if any."""
    if fit is None:
        return None
    try:
        order = [list(fit["parameters"]).index(label) for label in labels]
        whole = np.asarray(fit["covariance"], float)[np.ix_(order, order)]
        fine = bool(np.isfinite(whole).all() and np.allclose(whole, whole.T))
    except (TypeError, ValueError, KeyError, IndexError):
        fine = False
    if not fine:
        raise InputFileError.at(
            path,
            "fit: expected parameters and their covariance, as crosscheck diagnose writes them",
        )
    size = np.sqrt(np.diag(whole))
    size = np.where(size > 0.0, size, np.inf)
    correlation = whole / np.outer(size, size)
    np.fill_diagonal(correlation, 1.0)
    return np.asarray(correlation)


def _is_apart(term: Term) -> bool:
    return term.own is not None or isinstance(term.layout, ApartLayout)


# --- what differs ---------------------------------------------------------------------------------

_Part: TypeAlias = tuple[Terms, Array, Array]


def _compared(
    one: _Part, other: _Part
) -> tuple[tuple[ComparedValue, ...], tuple[float, int, float] | None]:
    """The values that both have with errors, and the test of all differences at once."""
    (terms, error, covariance), (now, now_error, now_covariance) = one, other
    both = np.stack([error, now_error])
    kept = np.flatnonzero(~np.isnan(both).any(axis=0) & (both > 0.0).any(axis=0))
    settled = (both < _SETTLED * terms.scale).any(axis=0)
    difference, spread = now.vector - terms.vector, np.hypot(*both)
    # what neither settles is not tested: that is known before any difference is looked at
    tested = np.array([k for k in kept if settled[k] and np.isfinite(spread[k])], dtype=int)
    chances = np.ones(len(terms))
    sizes = np.abs(difference[tested]) / spread[tested]
    chances[tested] = _holm(special.erfc(sizes / np.sqrt(2.0)))
    layouts = [(term.layout, i) for term in terms for i in range(len(term.layout))]
    values = tuple(
        _value(layouts[k], (terms.vector[k], error[k]), (now.vector[k], now_error[k]),
               float(chances[k]), bool(settled[k]))
        for k in kept
    )  # fmt: skip
    if not len(tested):
        return values, None
    whole = (covariance + now_covariance)[np.ix_(tested, tested)]
    return values, _together(difference[tested], whole)


def _value(
    place: tuple[Layout, int], before: tuple[float, float], now: tuple[float, float],
    chance: float, settled: bool,
) -> ComparedValue:  # fmt: skip
    layout, i = place
    moved = chance < _LEVEL
    return ComparedValue(
        layout.name, layout.names[i], layout.units[i], before, now, now[0] - before[0],
        float(np.hypot(before[1], now[1])), chance, moved, settled,
    )  # fmt: skip


def _holm(chances: Array) -> Array:
    """Family-wise probabilities (k,) of single ones (k,), by Holm's step-down rule."""
    order = np.argsort(chances)
    stepped = chances[order] * np.arange(len(chances), 0, -1)
    out = np.empty(len(chances))
    out[order] = np.minimum(np.maximum.accumulate(stepped), 1.0)
    return out


def _directions(whole: Array) -> tuple[Array, Array, NDArray[np.float64]]:
    """Sizes (k,) of values, and the directions (k, d) and variances (d,) of their correlations."""
    size = np.sqrt(np.diag(whole))
    size = np.where(size > 0.0, size, 1.0)
    variance, direction = linalg.eigh(whole / np.outer(size, size))
    kept = variance > _ROUNDING * variance[-1]
    return size, direction[:, kept], variance[kept]


def _together(difference: Array, whole: Array) -> tuple[float, int, float]:
    """chi2 of differences (k,) with their covariance (k, k), its directions and probability."""
    size, direction, variance = _directions(whole)
    along = direction.T @ (difference / size)
    chi2, count = float(np.sum(along**2 / variance)), len(variance)
    return chi2, count, float(special.chdtrc(count, chi2))


def _pooled(one: _Part, other: _Part) -> tuple[list[Fitted], Array]:
    """Values of both, each weighted by its inverse covariance, and their covariance (p, p).

    With K = Ca V^-1 the values are a + K d, with the covariance Ca - K Ca: what Ca^-1 + Cb^-1
    gives, but a combination that both know to the rounding of their digits needs no inverse. What
    one of them does not know is the other's.
    """
    (terms, error, first), (now, now_error, second) = one, other
    vector, stderr = terms.vector.copy(), error.copy()
    alone = ~np.isfinite(error) & np.isfinite(now_error)
    vector[alone], stderr[alone] = now.vector[alone], now_error[alone]
    covariance = np.diag(np.where(np.isfinite(stderr), stderr, 0.0) ** 2)
    both = np.flatnonzero(np.isfinite(error) & np.isfinite(now_error))
    if len(both):
        a, b = (part[np.ix_(both, both)] for part in (first, second))
        size, direction, variance = _directions(a + b)
        inverse = (direction / variance) @ direction.T / np.outer(size, size)
        gain = a @ inverse
        vector[both] += gain @ (now.vector - terms.vector)[both]
        covariance[np.ix_(both, both)] = a - gain @ a
        stderr[both] = np.sqrt(np.maximum(np.diag(covariance)[both], 0.0))
    vector = np.clip(vector, terms.lower, terms.upper)
    fitted = [
        Fitted(term, stderr[terms.part(term.name)], np.zeros(len(term.layout), dtype=bool))
        for term in terms.with_vector(vector)
    ]
    return fitted, covariance
