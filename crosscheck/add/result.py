"""The result of adding effects to a model: values, errors, and whether they are worth it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.comparison.noise import Coloured
from crosscheck.fit.problem import Rms
from crosscheck.fit.residual_noise import Whiteness
from crosscheck.fit.words import fitted_lines, fitted_records, rms_words
from crosscheck.inference.priors import FALSE_ALARM
from crosscheck.model.fitted import Fitted
from seecr.counted import counted
from seecr.effects import Terms
from seecr.prediction.model import Model
from seecr.result import Record, Result
from seecr.units import with_error


@dataclass(frozen=True, eq=False, repr=False)
class Addition(Result):
    """Effects fitted to data, with the rest of the model.

    Attributes:
        names: names of the effects that are new, or fitted again.
        fitted: all effects of the new model with their errors.
        before: rms errors of the model as it stood. after: those of the new model.
        held_out_before, held_out: on test runs, without the named effects and with them.
        fall: mean fall of chi2 on a held-out block, and its standard error.
        p: p-value of the fall of chi2 on all data.
        predicts: whether the effects improve the prediction of test runs, and not by chance.
        from_nothing: distance of their values from null, in standard errors (Mahalanobis).
        is_nothing: whether that is no further than one standard error of a single value.
        whiteness: test of the residuals.
        coloured: the residuals as noise with autocorrelation or outliers; None if they are white
            noise, or no noise.
        warnings: about the values. notes: about the data.
        model: the robot's model with all of this; :func:`crosscheck.save_model` keeps it.
    """

    names: tuple[str, ...]
    fitted: tuple[Fitted, ...]
    before: Rms
    after: Rms
    held_out_before: Rms
    held_out: Rms
    fall: tuple[float, float]
    p: float
    predicts: bool
    from_nothing: float
    is_nothing: bool
    whiteness: Whiteness
    coloured: Coloured | None
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    model: Model

    @property
    def name(self) -> str:
        """The names of the effects in one line."""
        return " + ".join(self.names)

    @property
    def pays(self) -> bool:
        """Whether the effects are worth adding."""
        return self.predicts and not self.is_nothing

    @property
    def why_not(self) -> str:
        """What speaks against adding the effects if they are not worth it, one sentence."""
        if self.is_nothing:
            return self._nothing()
        if self.p >= FALSE_ALARM:
            return f"what {self.name} explains is not significant (p = {self.p:.2g})"
        return (
            f"{self.name} does not improve the prediction of test runs (chi2 of a block falls "
            f"by {' ± '.join(with_error(*self.fall))})"
        )

    def _nothing(self) -> str:
        """That the values are nothing: not seen, nothing itself, or within their errors of it."""
        own = [one for one in self.fitted if one.term.name in self.names]
        errors = np.concatenate([one.stderr[~one.term.layout.shape] for one in own])
        if not (np.isfinite(errors) & (errors > 0.0)).any():
            return f"{self.name} is not determined by these data: any value fits them equally well"
        if self.from_nothing == 0.0:
            return f"{self.name} comes out at its null values"
        if len(errors) == 1:
            return f"{self.name} is {self.from_nothing:.2g} standard errors from null"
        several = counted(len(errors), "value")
        return (
            f"{self.name} is no further from null than noise alone may bring {several} "
            f"({self.from_nothing:.2g} standard errors, all together)"
        )

    @property
    def is_noise(self) -> bool:
        """Whether the residuals are noise, white or coloured."""
        return self.whiteness.is_noise or (self.coloured is not None and not self.coloured.open)

    @property
    def is_open(self) -> bool:
        """Whether the residuals may as well be noise, of unstated size, as something missing."""
        return self.coloured is not None and self.coloured.open

    @property
    def terms(self) -> Terms:
        """All effects of the new model with their values, as a model for the next call."""
        return Terms(one.term for one in self.fitted)

    def lines(self) -> list[str]:
        """Errors without and with the effects, the values, and what speaks against them."""
        worth = "improves the prediction" if self.predicts else "does not improve the prediction"
        left = rms_words(self.held_out_before), rms_words(self.held_out)
        out = [
            f"{self.name} {worth} of test runs: {left[0]} without, {left[1]} with it",
            f"on all rows: {rms_words(self.before)} before, {rms_words(self.after)} with it",
        ]
        if self.is_nothing:  # it may predict better all the same
            out.append(f"{self.why_not}: it is not worth adding")
        out += fitted_lines(self.fitted)
        out += [f"warning: {warning}" for warning in self.warnings]
        return [*out, *(f"note: {note}" for note in self.notes)]

    def records(self) -> list[Record]:
        """A record for each parameter of the new model: value and standard error, SI."""
        return fitted_records(self.fitted)

    def as_json(self) -> dict[str, Any]:
        """The content of ``add.json``, in SI."""
        return {
            "effect": self.name,
            "added": list(self.names),
            "effects": {f.term.name: f.as_json() for f in self.fitted},
            "before": dict(self.before),
            "after": dict(self.after),
            "held_out_before": dict(self.held_out_before),
            "held_out": dict(self.held_out),
            "improves_held_out": self.predicts,
            "standard_errors_from_nothing": self.from_nothing,
            "is_nothing": self.is_nothing,
            "p": self.p,
            "chi2_fall_a_block": self.fall[0],
            "chi2_fall_stderr": self.fall[1],
            "is_noise": self.is_noise,
            "is_open": self.is_open,
            "coloured_noise": self.coloured,
            "residual": vars(self.whiteness),
            "warnings": list(self.warnings),
            "notes": list(self.notes),
        }

    @property
    def own(self) -> Fitted:
        """The added effect; the first one of several."""
        return next(f for f in self.fitted if f.term.name == self.names[0])
