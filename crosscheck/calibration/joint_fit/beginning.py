"""The beginning of the fit of all effects, which needs nothing that the steps find.

It can be computed in another process while they are taken.
"""

from __future__ import annotations

from functools import partial

from crosscheck.calibration.joint_fit.joint import Setting
from crosscheck.calibration.joint_fit.stages import Begun, begin
from crosscheck.calibration.noise.colour import chain_of
from crosscheck.fit.least_squares.problem import Problem
from seecr.effects import Terms
from seecr.processes import Job, Shared
from seecr.threads import is_divided


class Beginning:
    """The beginning of the fit of all effects, computed once; a context manager that ends it."""

    def __init__(self, problem: Problem, terms: Terms) -> None:
        """Fit nothing yet.

        Args:
            problem: readings, from :func:`crosscheck.fit.preparation.prepare.prepare`.
            terms: effects of the model as it stands.
        """
        factor = problem.noise(problem.experiment.predict(terms.effects))
        self.terms = terms
        self.setting = Setting(problem, factor, chain_of(problem))
        self._beside: Job[Begun] | None = None
        self._begun: Begun | None = None

    def __enter__(self) -> Beginning:
        """Compute it in another process, if a processor is free.

        It may not be needed, so not if there are rows enough for all processors.
        """
        if is_divided(self.setting.problem.data.n_rows):
            return self
        job = partial(begin, self.setting, self.terms, ahead=True)
        self._beside = Job(job, Shared(self.setting, self.terms))
        return self

    def __exit__(self, *error: object) -> None:
        if self._beside is not None:
            self._beside.__exit__(*error)

    @property
    def begun(self) -> Begun:
        """The beginning."""
        if self._begun is None:
            sent = [] if self._beside is None else self._beside.sent()
            self._begun = sent[0] if sent else begin(self.setting, self.terms)
        return self._begun
