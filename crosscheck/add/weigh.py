"""Effects added to a model: their values and errors, and whether they are worth it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from crosscheck.comparison.noise import Coloured, coloured_noise
from crosscheck.fit.problem import Rms, rms_by_kind
from crosscheck.fit.residual_noise import Whiteness, whiteness
from crosscheck.fit.state import contradictions
from crosscheck.fit.words import rms_words
from crosscheck.inference.about import About
from crosscheck.inference.catalogue import Catalogue, name_of
from crosscheck.inference.fit import Fit, unfitted
from crosscheck.inference.held_out import hold_out, improves, pays
from crosscheck.inference.priors import FALSE_ALARM, SURE
from crosscheck.model.fitted import Fitted
from crosscheck.model.write import provenance_of, renewed, with_fit
from seecr.counted import counted, some
from seecr.description.robot import Robot
from seecr.effects import Terms
from seecr.pose import Array
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
        out += [f"{f.term.name}: {line}" for f in self.fitted for line in f.value_lines()]
        out += [f"warning: {warning}" for warning in self.warnings]
        return [*out, *(f"note: {note}" for note in self.notes)]

    def records(self) -> list[Record]:
        """A record for each parameter of the new model: value and standard error, SI."""
        return [record for one in self.fitted for record in one.value_records()]

    def as_json(self) -> dict[str, Any]:
        """The content of ``add.json``, in SI."""
        return {
            "effect": self.name,
            "added": list(self.names),
            "effects": {f.term.name: f.parameters() for f in self.fitted},
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


# --- what effects are worth -----------------------------------------------------------------------

_MOST_NAMED = 4
# A value of more expected sizes than this needs a check.
_IMPLAUSIBLE = 5.0
# Parameters with a larger correlation than this can hardly be determined separately.
_CORRELATED = 0.95
# What is less probable is outside an interval of 95 % whatever it does to a value.
MATTERS = 1.0 - SURE


def weigh(
    best: Fit, base: Fit, terms: Terms, names: Sequence[str], notes: Sequence[str], basis: Model
) -> Addition:
    """Judge what the named effects are worth in the best fit, against ``base`` without them."""
    problem = best.data.problem
    far = best.outlying
    if far.any():
        best, base = best.with_far_off(far), base.with_far_off(far)
        lines = problem.data.lines_of(far)
        notes = [*notes, f"outliers, given little weight and not included in these errors: {lines}"]
        problem = best.data.problem
    without, held = hold_out(base), hold_out(best)
    own = np.isin([effect for effect, _key in best.terms.labels], list(names))
    near = best.state.white[~far[problem.row_of]]
    white = whiteness(problem.only(~far), near, int(best.seen.sum()))
    factor = best.data.factor
    coloured = None if white.is_noise else coloured_noise(problem, best.state, factor)
    noise = white.is_noise or (coloured is not None and not coloured.open)
    about = About(Catalogue.of(best.data, best.terms), best)
    moved = spread_by_others(about, chances := chances_beside(about))
    covariance = _no_wider(best.terms, best.covariance + moved)
    stderr, parts = np.sqrt(np.diag(covariance)), [(t, best.terms.part(t.name)) for t in best.terms]
    fitted = tuple(Fitted(t, stderr[part], best.at_bound[part]) for t, part in parts)
    drop = best.metric.power(base.left) - best.metric.power(best.left)
    p = float(special.chdtrc(max(int((best.seen & own).sum()), 1), max(drop, 0.0)))
    distance, count = distance_from_nothing(best.terms, covariance, own)
    stood = unfitted(best.data, terms)
    before, after = rms_by_kind(problem, stood.state.raw), rms_by_kind(problem, best.state.raw)
    errors = {"before": before, "after": after, "held_out": held.rms}
    return Addition(
        names=tuple(names),
        fitted=fitted,
        before=before,
        after=after,
        held_out_before=without.rms,
        held_out=held.rms,
        fall=improves(without, held),
        p=p,
        predicts=pays(without, held) and p < FALSE_ALARM,
        from_nothing=distance,
        is_nothing=is_nothing(distance, count),
        whiteness=white,
        coloured=coloured,
        warnings=(
            *(text for f in fitted for text in _warnings_of(problem.robot, f)),
            *_together(best, own),
            *_widened(noise, chances, bool(np.any(own & (np.sqrt(np.diag(moved)) > best.stderr)))),
        ),
        notes=tuple(dict.fromkeys(notes)),
        model=_model(best, basis, fitted, names, errors, covariance),
    )


def spread_by_others(about: About, chances: Mapping[str, float]) -> Array:
    """Covariance (p, p) of how far a fit's values are from those of models with one effect more.

    The errors of a fit hold if just its effects are missing. A heavier platform beside a wrong
    length takes a part of what the length explains: if the data leave it a chance of 30 %, the
    length is known no better than the two models agree on it (Hoeting et al. 1999).

    Args:
        about: what further members do about the fit. chances: the probability of each.
    """
    moves = np.zeros((1, len(about.fit.terms)))
    for key, p in chances.items():
        if p > MATTERS and key in about.columns:
            moves = np.vstack([moves, np.sqrt(p) * about.moves(key)[1]])
    return np.asarray(moves.T @ moves)


def chances_beside(about: About) -> dict[str, float]:
    """The probability of each further effect beside a fit, at most one, by the linear model."""
    every, nothing = about.every, about.every.log_prior(frozenset())
    keys = [key for key in about.columns if key in about.promises]
    odds = [about.promises[k] + every.log_prior(frozenset({k})) - nothing for k in keys]
    total = np.logaddexp.reduce([0.0, *odds])
    return {key: float(np.exp(one - total)) for key, one in zip(keys, odds, strict=True)}


def _model(
    best: Fit, basis: Model, fitted: Sequence[Fitted], names: Sequence[str],
    errors: Mapping[str, Rms], covariance: Array,
) -> Model:  # fmt: skip
    """The new model; effects that neither it had nor ``names`` has are new as well."""
    problem = best.data.problem
    source = provenance_of(problem.data.name, f"crosscheck add {' + '.join(names)}")
    fresh = [f.term.name for f in fitted if f.term.name not in (*basis.names, *names)]
    new = with_fit(basis, fitted, [*names, *fresh], source, errors, best.with_idle(covariance))
    return renewed(new, problem.robot, problem.data)


def _no_wider(terms: Terms, covariance: Array) -> Array:
    """The covariance (p, p), no value less certain than it was measured independently."""
    stderr = np.sqrt(np.diag(covariance))
    wide = terms.knowledge.measured & (stderr > terms.knowledge.stderr)
    shrink = np.ones(len(stderr))
    shrink[wide] = terms.knowledge.stderr[wide] / stderr[wide]
    return np.asarray(covariance * np.outer(shrink, shrink))


def _warnings_of(robot: Robot, f: Fitted) -> Iterator[str]:
    """Warnings about one effect's values."""
    name, names = f.term.name, np.array(f.term.layout.names)
    yield from contradictions([f.term])
    unseen, stopped = ~np.isfinite(f.stderr), np.asarray(f.at_bound, bool)
    if stopped.any():
        yield f"{name}: {some(names[stopped])} stopped at a bound"
    if (unseen & ~stopped).any():
        yield f"{name}: {some(names[unseen & ~stopped])} not determined by these data"
    if not f.term.is_possible(robot):
        yield (f"{name}: no robot can have these values, so something else acts like this effect")
    size = np.abs(f.term.sizes)
    large = (size > _IMPLAUSIBLE) & ~f.term.layout.shape
    if large.any():
        whose = (
            "their expected sizes: check them" if large.sum() > 1 else "its expected size: check it"
        )
        verb = "is" if large.sum() == 1 else "are up to"
        most = f"{size[large].max():.3g} times {whose} on the robot"
        yield f"{name}: {some(names[large].tolist())} {verb} {most}"


