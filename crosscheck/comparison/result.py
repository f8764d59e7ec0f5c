"""The result of comparing a model with measurements: its errors by reading, group and row.

Errors are measured minus predicted: position [m] and rotation vector [rad] in the base frame
(differences of rx, ry, rz if only some of these were read), tensions [N].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crosscheck.comparison.associations import Association
from crosscheck.comparison.coloured import Coloured
from crosscheck.comparison.quantities import channels
from crosscheck.comparison.sentence import (
    coloured_sentence,
    error_size_words,
    misfit_sentence,
    noise_sentence,
)
from crosscheck.comparison.tracking import Tracking
from crosscheck.comparison.travel import Travel
from crosscheck.fit.least_squares.problem import (
    BY_NAME,
    KINDS,
    Problem,
    Rms,
    kinds_read,
    kinds_stated,
)
from crosscheck.fit.least_squares.state import State
from crosscheck.fit.noise.unstated import errors_are_noise
from crosscheck.fit.noise.whiteness import Whiteness
from crosscheck.fit.reasons import Refusal
from seecr.counted import counted
from seecr.effects import Terms
from seecr.pose import Array
from seecr.result import Record, Result, named, rows_of
from seecr.statics.solution import Status
from seecr.units import short


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
            said = coloured_sentence(self.coloured.words, self.coloured.open)
        else:
            said = misfit_sentence(w, self.times_noise, self._known_as, self.associations)
        if not self.outliers.any():
            return said
        rows = counted(int(self.outliers.sum()), "outlier")
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
