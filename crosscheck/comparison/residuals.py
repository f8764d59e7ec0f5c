"""A model against measurements: where it is off, by how much, and whether what is left is noise.

Errors are measured less predicted: position [m] and rotation vector [rad] in the base frame
(differences of rx, ry, rz where only some of these were read), tensions [N].
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crosscheck.comparison.associations import Against, Association, associations, channels
from crosscheck.comparison.regions import regions_of
from crosscheck.comparison.travel import Travel, travel
from crosscheck.fit.noise import Whiteness, as_table, whiteness
from crosscheck.fit.prepare import noise_floor, outlying_rows, prepare
from crosscheck.fit.problem import BY_NAME, Problem, Rms, rms_by_kind
from crosscheck.fit.state import State, evaluate
from crosscheck.measurements.data import Measurements
from seecr.effects import Term, Terms
from seecr.pose import Array
from seecr.robot import Robot

_MOST_WORST = 10


@dataclass(frozen=True, eq=False)
class Comparison:
    """A model held against measurements.

    Attributes:
        problem: the data; its ``use`` (n,) says which rows were compared.
        state: the model's prediction and the residuals, ``state.raw`` (n, 6 + m).
        way: commanded motion to each row.
        rms: errors by kind (``position_rms_m``, ...). floor: what noise alone would give.
        coordinates: dicts of one reading each: name, unit, rows, bias, rms, max, line (of max).
        runs, directions, regions: dicts with name, rows and the rms by kind.
        associations: see :func:`crosscheck.comparison.associations.associations`.
        worst: dicts of rows, the worst first: row, line, run, command, errors, times_noise.
        whiteness: is what is left noise; None where nothing could be compared.
        unsolved: dicts of rows that the model has no equilibrium for: line, run, why.
        notes: what was assumed, estimated or left out.
    """

    problem: Problem
    state: State
    way: Travel
    rms: Rms
    floor: Rms
    coordinates: tuple[dict[str, Any], ...]
    runs: tuple[dict[str, Any], ...]
    directions: tuple[dict[str, Any], ...]
    regions: tuple[dict[str, Any], ...]
    associations: tuple[Association, ...]
    worst: tuple[dict[str, Any], ...]
    whiteness: Whiteness | None
    unsolved: tuple[dict[str, Any], ...]
    notes: tuple[str, ...]

    @property
    def terms(self) -> Terms:
        """The model's effects."""
        return self.state.terms

    @property
    def is_noise(self) -> bool:
        """Whether nothing speaks against what is left being noise of the stated size."""
        return self.whiteness is not None and self.whiteness.is_noise

    @property
    def converged(self) -> bool:
        """Whether the model has an equilibrium at every row."""
        return not self.unsolved

    @property
    def sentence(self) -> str:
        """The verdict for a person."""
        return _sentence(self)

    def errors_of(self, kind: str) -> Array:
        """(n,) size of the error of "position" [m], "orientation" [rad], largest "tension" [N].

        NaN in rows that were not compared.
        """
        return BY_NAME[kind].sizes(self.problem, self.state.raw)


def compare(robot: Robot, data: Measurements, terms: Iterable[Term] = ()) -> Comparison:
    """Hold a model against measurements; nothing is fitted.

    Args:
        robot: as described.
        data: its measurements.
        terms: the model's effects with their values.
    """
    model = Terms(terms)
    ready = prepare(robot, data, model)
    problem = ready.problem
    # nothing is fitted here, so nobody asks how cross-validation would cut the data
    notes = [*ready.notes, *([str(ready.refusal)] if ready.refusal else [])]
    plain = problem.experiment.predict(model.effects)
    factor = problem.noise(plain)
    state = evaluate(problem, model, factor)
    way = travel(problem, state.prediction)
    some = problem.n_readings > 0
    if some:
        notes += _outliers(problem, state)
    return Comparison(
        problem=problem,
        state=state,
        way=way,
        rms=rms_by_kind(problem, state.raw),
        floor=noise_floor(problem, state),
        coordinates=tuple(_coordinates(problem, state)),
        runs=tuple(_groups(problem, state, data.run, list(data.runs))),
        directions=tuple(_groups(problem, state, way.direction)),
        regions=tuple(_groups(problem, state, regions_of(problem, way.pose))),
        associations=tuple(associations(problem, state.white, state.prediction) if some else ()),
        worst=tuple(_worst(problem, state, way)),
        whiteness=whiteness(problem, state.white, 0) if some else None,
        unsolved=tuple(_unsolved(problem, state)),
        notes=tuple(dict.fromkeys(notes)),
    )


def _outliers(problem: Problem, state: State) -> list[str]:
    rows = outlying_rows(problem, state)
    if not rows.any():
        return []
    lines = ", ".join(str(k) for k in problem.data.line[rows])
    word = "line" if rows.sum() == 1 else "lines"
    return [f"{word} {lines}: far off all the others, outliers? (counted)"]


