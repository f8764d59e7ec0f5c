"""Effects with values of their own for each file or run: rows are solved part by part.

No row depends on one of another file or run, whatever the effects. The results of the parts are
joined as if there were only one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import TypeGuard

import numpy as np
from numpy.typing import NDArray

from seecr.effects import Apart, ApartLayout, Term, Terms
from seecr.effects.base import Effect, Readings
from seecr.pose import Array
from seecr.prediction.experiment import Experiment, Prediction, sensors_among
from seecr.prediction.sensitivity import read_by_length, sensitivities
from seecr.statics import batch
from seecr.statics.tables import Tables


@dataclass(frozen=True, eq=False)
class Part:
    """Rows for which the effects have the same values.

    Attributes:
        rows: (k,) their indices. names: those of their "file" and "run". experiment: of these rows.
    """

    rows: NDArray[np.intp]
    names: Mapping[str, str]
    experiment: Experiment

    def effects(self, effects: Sequence[Effect]) -> list[Effect]:
        """The effects with their values for these rows."""
        return [e.at(self.names[e.kind]) if isinstance(e, Apart) else e for e in effects]

    def terms(self, terms: Terms) -> tuple[Terms, NDArray[np.intp]]:
        """The terms with their values here, and each parameter's index among all, -1 for none."""
        here: list[Term] = []
        places: list[NDArray[np.intp]] = []
        for term in terms:
            own, layout = np.arange(len(term.layout)) + terms.part(term.name).start, term.layout
            if isinstance(layout, ApartLayout):
                name = self.names[layout.kind]
                known = name in layout.parts
                some = layout.part(name) if known else slice(0, len(layout.base))
                own = own[some] if known else np.full(len(layout.base), -1)
                here.append(Term(layout.base, term.vector[some] if known else layout.rest))
            else:
                here.append(term)
            places.append(own)
        return Terms(here), np.concatenate([np.zeros(0, dtype=np.intp), *places])


@dataclass(eq=False, repr=False)
class PartedPrediction(Prediction):
    """A prediction whose ``parts`` were solved separately; ``rows`` has the row indices of each."""

    parts: tuple[Prediction, ...] = ()
    rows: tuple[NDArray[np.intp], ...] = ()

    def with_rows(self, other: Prediction, rows: NDArray[np.bool_]) -> Prediction:
        whole = super().with_rows(other, rows)
        assert isinstance(whole, PartedPrediction) and isinstance(other, PartedPrediction)
        both = zip(self.parts, other.parts, self.rows, strict=True)
        return replace(whole, parts=tuple(a.with_rows(b, rows[own]) for a, b, own in both))


@dataclass(eq=False)
class Parted(Experiment):
    """An experiment that knows which rows share the values of effects."""

    _parts: dict[tuple[str, ...], list[Part]] = field(default_factory=dict, repr=False)

    def with_length_errors(self, errors: Array | None) -> Parted:
        same = (self.robot, self.commands, errors, self._path, self._plain)
        return Parted(*same, _led=self._led, _parts=self._parts)

    def parts(self, effects: Sequence[Effect]) -> list[Part]:
        """The groups of rows that share values under some effects; empty if all rows do."""
        kinds = tuple(sorted({e.kind for e in effects if isinstance(e, Apart)}))
        if not kinds or any(kind not in self.commands.parts for kind in kinds):
            return []
        if kinds not in self._parts:
            self._parts[kinds] = [
                Part(rows, names, Experiment(self.robot, self.commands.rows(rows)))
                for names, rows in self._together(kinds)
            ]
        errors = self.length_errors
        if errors is None:
            return self._parts[kinds]
        return [
            replace(p, experiment=p.experiment.with_length_errors(errors[p.rows]))
            for p in self._parts[kinds]
        ]

    def _together(self, kinds: Sequence[str]) -> list[tuple[dict[str, str], NDArray[np.intp]]]:
        """Names of files and runs, and the rows that belong to them, in the order of the rows."""
        columns = [self.commands.parts[kind].tolist() for kind in kinds]
        rows: dict[tuple[str, ...], list[int]] = {}
        for k, names in enumerate(zip(*columns, strict=True)):
            rows.setdefault(names, []).append(k)
        return [(dict(zip(kinds, n, strict=True)), np.array(r)) for n, r in rows.items()]

    def predict(
        self, effects: Sequence[Effect] = (), near: Prediction | None = None,
        needed: NDArray[np.bool_] | None = None,
    ) -> Prediction:  # fmt: skip
        parts = self.parts(effects)
        if not parts:
            return super().predict(effects, near, needed)
        # a prediction that is divided into other parts is no help
        nearby = near.parts if near is not None and _is_of(near, parts) else (None,) * len(parts)
        found = [
            part.experiment.predict(
                part.effects(effects), at, None if needed is None else needed[part.rows]
            )
            for part, at in zip(parts, nearby, strict=True)
        ]
        return self._joined(effects, parts, found)

    def readings_at(self, effects: Sequence[Effect], poses: Array) -> Readings:
        parts = self.parts(effects)
        if not parts:
            return super().readings_at(effects, poses)
        order = np.argsort(np.concatenate([part.rows for part in parts]))
        return _readings(
            [p.experiment.readings_at(p.effects(effects), poses[p.rows]) for p in parts], order
        )

    def from_other_starts(
        self, effects: Sequence[Effect], at: Prediction, rows: NDArray[np.intp], poses: Array
    ) -> Prediction:
        if not isinstance(at, PartedPrediction):
            return super().from_other_starts(effects, at, rows, poses)
        parts, found = self.parts(effects), []
        for part, own in zip(parts, at.parts, strict=True):
            mine = np.flatnonzero(np.isin(rows, part.rows))
            here = np.searchsorted(part.rows, rows[mine])
            found.append(
                part.experiment.from_other_starts(part.effects(effects), own, here, poses[mine])
                if len(mine)
                else own
            )
        return self._joined(effects, parts, found)

    def _joined(
        self, effects: Sequence[Effect], parts: Sequence[Part], found: Sequence[Prediction]
    ) -> PartedPrediction:
        """The predictions of the parts as one."""
        order = np.argsort(np.concatenate([part.rows for part in parts]))
        tables = _tables([one.tables for one in found], order)
        whole = batch.Evaluation.at_commands(tables)
        for part, one in zip(parts, found, strict=True):
            whole.put(part.rows, one.found)
        readings = _readings([one.readings for one in found], order)
        history = any(one.has_history for one in found)
        return PartedPrediction(
            self.setup(effects), tables, whole, readings, history, sensors_among(effects),
            parts=tuple(found), rows=tuple(part.rows for part in parts),
        )  # fmt: skip


