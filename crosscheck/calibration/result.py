"""The command ``calibrate``: a model with every effect that the data see, with errors and noise."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from crosscheck.calibration.joint_fit.absent import absent_effects
from crosscheck.calibration.joint_fit.all_effects import Calibration, JointErrors, fit_all_effects
from crosscheck.errors import CrosscheckError, UnsolvedError
from crosscheck.fit.effects.contradictions import contradictions
from crosscheck.fit.preparation.prepare import Progress, prepare
from crosscheck.fit.preparation.thinned import thinned
from crosscheck.fit.reasons import Reason, by_reason
from crosscheck.fit.words import fitted_records, rms_words
from crosscheck.given import GivenModel, GivenRobot, basis_of, considered, model_of, robot_of
from crosscheck.measurements.read import GivenData, measurements_of
from crosscheck.model.fitted import Fitted
from crosscheck.model.write import calibrated, provenance_of, renewed
from seecr.arguments import silent
from seecr.counted import counted, plural, some
from seecr.effects import Terms
from seecr.pose import Array
from seecr.prediction.model import Model
from seecr.result import Record, Result

# A parameter that is not known better than this part of its plausible size is known by its prior
# only. An effect of such parameters is left out if it changes all readings by less than this chi2.
_UNSEEN, _NOTHING = 0.98, 1e-2
_MOST_NAMED = 8


@dataclass(frozen=True, eq=False, repr=False)
class Calibrated(Result, JointErrors):
    """The result of fitting every effect that the data see at once.

    Attributes:
        fitted: the effects with standard errors, without those that the data do not see.
        covariance: (p, p) of all their parameters, in their order; SI.
        before, after, held_out: rms errors by kind: of the model as it stood, of this one, and of
            held-out runs, each predicted by a fit without it.
        scale, rho: by kind of reading, the estimated noise over the stated one, and its correlation
            between successive rows of a run.
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
        """Whether the fit converged and predicts held-out runs better than the model before."""
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
            f"{rms_words(self.held_out)} on held-out runs",
            *self.noise_lines(),
            *self.absent_lines(),
        ]
        return [*out, *(f"note: {note}" for note in self.notes)]

    def records(self) -> Sequence[Record]:
        """A record for each parameter: value and standard error, SI."""
        return fitted_records(self.fitted)

    def as_json(self) -> dict[str, Any]:
        """The content of ``calibration.json``, in SI."""
        return {
            **JointErrors.as_json(self),
            "outliers": list(self.outliers),
            "outlier_places": list(self.outlier_places),
            "settled": self.settled,
            "improves_held_out": self.pays,
            "effects": {one.term.name: one.as_json() for one in self.fitted},
            "parameters": self.labels,
            "covariance": self.covariance.tolist(),
            "notes": list(self.notes),
            "not_fitted": {name: why.words for name, why in self.absent.items()},
        }


def calibrate(
    robot: GivenRobot,
    data: GivenData,
    model: GivenModel = (),
    progress: Progress = silent,
    *,
    only: Iterable[str] = (),
    exclude: Iterable[str] = (),
) -> Calibrated:
    """Fit every effect that the data can see, with plausible sizes as priors.

    Args:
        robot: a robot, or its MJCF file.
        data: measurements, or their file.
        model: effects to start from, or their file; by default the plain model.
        progress: called with what is being done and the fraction that is done.
        only: names of the effects to fit beside the model's own; by default all.
        exclude: names of effects that are not fitted, unless the model has them.

    Raises:
        InputError: there is no effect of a name.
        CrosscheckError: the data allow no calibration.
        UnsolvedError: rows have no equilibrium.
    """
    robot = robot_of(robot)
    thin = thinned(robot, measurements_of(data, robot))
    terms, said = model_of(model, robot)
    ready = prepare(robot, thin.data, terms, considered(only, exclude))
    if ready.refusal is not None:
        kind = UnsolvedError if ready.refusal.unsolved else CrosscheckError
        why = f"{ready.refusal}; nothing was fitted: {ready.refusal.remedy}"
        raise kind(f"{thin.data.path}: {why}")
    # BLAS on several threads takes longer for matrices as narrow as these
    with threadpool_limits(limits=1, user_api="blas"):
        found = fit_all_effects(ready.problem, ready.terms, progress)
        others = thin.note_on_others(found.terms, ready.problem.sigma)
    notes = (*said, *contradictions(found.terms), *ready.all_notes, *others)
    return _result(found, terms, notes, basis_of(model, robot))


def _result(found: Calibration, before: Terms, notes: tuple[str, ...], basis: Model) -> Calibrated:
    fitted = _fitted(found, found.covariance, before)
    kept = {one.term.name for one in fitted}
    own = np.flatnonzero([name in kept for name, _key in found.terms.labels])
    covariance = found.covariance[np.ix_(own, own)]
    data, robot = found.setting.problem.data, found.setting.problem.robot
    far = np.flatnonzero(found.outliers).tolist()
    source = provenance_of(data.name, "crosscheck calibrate")
    rms = found.together
    errors = {"before": rms.before, "after": rms.after, "held_out": rms.held_out}
    return Calibrated(
        fitted=fitted,
        covariance=covariance,
        **vars(rms),
        outliers=tuple(int(data.line[row]) for row in far),
        outlier_places=tuple(data.place(row) for row in far),
        settled=found.joint.settled,
        notes=notes,
        absent=absent_effects(found, kept),
        model=renewed(calibrated(basis, fitted, covariance, source, errors), robot, data),
    )


def _fitted(found: Calibration, covariance: Array, before: Terms) -> tuple[Fitted, ...]:
    """The effects of which the data see something, and those that the model had before.

    An effect that others can replace may be known no better than its prior, and still do much.
    """
    error, joint = np.sqrt(np.diag(covariance)), found.joint
    fixed = found.terms.knowledge.fixed
    free = error > 0.0
    out = []
    for term in found.terms:
        part = found.terms.part(term.name)
        seen = np.any(free[part] & (error[part] < _UNSEEN * term.layout.scale))
        does = np.sum((joint.jacobian[:, part] @ joint.z[part]) ** 2) > _NOTHING
        if seen or does or term.name in before:
            stderr = np.where(free[part] | fixed[part], error[part], np.inf)
            out.append(Fitted(term, stderr, ~free[part] & ~fixed[part]))
    return tuple(out)
