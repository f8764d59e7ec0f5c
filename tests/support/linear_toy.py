"""A linear toy of a robot: residuals of known columns, so that every answer can be told beforehand.

Each effect moves the whitened readings by its own columns times its plausible sizes. Fits are
linear least squares with the weak prior of the real ones; all that follows from a fit (evidence,
whiteness, cross-validation, the search) is the real thing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from crosscheck.fit.effects.candidates import Candidate, Trials
from crosscheck.fit.effects.gauss_newton import PRIOR_SIZES, Fit, FitStatus
from crosscheck.fit.effects.starts import Starts
from crosscheck.fit.least_squares.imitation import beside
from crosscheck.fit.least_squares.problem import Problem
from crosscheck.fit.least_squares.state import State
from crosscheck.measurements.data import Measurements, Sigma
from seecr.description.mjcf import load_robot
from seecr.description.shipped import model_path
from seecr.effects import Terms, effect_named, layout_of
from seecr.effects.base import Layout
from seecr.pose import Array

SIGMA = Sigma(position_m=3e-5, orientation_rad=3.5e-4)
RUNS, ROWS = 6, 12


def toy_problem(runs: int = RUNS, rows: int = ROWS) -> Problem:
    """Runs of so many rows with poses read in full; commands are spread over a box."""
    robot = load_robot(model_path("demobot_cogiro"))
    n = runs * rows
    rng = np.random.default_rng(0)
    pose = np.tile(robot.reference_pose, (n, 1))
    pose[:, :3] += rng.uniform(-0.1, 0.1, (n, 3))
    data = Measurements(
        path=Path("toy.csv"),
        n_cables=robot.n_cables,
        run=np.repeat([f"run {k}" for k in range(runs)], rows),
        command_pose=pose,
        t_s=10.0 * np.arange(n),
        position=pose[:, :3],
        quat_wxyz=pose[:, 3:],
        sigma=SIGMA,
    )
    return Problem(robot, data, SIGMA, np.ones(n, dtype=bool))


@dataclass(eq=False)
class LinearToy:
    """Whitened readings and what each effect does to them.

    Attributes:
        problem: rows and runs.
        columns: (n, 6 + m, p) of each effect, by plausible sizes.
        table: (n, 6 + m) whitened readings less the plain model's.
        fits: models that were fitted, by the names of their effects.
    """

    problem: Problem
    columns: Mapping[str, Array]
    table: Array
    fits: list[tuple[str, ...]] = field(default_factory=list)

    @property
    def trials(self) -> Trials:
        """To try effects with."""
        factor = np.zeros((0, 0, 0))
        return Trials(
            self.problem, factor, fit=self.fit, starts=self.starts, candidates=self.candidates
        )

    @property
    def base(self) -> Fit:
        """The plain model."""
        return self.fit(self.problem, Terms())

    def terms(self, *names: str) -> Terms:
        """Effects at null."""
        return Terms([_null(self.layout(name)) for name in names])

    def layout(self, name: str) -> Layout:
        """An effect of the toy."""
        return layout_of(effect_named(name), self.problem.robot)

    def candidates(self, problem: Problem) -> list[Candidate]:
        """All of the toy's effects."""
        return [Candidate(self.layout(name)) for name in self.columns]

    def fit(
        self, problem: Problem, terms: Terms, factor: Array | None = None, *_: Any, **__: Any
    ) -> Fit:
        """Least squares on the rows that count, with the weak prior."""
        self.fits.append(terms.names)
        x, y = self._columns_of(problem, terms), self.table[problem.counted]
        normal = x.T @ x + np.eye(x.shape[1]) / PRIOR_SIZES**2
        z = np.linalg.solve(normal, x.T @ y)
        found = terms.with_vector(terms.null + z * terms.scale)
        at_bound = np.zeros(len(terms), dtype=bool)
        covariance = np.linalg.inv(normal) * np.outer(terms.scale, terms.scale)
        return Fit(
            self.state(problem, found), lambda: x, lambda _x: covariance, at_bound,
            FitStatus.SOLVED, 1,
        )  # fmt: skip

    def starts(self, problem: Problem, base: Fit, layout: Layout, factor: Array) -> Starts:
        """What an effect promises beside a model."""
        x = beside(self._columns_of(problem, self.terms(layout.name)), base.span)
        z = np.linalg.lstsq(x, base.state.white, rcond=1e-9)[0]
        white = base.state.white
        gain = float(white @ white - np.sum((white - x @ z) ** 2))
        return Starts((layout.null + z * layout.scale,), gain, len(layout), 1.0, True)

    def state(self, problem: Problem, terms: Terms) -> State:
        """Readings less those of the terms at their values."""
        table = self.table.copy()
        for term in terms:
            table -= self.columns[term.name] @ term.sizes
        table = np.where(problem.measured, table, np.nan)
        white = table[problem.counted]
        told = problem.data.command_pose
        solved: Any = SimpleNamespace(
            solved=np.ones(len(table), dtype=bool), pose=told, has_history=False
        )
        experiment: Any = None
        return State(
            terms, solved, table * problem.reading_sigma, table, white, np.zeros(0),
            float(white @ white), 0.0, experiment,
        )  # fmt: skip

    def _columns_of(self, problem: Problem, terms: Terms) -> Array:
        parts = [self.columns[name][problem.counted] for name in terms.names]
        return np.concatenate([np.zeros((problem.n_readings, 0)), *parts], axis=1)


def _null(layout: Layout) -> Any:
    from seecr.effects import Term

    return Term(layout, layout.null)


def toy(
    hidden: Mapping[str, float],
    names: tuple[str, ...],
    seed: int = 0,
    noise: float = 1.0,
    columns: Mapping[str, Array] | None = None,
    runs: int = RUNS,
    rows: int = ROWS,
) -> LinearToy:
    """Effects with random columns of one sigma per reading and plausible size, some of them hidden.

    Args:
        hidden: effects that are there, with all their parameters at so many plausible sizes.
        names: all effects of the toy's catalogue.
        seed: of columns and noise.
        noise: in units of the stated one.
        columns: of some effects, in place of random ones.
        runs: number of runs.
        rows: of each run.
    """
    problem = toy_problem(runs, rows)
    rng = np.random.default_rng(seed)
    shape = problem.measured.shape
    made = {}
    for name in names:
        count = len(layout_of(effect_named(name), problem.robot))
        made[name] = rng.standard_normal((*shape, count))
    made |= dict(columns or {})
    table = noise * rng.standard_normal(shape)
    for name, size in hidden.items():
        table += size * made[name].sum(axis=-1)
    return LinearToy(problem, made, table)