def _readings(parts: Sequence[Readings], order: NDArray[np.intp]) -> Readings:
    """Readings stacked, in a given order of their rows."""
    names = [f.name for f in fields(Readings)]
    stacked = {name: np.concatenate([getattr(one, name) for one in parts]) for name in names}
    return Readings(**{name: values[order] for name, values in stacked.items()})


def _is_of(at: Prediction, parts: Sequence[Part]) -> TypeGuard[PartedPrediction]:
    """Whether a prediction was solved part by part, with the same rows in each."""
    return (
        isinstance(at, PartedPrediction)
        and len(at.rows) == len(parts)
        and all(np.array_equal(rows, part.rows) for rows, part in zip(at.rows, parts, strict=True))
    )


def _tables(parts: Sequence[Tables], order: NDArray[np.intp]) -> Tables:
    """Tables stacked, in a given order of their rows."""
    first = parts[0]

    def rows(name: str) -> Array:
        return np.concatenate([getattr(part, name) for part in parts])[order]

    return Tables(
        rows("cables"), rows("load"), rows("poses"), rows("screws"),
        first.length, rows("scale"), rows("reach"), first.n_dof,
    )  # fmt: skip


def rates_by_length(at: Prediction) -> Array:
    """Like :func:`.sensitivity.read_by_length`, but part by part if the prediction has parts."""
    if not isinstance(at, PartedPrediction):
        return read_by_length(at)
    n, m = at.tensions.shape
    out = np.empty((n, 6 + m, m))
    for rows, part in zip(at.rows, at.parts, strict=True):
        out[rows] = read_by_length(part)
    return out


def rates(
    experiment: Experiment, terms: Terms, at: Prediction, columns: Sequence[int] = (),
    frozen: bool = False,
) -> Array:  # fmt: skip
    """Like :func:`.sensitivity.sensitivities`, but part by part if effects differ between rows."""
    parts = experiment.parts(terms.effects) if isinstance(experiment, Parted) else []
    if not parts:
        return sensitivities(experiment, terms, at, columns, frozen)
    if not _is_of(at, parts):
        at = experiment.predict(terms.effects)
        assert _is_of(at, parts)
    wanted = np.array(list(columns) if len(columns) else range(len(terms)))
    n, m = at.tables.cables.shape[:2]
    out = np.zeros((n, 6 + m, len(wanted)))
    for part, own in zip(parts, at.parts, strict=True):
        here, places = part.terms(terms)
        asked = np.flatnonzero(np.isin(places, wanted))
        if len(asked) == 0:
            continue
        found = sensitivities(part.experiment, here, own, asked.tolist(), frozen)
        for c, place in enumerate(places[asked]):
            out[np.ix_(part.rows, np.arange(6 + m), np.flatnonzero(wanted == place))] = found[
                ..., c : c + 1
            ]
    return out
