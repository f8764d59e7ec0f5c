"""The command ``calibrate``: a model with every effect that the data see, with errors and noise."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from crosscheck.fit.problem import Rms, rms_by_kind
from crosscheck.fit.reasons import Reason, Why, by_reason
from crosscheck.fit.state import contradictions
from crosscheck.fit.words import rms_words
from crosscheck.given import (
    GivenModel,
    GivenNames,
    GivenRobot,
    basis_of,
    considered,
    model_of,
    opened,
    robot_of,
)
from crosscheck.inference.catalogue import Catalogue
from crosscheck.inference.fit import Data, Fit
from crosscheck.inference.held_out import blocks_note, hold_out
from crosscheck.inference.search import Search
from crosscheck.measurements.data import GivenSigma, Sigma
from crosscheck.measurements.read import GivenData, measurements_of
from crosscheck.model.fitted import Fitted
from crosscheck.model.write import calibrated, provenance_of, renewed
from crosscheck.preparation.prepare import Prepared, Progress, note_on_others, prepare, thinned
from seecr.arguments import silent
from seecr.counted import counted, plural, some
from seecr.effects import Terms, catalogue
from seecr.pose import Array
from seecr.prediction.model import Model
from seecr.result import Record, Result

# An effect that the data determine no better than its prior is left out if it changes all readings
# by less than this chi2.
_NOTHING = 1e-2
_MOST_NAMED = 8


@dataclass(frozen=True, eq=False)
class JointErrors:
    """Errors and noise of a fit of all effects.

    Attributes:
        before, after, held_out: rms errors by kind: of the model as it stood, of the fit, and of
            test runs, each predicted by a fit without it.
        scale, rho: by kind of reading, the estimated noise over the stated one, and its correlation
            between successive rows of a run.
    """

    before: Rms
    after: Rms
    held_out: Rms
    scale: dict[str, float]
    rho: dict[str, float]

    @classmethod
    def of(cls, before: Rms, whole: Fit) -> JointErrors:
        """Those of a fit, with what was before it."""
        problem = whole.data.problem
        after, noise = rms_by_kind(problem, whole.state.raw), whole.noise.by_kind(problem)
        return cls(before, after, hold_out(whole).rms, *noise)

    def as_json(self) -> dict[str, Any]:
        """The item ``calibrated`` of ``diagnosis.json``."""
        return {
            "before": self.before,
            "after": self.after,
            "held_out": self.held_out,
            "noise": {"scale": self.scale, "correlation": self.rho},
        }


@dataclass(frozen=True, eq=False, repr=False)
class Calibrated(Result, JointErrors):
    """The result of fitting every effect that the data see at once.

    Attributes:
        fitted: the effects with standard errors, without those that the data do not see.
        covariance: (p, p) of all their parameters, in their order; SI.
        before, after, held_out, scale, rho: as in :class:`JointErrors`.
        outliers: lines of the file that hardly count.
        outlier_places: the same as they are told, after the name of the file if there are several.
        settled: whether the fit converged; if not, its values are not to be used.
        notes: notes about the data.
        absent: effects of the catalogue that are not in the model, and why.
        model: the robot's model with all of this; :func:`crosscheck.save_model` keeps it.
    """

    fitted: tuple[Fitted, ...]
    covariance: Array
    outliers: tuple[int, ...]
    outlier_places: tuple[str, ...]
    settled: bool
    notes: tuple[str, ...]
    absent: Mapping[str, Reason]
    model: Model

    @property
    def terms(self) -> Terms:
        """All effects with their values, as a model for the next call."""
        return Terms(one.term for one in self.fitted)

    @property
    def labels(self) -> list[str]:
        """Names of the parameters, in the order of the covariance."""
        return [f"{effect}.{key}" for effect, key in self.terms.labels]

    @property
    def pays(self) -> bool:
        """Whether the fit converged and predicts test runs better than the model before."""
        pairs = [(was, self.held_out[key]) for key, was in self.before.items()]
        gains = [np.log(was / held) for was, held in pairs if was and held]
        return self.settled and float(np.sum(gains)) > 0.0

    def noise_lines(self) -> list[str]:
        """Lines about the estimated noise of each kind of reading, and about outliers."""
        out = [
            f"noise of the {name}: {self.scale[name]:.2f} times the assumed noise, with a "
            f"correlation of {self.rho[name]:.2f} from row to row of a run"
            for name in self.scale
        ]
        if self.outliers:
            noun = plural(len(self.outliers), "line")
            lines = f"{noun} {some(self.outlier_places, _MOST_NAMED)}"
            out.append(f"outliers, given little weight and not included in these errors: {lines}")
        return out

    def absent_lines(self) -> list[str]:
        """Lines about effects that are not in the model, those that the user excluded left out."""
        return [f"not fitted: {line}" for line in by_reason(self.absent)]

    def lines(self) -> list[str]:
        """Errors before and after, the noise, and how many values there are."""
        out = [
            f"{counted(len(self.labels), 'parameter')} of {counted(len(self.fitted), 'effect')}: "
            f"{rms_words(self.before)} before, {rms_words(self.after)} after, "
            f"{rms_words(self.held_out)} on test runs",
            *self.noise_lines(),
            *self.absent_lines(),
        ]
        return [*out, *(f"note: {note}" for note in self.notes)]

    def records(self) -> Sequence[Record]:
        """A record for each parameter: value and standard error, SI."""
        return [record for one in self.fitted for record in one.value_records()]

    def as_json(self) -> dict[str, Any]:
        """The content of ``calibration.json``, in SI."""
        return {
            **JointErrors.as_json(self),
            "outliers": list(self.outliers),
            "outlier_places": list(self.outlier_places),
            "settled": self.settled,
            "improves_held_out": self.pays,
            "effects": {one.term.name: one.parameters() for one in self.fitted},
            "parameters": self.labels,
            "covariance": self.covariance.tolist(),
            "notes": list(self.notes),
            "not_fitted": {name: why.words for name, why in self.absent.items()},
        }


def made_ready(
    robot: GivenRobot,
    data: GivenData,
    model: GivenModel,
    names: frozenset[str],
    sigma: GivenSigma = None,
) -> tuple[Prepared, Model, tuple[str, ...], Callable[[Terms, Sigma], list[str]]]:
    """What a search begins with.

    Args:
        robot, data, model, sigma: as they were given. names: of the effects that may be missing.

    Returns:
        The rows that are searched, made ready; the model as it stands, and what is said of it; what
        says how well a model predicts the other rows. A model given as effects alone becomes a new
        one of the robot with these.
    """
    robot = robot_of(robot)
    whole = measurements_of(data, robot, sigma)
    some, others = thinned(robot, whole)
    model = opened(model, robot)
    terms, said = model_of(model, robot)
    basis = basis_of(model, robot)
    if not isinstance(model, Model):
        basis = replace(basis, terms=terms)
    untold = partial(note_on_others, robot, whole, others)
    return prepare(robot, some, terms, names), basis, said, untold


def calibrate(
    robot: GivenRobot,
    data: GivenData,
    model: GivenModel = (),
    progress: Progress = silent,
    *,
    only: GivenNames = (),
    exclude: GivenNames = (),
    sigma: GivenSigma = None,
) -> Calibrated:
    """Fit every effect that the data can see, with expected sizes as priors.

    Args:
        robot: a robot, or its MJCF file.
        data: measurements, or their file.
        model: effects to start from, or their file; by default the plain model.
        progress: called with what is being done and the fraction that is done.
        only: the effects to fit beside the model's own, by their names or classes; by default
            the whole catalogue. Effects of one's own are among them.
        exclude: effects that are not fitted, unless the model has them.
        sigma: noise of the readings, in place of what the files state: metres, ``"0.1mm"`` or a
            :class:`crosscheck.Sigma`.

    Returns:
        the fit, with the model to save. About 5 s for 144 rows on one core.

    Raises:
        InputError: there is no effect of a name.
        CrosscheckError: the data allow no calibration.
        UnsolvedError: rows have no equilibrium.

    Example:
        ``crosscheck.calibrate("robot.xml", "measured.csv").model``
    """
    # BLAS on several threads takes longer for matrices as narrow as these
    with threadpool_limits(limits=1, user_api="blas"):
        names = considered(only, exclude)
        ready, basis, said, on_others = made_ready(robot, data, model, names, sigma)
        searched = ready.problem.data
        if ready.refusal is not None:
            raise ready.refusal.error(searched.path, "nothing was fitted")
        data_ = Data.of(ready.problem, ready.terms)
        search = Search(data_, Catalogue.of(data_, ready.terms), lambda text: progress(text, 0.4))
        search.begin()
        whole = search.calibrated.fit
        far = whole.outlying
        whole = whole.with_far_off(far)
        progress("predicting test runs", 0.95)
        before = rms_by_kind(whole.data.problem, search.plain.raw)
        errors = JointErrors.of(before, whole)
        others = on_others(whole.terms, ready.problem.sigma)
    notes = (*said, *contradictions(whole.terms), *ready.notes, *blocks_note(ready.problem))
    fitted = _fitted(whole, basis.terms)
    kept = {one.term.name for one in fitted}
    own = np.flatnonzero([name in kept for name, _key in whole.terms.labels])
    rows = np.flatnonzero(far).tolist()
    source = provenance_of(searched.name, "crosscheck calibrate")
    covariance = (whole.spread * np.outer(whole.terms.scale, whole.terms.scale))[np.ix_(own, own)]
    kinds = {"before": errors.before, "after": errors.after, "held_out": errors.held_out}
    new = calibrated(basis, fitted, covariance, source, kinds)
    return Calibrated(
        fitted=fitted,
        covariance=covariance,
        **vars(errors),
        outliers=tuple(int(searched.line[row]) for row in rows),
        outlier_places=tuple(searched.place(row) for row in rows),
        settled=whole.settled,
        notes=(*notes, *others),
        absent=_absent(search.every, kept),
        model=renewed(new, ready.problem.robot, searched),
    )


def _fitted(whole: Fit, before: Terms) -> tuple[Fitted, ...]:
    """The effects of which the data see something, and those that the model had before.

    An effect that others can replace may be known no better than its prior, and still do much.
    """
    error = np.sqrt(np.diag(whole.spread)) * whole.terms.scale
    fixed, free = whole.terms.knowledge.fixed, whole.free
    out = []
    for term in whole.terms:
        part = whole.terms.part(term.name)
        does = np.sum((whole.jacobian[:, part] @ whole.z[part]) ** 2) > _NOTHING
        if np.any(whole.seen[part]) or does or term.name in before:
            stderr = np.where(free[part] | fixed[part], error[part], np.inf)
            out.append(Fitted(term, stderr, ~free[part] & ~fixed[part]))
    return tuple(out)


def _absent(every: Catalogue, kept: set[str]) -> dict[str, Reason]:
    """The effects of the catalogue that a model of all effects does not have, with the reasons."""
    nothing = dict.fromkeys((n for n in every.effects if n not in kept), Reason(Why.GAINS_NOTHING))
    absent = {**every.reasons, **nothing}
    return {name: absent[name] for name in (*catalogue(), *absent) if name in absent}