def _coordinates(problem: Problem, state: State) -> list[dict[str, Any]]:
    names, units = channels(problem)
    out = []
    for k, (name, unit) in enumerate(zip(names, units, strict=True)):
        rows = np.flatnonzero(problem.counted[:, k])
        if len(rows) == 0:
            continue
        values = state.raw[rows, k]
        top = int(np.argmax(np.abs(values)))
        out.append(
            {
                "name": name,
                "unit": unit,
                "rows": len(rows),
                "bias": float(values.mean()),
                "rms": float(np.sqrt((values**2).mean())),
                "max": float(values[top]),
                "line": int(problem.data.line[rows[top]]),
            }
        )
    return out


def _groups(
    problem: Problem, state: State, labels: NDArray[Any], order: list[str] | None = None
) -> list[dict[str, Any]]:
    """The rms errors of each group of rows."""
    out = []
    for name in order if order is not None else sorted(set(labels[problem.use].tolist())):
        rows = (labels == name) & problem.use
        part = problem.only(rows)
        if part.n_readings:
            errors = rms_by_kind(part, state.raw)
            out.append({"name": str(name), "rows": int(rows.sum()), **errors})
    return out


def _worst(problem: Problem, state: State, way: Travel) -> list[dict[str, Any]]:
    counted = problem.counted
    table = np.where(counted, as_table(problem, state.white), 0.0)
    number_of = counted.sum(axis=1)
    size = np.sqrt((table**2).sum(axis=1) / np.maximum(number_of, 1))
    rows = [int(k) for k in np.argsort(-size) if number_of[k]]
    names, units = channels(problem)
    out = []
    for k in rows[:_MOST_WORST]:
        errors = {
            f"{name} [{unit}]": float(state.raw[k, c])
            for c, (name, unit) in enumerate(zip(names, units, strict=True))
            if counted[k, c]
        }
        place = {"row": k, "line": int(problem.data.line[k]), "run": str(problem.data.run[k])}
        command = [float(v) for v in way.pose[k]]
        out.append({**place, "command": command, "errors": errors, "times_noise": float(size[k])})
    return out


def _unsolved(problem: Problem, state: State) -> list[dict[str, Any]]:
    prediction = state.prediction
    rows = np.flatnonzero(~prediction.solved)
    if len(rows) == 0:
        return []
    status = prediction.solution().status
    slack = np.asarray(prediction.slack.all(axis=1))
    return [
        {
            "row": int(k),
            "line": int(problem.data.line[k]),
            "run": str(problem.data.run[k]),
            "why": status[k].value + ("; every cable is slack" if slack[k] else ""),
        }
        for k in rows
    ]


def _sentence(found: Comparison) -> str:
    w = found.whiteness
    if w is None:
        why = f": {found.unsolved[0]['why']}" if found.unsolved else ""
        return f"Nothing could be compared{why}."
    if w.is_noise:
        return f"Model and data agree: what is left is noise ({w.scale:.2f} times the stated one)."
    size = f"the errors are {w.scale:.3g} times the noise"
    if not w.structured:
        return (
            f"What is left looks random, but {size}: the noise is stated too small, or many small "
            "effects are missing."
        )
    strong = [a for a in found.associations if a.significant]
    goes = ""
    if strong:
        share = 100 * strong[0].share
        goes = f"; {share:.0f} % of their variance goes with {strong[0].against}"
        if strong[0].kind is Against.EVERYWHERE:
            goes = f"; {share:.0f} % of their square is the same everywhere"
    return f"The model misses something: {size}, and neighbouring rows agree in them{goes}."


def as_json(found: Comparison) -> dict[str, Any]:
    """The content of ``comparison.json``: SI, null where there is no number."""
    problem, w = found.problem, found.whiteness
    return {
        "sentence": found.sentence,
        "is_noise": found.is_noise,
        "robot": problem.robot.name,
        "data": str(problem.data.path),
        "model": {
            t.name: dict(zip(t.layout.names, map(float, t.vector), strict=True))
            for t in found.terms
        },
        "rows": {"all": problem.data.n_rows, "compared": int(problem.use.sum())},
        "rms": found.rms,
        "noise_floor": found.floor,
        "sigma": vars(problem.sigma),
        "residual": None if w is None else {**vars(w), "structured": w.structured},
        "coordinates": list(found.coordinates),
        "runs": list(found.runs),
        "directions": list(found.directions),
        "regions": list(found.regions),
        "associations": list(found.associations),
        "worst": list(found.worst),
        "unsolved": list(found.unsolved),
        "poses": _rows(found),
        "notes": list(found.notes),
    }


def _rows(found: Comparison) -> dict[str, Any]:
    """Every row: errors by reading, in the order of ``channels``; null where not compared."""
    problem = found.problem
    names, units = channels(problem)
    raw = np.where(problem.counted, found.state.raw, np.nan)
    return {
        "line": problem.data.line.tolist(),
        "run": problem.data.run.tolist(),
        "command": found.way.pose.tolist(),
        "direction": found.way.direction,
        "speed_m_per_s": found.way.speed,
        "slack_cables": found.state.prediction.slack.sum(axis=1).tolist(),
        "channels": [f"{n} [{u}]" for n, u in zip(names, units, strict=True)],
        "error": raw,
    }