def _widened(noise: bool, chances: Mapping[str, float], wider: bool) -> Iterator[str]:
    """That standard errors are wider because another effect may be missing as well."""
    if not wider:
        return
    likely = max(chances, key=lambda key: chances[key])
    why = f"{name_of(likely)} may be missing as well" if noise else "the residuals are not noise"
    yield (
        f"{why}: the standard errors include by how much another missing effect may shift these "
        "values; crosscheck diagnose searches for it"
    )


def _together(best: Fit, own: NDArray[np.bool_]) -> list[str]:
    """Warnings about parameters that can hardly be told from those of another effect."""
    labels = [".".join(label) for label in best.terms.labels]
    table = np.abs(best.correlation)
    pairs = [
        (float(table[i, j]), i, j)
        for i in np.flatnonzero(own).tolist()
        for j in np.flatnonzero(~own).tolist()
        if table[i, j] > _CORRELATED
    ]
    return [
        (
            f"{labels[i]} and {labels[j]} are strongly correlated ({c:.3f}): these data hardly "
            "separate them"
        )
        for c, i, j in sorted(pairs, reverse=True)[:_MOST_NAMED]
    ]


def distance_from_nothing(
    terms: Terms, covariance: Array, own: NDArray[np.bool_]
) -> tuple[float, int]:
    """Distance of parameters from null, together, in standard errors, and how many are in it.

    Shapes, fixed values and unidentifiable parameters (inf in the covariance) do not count. The
    distance is infinite if no parameter was free.
    """
    shape = np.concatenate([term.layout.shape for term in terms])
    free = own & ~shape & ~terms.knowledge.fixed
    if not free.any():
        return float("inf"), 0
    seen = np.flatnonzero(free & np.isfinite(np.diag(covariance)) & (np.diag(covariance) > 0.0))
    if not len(seen):
        return 0.0, 1
    scale = terms.scale[seen]
    z = (terms.vector - terms.null)[seen] / scale
    part = covariance[np.ix_(seen, seen)] / np.outer(scale, scale)
    squared = float(z @ np.linalg.pinv(part, hermitian=True) @ z)
    return float(np.sqrt(max(squared, 0.0))), len(seen)


def is_nothing(distance: float, count: int) -> bool:
    """Whether so many values are no further from null than chance takes one within its error."""
    if not np.isfinite(distance):
        return False
    return bool(special.chdtr(count, distance**2) <= special.chdtr(1, 1.0))
