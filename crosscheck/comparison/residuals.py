"""The command ``compare``: where a model is off, by how much, and whether the rest is noise."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from crosscheck.comparison.associations import associations
from crosscheck.comparison.noise import coloured_noise, note_on_few, rows_far_off
from crosscheck.comparison.quantities import Travel, channels, regions_of, travel
from crosscheck.comparison.result import (
    Comparison,
    Coordinate,
    Group,
    UnsolvedRow,
    WorstRow,
    tracking,
)
from crosscheck.fit.problem import Problem, kinds_read, rms_by_kind
from crosscheck.fit.residual_noise import as_table, whiteness
from crosscheck.fit.state import State, contradictions, evaluate
from crosscheck.fit.words import rms_words
from crosscheck.given import GivenModel, GivenRobot, model_of, robot_of
from crosscheck.measurements.data import GivenSigma, Names
from crosscheck.measurements.read import GivenData, measurements_of
from crosscheck.preparation.prepare import noise_floor, prepare

_MOST_WORST = 10


def compare(
    robot: GivenRobot, data: GivenData, model: GivenModel = (), *, sigma: GivenSigma = None
) -> Comparison:
    """Compare a model with measurements; only values that the data leave free are fitted.

    All errors are those of all rows. What they depend on, and whether they are noise, is asked
    without outliers.

    Args:
        robot: a robot, or its MJCF file.
        data: its measurements, or their file.
        model: the effects with their values, or their file; by default the plain model.
        sigma: noise of the readings, in place of what the files state: metres, ``"0.1mm"`` or a
            :class:`crosscheck.Sigma`.

    Returns:
        errors by coordinate, run, pose and region, and whether they are noise.

    Raises:
        InputFileError, RobotError: a file cannot be read, or is of another robot.

    Example:
        ``crosscheck.compare("robot.xml", "measured.csv", "model.toml").rms``
    """
    robot = robot_of(robot)
    data = measurements_of(data, robot, sigma)
    terms, said = model_of(model, robot)
    ready = prepare(robot, data, terms, outliers=rows_far_off)
    problem, outliers = ready.problem, ready.far_off
    if outliers is None:  # of data without readings nobody looks for any
        outliers = np.zeros(data.n_rows, dtype=bool)
    notes = [*said, *contradictions(terms), *ready.notes]
    terms = ready.terms
    factor = problem.noise_under(terms.effects)
    state = evaluate(problem, terms, factor, predicted=ready.plain)
    way = travel(problem, state.prediction)
    judged, left = problem, state
    if outliers.any():
        judged = problem.only(~outliers)
        left = state.among(judged)
        without = rms_words(rms_by_kind(judged, state.raw))
        notes.append(
            f"{data.lines_of(outliers)}: possible outliers, included in all errors (without them "
            f"{without} rms), but not in what these depend on, nor in whether they are noise"
        )
    some = judged.n_readings > 0
    white = whiteness(judged, left.white, ready.fitted) if some else None
    coloured = None
    if white and not white.is_noise:
        coloured = coloured_noise(judged, left, factor)
        notes += note_on_few(judged)
    return Comparison(
        problem=problem,
        state=state,
        way=way,
        rms=rms_by_kind(problem, state.raw),
        floor=noise_floor(problem, state),
        coordinates=tuple(_coordinates(problem, state)),
        runs=tuple(_groups(problem, state, data.run, data.runs)),
        directions=tuple(_groups(problem, state, way.direction)),
        regions=tuple(_groups(problem, state, regions_of(problem, way.pose))),
        associations=tuple(associations(judged, left, left.white, way) if some else ()),
        worst=tuple(_worst(problem, state, way)),
        whiteness=white,
        coloured=coloured,
        unsolved=tuple(_unsolved(problem, state)),
        notes=tuple(dict.fromkeys(notes)),
        times_noise=_times_noise(judged, left),
        outliers=outliers,
        rms_without=rms_by_kind(judged, state.raw),
        refusal=ready.refusal,
        tracking=tracking(problem, state),
    )


def _times_noise(problem: Problem, state: State) -> dict[str, float]:
    """The rms of whitened residuals, by kind of reading."""
    table = as_table(problem, state.white)
    return {
        kind.name: float(np.sqrt(np.nanmean(table[:, kind.columns] ** 2)))
        for kind in kinds_read(problem)
    }


def _coordinates(problem: Problem, state: State) -> Iterator[Coordinate]:
    for k, (name, unit) in enumerate(zip(*channels(problem), strict=True)):
        rows = np.flatnonzero(problem.counted[:, k])
        if len(rows) == 0:
            continue
        values = state.raw[rows, k]
        top = int(np.argmax(np.abs(values)))
        yield Coordinate(
            name=name,
            unit=unit,
            rows=len(rows),
            bias=float(values.mean()),
            rms=float(np.sqrt((values**2).mean())),
            max=float(values[top]),
            row=int(rows[top]),
            line=int(problem.data.line[rows[top]]),
        )


def _groups(
    problem: Problem, state: State, labels: Names, order: Iterable[str] | None = None
) -> Iterator[Group]:
    """The rms errors of each group of rows."""
    for name in order if order is not None else sorted(set(labels[problem.use].tolist())):
        rows = (labels == name) & problem.use
        part = problem.only(rows)
        if part.n_readings:
            yield Group(str(name), int(rows.sum()), rms_by_kind(part, state.raw))


def _worst(problem: Problem, state: State, way: Travel) -> Iterator[WorstRow]:
    counted, data = problem.counted, problem.data
    table = np.where(counted, as_table(problem, state.white), 0.0)
    number_of = counted.sum(axis=1)
    size = np.sqrt((table**2).sum(axis=1) / np.maximum(number_of, 1))
    rows = [int(k) for k in np.argsort(-size) if number_of[k]]
    readings = [f"{name} [{unit}]" for name, unit in zip(*channels(problem), strict=True)]
    for k in rows[:_MOST_WORST]:
        errors = {readings[c]: float(state.raw[k, c]) for c in np.flatnonzero(counted[k])}
        line, run = int(data.line[k]), str(data.run[k])
        yield WorstRow(k, line, run, way.pose[k], errors, float(size[k]))


def _unsolved(problem: Problem, state: State) -> Iterator[UnsolvedRow]:
    prediction, data = state.prediction, problem.data
    rows = np.flatnonzero(~prediction.solved & data.read)
    if len(rows) == 0:
        return
    status = prediction.solution().status
    idle = set(np.flatnonzero(np.all(prediction.slack, axis=1)).tolist())
    for k in rows.tolist():
        yield UnsolvedRow(k, int(data.line[k]), str(data.run[k]), status[k], k in idle)
