"""The result of comparing a model with measurements: its errors by reading, group and row.

Errors are measured minus predicted: position [m] and rotation vector [rad] in the base frame
(differences of rx, ry, rz if only some of these were read), tensions [N].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crosscheck.comparison.associations import Association
from crosscheck.comparison.noise import Coloured
from crosscheck.comparison.quantities import QuantityKind, Travel, channels
from crosscheck.fit.problem import (
    BY_NAME,
    KINDS,
    Kind,
    Problem,
    Rms,
    kinds_read,
    kinds_stated,
)
from crosscheck.fit.reasons import Refusal
from crosscheck.fit.residual_noise import Whiteness, errors_are_noise
from crosscheck.fit.state import State
from crosscheck.measurements.data import Measurements
from seecr.counted import counted
from seecr.description.joints import locked
from seecr.effects import Terms
from seecr.pose import Array
from seecr.result import Record, Result, named, rows_of
from seecr.statics.solution import Status
from seecr.units import in_unit, short

# What a comparison concludes, in one sentence.
#
# Residuals look random only if neighbours are not correlated and they depend on nothing that was
# tested. They may then be noise that was stated somewhat too small, but hardly many times too
# small.

# Noise is hardly so many times what is stated. A kind of reading is at its noise up to _AT_NOISE
# times it, if another is far off.
_HARDLY, _AT_NOISE = 3.0, 1.5


def noise_sentence(white: Whiteness, known_as: str, associations: Sequence[Association]) -> str:
    """That white residuals are noise, "stated" or "estimated", and what they still depend on."""
    goes = _goes_with(associations)
    but = f", but {goes}" if goes else ""
    times = f"{white.scale:.2f} times the {known_as} noise"
    return f"Model and data agree: the residuals are noise ({times}){but}."


def misfit_sentence(
    white: Whiteness,
    times: Mapping[str, float],
    known_as: str,
    associations: Sequence[Association],
) -> str:
    """That residuals are no noise of the "stated" or "estimated" size, and what they look like.

    ``times`` holds their rms over the noise, by kind of reading.
    """
    size, goes = error_size_words(white.scale, times), _goes_with(associations)
    end = f"; {goes}" if goes else ""
    if white.structured:
        return f"The model misses something: {size} and correlated between neighbouring rows{end}."
    if goes:
        return f"The model misses something: {size}{end}."
    most = max(times.values())
    if most <= _HARDLY:
        return (
            f"The residuals look random, but {size}: either it is {known_as} too small, or many "
            "small effects are missing."
        )
    return (
        f"The model misses something, or the noise is {known_as} {most:.3g} times too small: "
        f"{size}, and depend on nothing that was tested."
    )


def error_size_words(scale: float, times: Mapping[str, float]) -> str:
    """How large errors are; which kinds of reading, if others are at their noise."""
    far = {kind: value for kind, value in times.items() if value > _AT_NOISE}
    near = [kind for kind in times if kind not in far]
    if not (far and near):
        return f"the errors are {scale:.3g} times the noise"
    own = " and ".join(far)
    sizes = " and ".join(f"{value:.3g}" for value in far.values())
    return (
        f"the errors of {own} are {sizes} times the noise (those of {' and '.join(near)} are noise)"
    )


def _goes_with(associations: Sequence[Association]) -> str:
    """What the errors depend on most, as a clause; "" if on nothing that was tested."""
    strongest = next((a for a in associations if a.significant), None)
    if strongest is None:
        return ""
    share = f"{100 * strongest.share:.0f} %"
    if strongest.kind is QuantityKind.EVERYWHERE:
        return f"{share} of their mean square is a constant offset"
    return f"{strongest.against} explains {share} of their variance"


# How far the platform is from where it was wanted, whatever a model predicts: tracking errors.

# The kinds of readings that have a wanted value, with the columns of a wanted pose.
_PARTS = (("position", slice(0, 3)), ("orientation", slice(3, 7)))


@dataclass(frozen=True)
class Away:
    """Distances of one kind, such as of positions.

    Attributes:
        kind: "position" or "orientation". unit: unit of the numbers. rows: number of rows.
        rms, max: root mean square and largest of the rows' distances: lengths of whole vectors.
        row, line: where the largest is, counted from 0, and in its file.
    """

    kind: str
    unit: str
    rows: int
    rms: float
    max: float
    row: int
    line: int


@dataclass(frozen=True)
class Tracking:
    """How far readings are from the wanted poses.

    Attributes:
        wanted: whether these are stated (columns ``want_*``); else they are the commanded poses.
        through_tracker: whether the model's tracker does not read poses as they are. Readings are
            then compared with what it would read at the wanted poses.
        away: distances by kind.
    """

    wanted: bool
    through_tracker: bool
    away: tuple[Away, ...]

    def as_json(self) -> dict[str, Any]:
        """As in ``comparison.json``: null for a kind that was not read or not wanted."""
        by_kind = {one.kind: one for one in self.away}
        return {
            "from": "wanted" if self.wanted else "commanded",
            "through_tracker": self.through_tracker,
            **{kind: by_kind.get(kind) for kind, _columns in _PARTS},
        }

    @property
    def title(self) -> str:
        """What the distances are of, in words."""
        words = "off the wanted poses" if self.wanted else "off the commanded poses"
        return f"{words}, read through the model's tracker" if self.through_tracker else words

    def words(self, data: Measurements) -> str:
        """The distances in one line, with the places of the largest in the data."""
        parts = []
        for one in self.away:
            factor, unit = in_unit(one.unit)
            rms, most = short(factor * one.rms), short(factor * one.max)
            parts.append(
                f"{one.kind} {rms} {unit} rms, {most} {unit} at most (line {data.place(one.row)})"
            )
        return f"{self.title}: {'; '.join(parts)}"


def tracking(problem: Problem, state: State) -> Tracking | None:
    """How far the readings of a problem are from the wanted poses, else from the commanded ones.

    All rows count, also those for which the model has no equilibrium. Directions that the joints
    lock do not count: no command moves the platform there. The model matters only for what its
    tracker reads.

    Returns:
        the distances; None if no reading has a wanted value.
    """
    data = problem.data
    poses = data.command_pose if data.wanted is None else data.wanted
    if poses is None:
        return None
    there = np.asarray(np.isfinite(poses))
    whole = np.where(there, poses, problem.robot.reference_pose)
    seen = problem.experiment.readings_at(state.terms.effects, whole)
    as_they_are = (whole[:, :3], whole[:, 3:])
    through = not all(map(np.array_equal, (seen.position, seen.quat_wxyz), as_they_are))
    raw, moves = problem.residuals(seen), ~locked(problem.robot)
    away = []
    for name, columns in _PARTS:
        kind = BY_NAME[name]
        given = there[:, columns]
        if name == "orientation":  # of a quaternion no part is wanted by itself
            given = np.repeat(np.all(given, axis=1, keepdims=True), 3, axis=1)
        both = given & problem.measured[:, kind.columns] & moves[kind.columns]
        one = _away(problem, kind, np.where(both, raw[:, kind.columns], np.nan))
        away += [] if one is None else [one]
    return Tracking(data.wanted is not None, through, tuple(away)) if away else None


def _away(problem: Problem, kind: Kind, off: Array) -> Away | None:
    """The distances of errors (n, 3) of one kind, NaN where nothing was read or wanted."""
    rows = np.flatnonzero(np.isfinite(off).any(axis=1))
    if len(rows) == 0:
        return None
    sizes = np.linalg.norm(np.nan_to_num(off[rows]), axis=1)
    top = int(np.argmax(sizes))
    row = int(rows[top])
    return Away(
        kind=kind.name,
        unit=kind.si,
        rows=len(rows),
        rms=float(np.sqrt(np.mean(sizes**2))),
        max=float(sizes[top]),
        row=row,
        line=int(problem.data.line[row]),
    )


@dataclass(frozen=True)
class Coordinate:
    """The errors of one reading.

    Attributes:
        name: name of the reading. unit: unit of the numbers. rows: number of rows compared.
        bias, rms, max: mean, root mean square, and the error that is largest in size.
        row, line: where the largest is, counted from 0, and in its file.
    """

    name: str
    unit: str
    rows: int
    bias: float
    rms: float
    max: float
    row: int
    line: int


@dataclass(frozen=True, eq=False)
class Group:
    """The errors of rows that have a run, a direction of travel or a region in common.

    Attributes:
        name: what they have in common. rows: number of rows compared. rms: errors by kind.
    """

    name: str
    rows: int
    rms: Rms

    def as_json(self) -> dict[str, Any]:
        """As in ``comparison.json``."""
        return {"name": self.name, "rows": self.rows, **self.rms}


@dataclass(frozen=True, eq=False)
class WorstRow:
    """A row with large errors.

    Attributes:
        row: number from 0. line, run: where it is in the file. command: (7,) commanded pose.
        errors: errors by reading with its unit. times_noise: rms of the errors over their noise.
    """

    row: int
    line: int
    run: str
    command: Array
    errors: dict[str, float]
    times_noise: float


@dataclass(frozen=True)
class UnsolvedRow:
    """A row for which the model has no equilibrium.

    Attributes:
        row: number from 0. line, run: where it is in the file. status: how the solve ended.
        all_slack: whether no cable pulls.
    """

    row: int
    line: int
    run: str
    status: Status
    all_slack: bool

    @property
    def why(self) -> str:
        """How the solve ended, in words."""
        return self.status.value + ("; every cable is slack" if self.all_slack else "")

    def as_json(self) -> dict[str, Any]:
        """As in ``comparison.json``."""
        return {"row": self.row, "line": self.line, "run": self.run, "why": self.why}


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Result):
    """A model compared with measurements.

    Attributes:
        problem: the data; its ``use`` (n,) says which rows were compared.
        state: the model's predictions and the residuals, ``state.raw`` (n, 6 + m).
        way: commanded motion to each row.
        rms: errors by kind (``position_rms_m``, ...). floor: what noise alone would give.
        coordinates: errors of each reading. runs, directions, regions: errors of groups of rows.
        associations: what the errors are associated with, the strongest first.
        worst: rows with the largest errors, the worst first.
        whiteness: tests whether the residuals are noise; None if nothing could be compared.
        times_noise: rms of the residuals over the noise, by kind of reading.
        outliers: (n,) rows that ``associations``, ``whiteness``, ``coloured`` and ``times_noise``
            leave out; all errors include them.
        rms_without: errors by kind without outliers.
        coloured: the residuals as noise with autocorrelation or outliers; None if they are white
            noise, or no noise.
        unsolved: rows for which the model has no equilibrium.
        notes: what was assumed, estimated or left out.
        refusal: why the data are insufficient for a verdict; None if they are not.
        tracking: how far the readings are from the wanted poses, else from the commanded ones; None
            if these are lengths alone, or no pose was read.
    """

    problem: Problem
    state: State
    way: Travel
    rms: Rms
    floor: Rms
    coordinates: tuple[Coordinate, ...]
    runs: tuple[Group, ...]
    directions: tuple[Group, ...]
    regions: tuple[Group, ...]
    associations: tuple[Association, ...]
    worst: tuple[WorstRow, ...]
    whiteness: Whiteness | None
    coloured: Coloured | None
    unsolved: tuple[UnsolvedRow, ...]
    notes: tuple[str, ...]
    times_noise: dict[str, float]
    outliers: NDArray[np.bool_]
    rms_without: Rms
    refusal: Refusal | None = None
    tracking: Tracking | None = None

    @property
    def terms(self) -> Terms:
        """The model's effects."""
        return self.state.terms

    @property
    def is_noise(self) -> bool:
        """Whether the data suffice for a verdict and the residuals are noise, white or coloured."""
        if self.whiteness is None or self.refusal is not None:
            return False
        return self.whiteness.is_noise or (self.coloured is not None and not self.coloured.open)

    @property
    def is_open(self) -> bool:
        """Whether the residuals may as well be noise, of unstated size, as something missing."""
        return self.refusal is None and self.coloured is not None and self.coloured.open

    @property
    def converged(self) -> bool:
        """Whether the model has an equilibrium at every row."""
        return not self.unsolved

    def errors_of(self, kind: str) -> Array:
        """(n,) size of the error of "position" [m], "orientation" [rad], largest "tension" [N].

        NaN in rows that were not compared.
        """
        return BY_NAME[kind].sizes(self.problem, self.state.raw)

    def place(self, row: int) -> str:
        """A row's commanded position in words; if lengths are commanded, the predicted one."""
        x, y, z = self.way.pose[row, :3]
        word = "commanded" if self.problem.data.command_lengths is None else "predicted"
        return f"{word} ({x:.4g} {y:.4g} {z:.4g}) m"

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        w = self.whiteness
        if w is None:
            why = f": {self.unsolved[0].why}" if self.unsolved else ""
            return f"Nothing could be compared{why}."
        if self.refusal is not None:
            said = f"No verdict: {self.refusal}; {self.refusal.remedy}."
            if w.is_noise or self.coloured is not None:
                return said
            if errors_are_noise(self.problem, self.state.prediction):
                return said  # so many times themselves says nothing
            size = error_size_words(w.scale, self.times_noise)
            return f"{said} {size[0].upper()}{size[1:]}."
        if w.is_noise:
            said = noise_sentence(w, self._known_as, self.associations)
        elif self.coloured is not None:
            noise = self.coloured.sizes if self.outliers.any() else self.coloured.words
            said = f"Model and data agree: the residuals are noise ({noise})."
            if self.coloured.open:
                said = (
                    f"The residuals may be noise ({noise}), but as its size was not stated, they "
                    "may as well be something that the model misses and that varies as smoothly: "
                    "state the noise."
                )
        else:
            said = misfit_sentence(w, self.times_noise, self._known_as, self.associations)
        if not self.outliers.any():
            return said
        further = 0 if w.is_noise or self.coloured is None else self.coloured.outliers
        rows = counted(int(self.outliers.sum()) + further, "outlier")
        if further:
            return f"{said} {rows} left out of this, or given little weight."
        return f"{said} {rows} ({self.problem.data.lines_of(self.outliers)}) left out of this."

    @property
    def _known_as(self) -> str:
        """How the size of the noise is known."""
        stated = kinds_stated(self.problem) == kinds_read(self.problem)
        return "stated" if stated else "estimated"

    def lines(self) -> list[str]:
        """The errors by kind beside the noise, and the verdict."""
        data = self.problem.data
        sizes = [
            f"{kind.name} {short(kind.factor * value)} {kind.unit} rms "
            f"(noise {short(kind.factor * (self.floor[kind.key] or 0.0))})"
            for kind in KINDS
            if (value := self.rms[kind.key]) is not None
        ]
        rows = f"{int(self.problem.use.sum())} of {counted(data.n_rows, 'row')}"
        head = f"{data.name}: {rows} compared"
        return [head, *sizes, self.sentence]

    def records(self) -> list[Record]:
        """The errors of every row, readings that were measured; None where one was not compared."""
        data, measured = self.problem.data, np.asarray(self.problem.measured.any(axis=0))
        every = zip(*channels(self.problem), measured, strict=True)
        heads = [f"{name.replace(' ', '_')}_{unit}" for name, unit, there in every if there]
        errors = np.where(self.problem.counted, self.state.raw, np.nan)[:, measured].astype(object)
        errors[errors != errors] = None
        return rows_of({"line": data.line, "run": data.run, **named("{}", heads, errors)})

    def as_json(self) -> dict[str, Any]:
        """The content of ``comparison.json``: SI, null where a number does not exist."""
        problem, w = self.problem, self.whiteness
        return {
            "sentence": self.sentence,
            "is_noise": self.is_noise,
            "robot": problem.robot.name,
            "data": str(problem.data.path),
            "model": {t.name: dict(zip(t.layout.names, t.vector, strict=True)) for t in self.terms},
            "rows": {"all": problem.data.n_rows, "compared": int(problem.use.sum())},
            "rms": self.rms,
            "outliers": {
                "rows": np.flatnonzero(self.outliers),
                "lines": problem.data.line[self.outliers],
                "rms_without": self.rms_without,
            },
            "noise_floor": self.floor,
            "tracking": self.tracking,
            "sigma": problem.sigma,
            "is_open": self.is_open,
            "coloured_noise": self.coloured,
            "residual": None
            if w is None
            else {**vars(w), "structured": w.structured, "times_noise": self.times_noise},
            "coordinates": self.coordinates,
            "runs": self.runs,
            "directions": self.directions,
            "regions": self.regions,
            "associations": self.associations,
            "worst": self.worst,
            "unsolved": self.unsolved,
            "poses": self._rows(),
            "notes": self.notes,
        }

    def _rows(self) -> dict[str, Any]:
        """Errors of every row by reading, in the order of ``channels``; null if not compared."""
        data = self.problem.data
        names, units = channels(self.problem)
        return {
            "line": data.line,
            "run": data.run,
            "command": self.way.pose,
            "direction": self.way.direction,
            "speed_m_per_s": self.way.speed,
            "slack_cables": self.state.prediction.slack.sum(axis=1),
            "channels": [f"{n} [{u}]" for n, u in zip(names, units, strict=True)],
            "error": np.where(self.problem.counted, self.state.raw, np.nan),
        }
