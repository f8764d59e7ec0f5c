"""Which effects could be missing, where to start fitting each, and how it fits.

Ranking candidates by their derivative at null is confidently wrong where cables go slack, so
every candidate is fitted for itself; the derivative only chooses its starts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from crosscheck.fit.evidence import Evidence, evidence, p_value
from crosscheck.fit.gauss_newton import Fit, fit, flat
from crosscheck.fit.problem import Problem
from crosscheck.fit.starts import equation_start
from crosscheck.fit.state import derivatives, evaluate
from crosscheck.fit.subspace import projected
from seecr.compiled import law as cable_law
from seecr.effects import catalogue, layout_of
from seecr.effects.base import Layout
from seecr.errors import InputError
from seecr.pose import Array
from seecr.sensitivity import Term

# A start is at most this many plausible sizes from null.
_START_SIZES = 3.0
# Most Gauss-Newton steps of a trial; what is chosen is fitted to the end.
_TRIAL_ITERATIONS = 12
# A chi2 of this many readings is noise, or nearly.
_WHITE = 1.3
# Part of the cables that are slack from which a fit may end in a hollow.
_SLACK_PART = 0.02
# Effects that shift no reading by this part of its noise, for plausible sizes, are not seen.
_UNSEEN = 0.02


@dataclass(frozen=True, eq=False)
class Starts:
    """Where to start fitting an effect, and what its derivative at null promises.

    Attributes:
        vectors: starting values, the most promising first.
        gain: linearised fall of chi2 of the best. directions: that the data see.
        shapes: about how many shapes were tried for it.
        seen: whether any reading moves by more than a trace of its noise.
    """

    vectors: list[Array]
    gain: float
    directions: int
    shapes: float
    seen: bool


@dataclass(eq=False)
class Candidate:
    """An effect that might be missing, and what came of adding it.

    Attributes:
        layout: the effect for this robot.
        fit: of the model with it added; None where it is no candidate.
        evidence: of that fit.
        drop: of chi2 against the model without it.
        p: chance of that drop where the effect is absent.
        why_not: a sentence where it is no candidate or was not chosen.
        starts: where to start fitting it.
    """

    layout: Layout
    fit: Fit | None = None
    evidence: Evidence | None = None
    drop: float = 0.0
    p: float = 1.0
    why_not: str = ""
    starts: Starts | None = None

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.layout.name


def layouts_for(problem: Problem) -> list[Candidate]:
    """All effects of the catalogue; those these data cannot show have a ``why_not``."""
    out = []
    for effect in catalogue().values():
        layout = layout_of(effect, problem.robot)
        out.append(Candidate(layout, why_not=_unfit(problem, layout)))
    return out


def _unfit(problem: Problem, layout: Layout) -> str:
    data, effect = problem.data, layout.effect
    rows = int(problem.use.sum())
    if len(layout) > problem.n_readings or len(layout) > 6 * rows or rows < 2:
        return f"no candidate: {len(layout)} parameters, but the data have {rows} rows"
    if rows < len(layout):
        return f"no candidate: {len(layout)} parameters, but the data have {rows} rows"
    if "poses" in effect.needs and data.command_pose is None:
        return "no candidate: needs commanded poses; these data command lengths"
    if "time" in effect.needs and (data.t_s is None or np.ptp(data.t_s) == 0):
        return "no candidate: needs the time of each row (t_s)"
    if "temperature" in effect.needs:
        if data.temperature_C is None:
            return "no candidate: needs temperature_C"
        if np.ptp(data.temperature_C) == 0:
            return "no candidate: the temperature never changed"
    if "tensions" in effect.needs and not data.has_tension:
        return "no candidate: needs measured tensions"
    return ""


def ordered(terms: Sequence[Term]) -> tuple[Term, ...]:
    """Terms in the order of the catalogue, in which effects act."""
    order = {name: i for i, name in enumerate(catalogue())}
    return tuple(sorted(terms, key=lambda t: order.get(t.name, len(order))))


def try_candidate(
    problem: Problem,
    base: Fit,
    layout: Layout,
    factor: Array,
    noise_scale: float = 1.0,
    hopeless: float = np.inf,
) -> Candidate:
    """Fit the base model with one effect added, from its most promising starts."""
    out = screen(problem, base, layout, factor, noise_scale)
    return out if out.why_not else fit_candidate(problem, base, out, factor, noise_scale, hopeless)


def screen(
    problem: Problem, base: Fit, layout: Layout, factor: Array, noise_scale: float = 1.0
) -> Candidate:
    """What the effect's derivative promises beside the base model; nothing is fitted."""
    out = Candidate(layout)
    out.starts = _starts(problem, base, layout, factor)
    if not out.starts.seen:
        out.why_not = "these data do not show it: no reading moves by its plausible size"
        return out
    out.drop = out.starts.gain / noise_scale**2
    out.p = p_value(out.drop, out.starts.directions, False) * out.starts.shapes
    return out


def fit_candidate(
    problem: Problem,
    base: Fit,
    screened: Candidate,
    factor: Array,
    noise_scale: float = 1.0,
    hopeless: float = np.inf,
) -> Candidate:
    """Fit the base model with a screened effect added.

    Args:
        problem: the data.
        base: the model without the effect.
        screened: from :func:`screen`.
        factor: noise factors.
        noise_scale: noise in units of the stated one.
        hopeless: chi2 above which a trial is given up after a few steps.
    """
    layout, first = screened.layout, screened.starts
    assert first is not None
    out = Candidate(layout, starts=first)
    best: Fit | None = None
    for vector in first.vectors:
        if best is not None and best.chi2 < _WHITE * noise_scale**2 * len(best.state.white):
            break  # it leaves noise: no other start does better
        terms = ordered((*base.terms, Term(layout, vector)))
        try:
            found = fit(
                problem, terms, factor, base.state,
                iterations=_TRIAL_ITERATIONS, hopeless=hopeless, quick=True,
            )  # fmt: skip
        except (InputError, np.linalg.LinAlgError):
            continue
        if found.valid and (best is None or found.chi2 < best.chi2):
            best = found
            hopeless = min(hopeless, 2.0 * best.chi2)
    if best is None:
        out.why_not = "no fit: rows could not be solved with it"
        return out
    return judged(best, base, screened, noise_scale)


def judged(found: Fit, base: Fit, screened: Candidate, noise_scale: float) -> Candidate:
    """A candidate with its fit: how much better than without it, and by what chance."""
    layout, first = screened.layout, screened.starts
    assert first is not None
    columns = seen_directions(found, layout.name)
    one_sided = bool(np.isfinite(layout.lower[0])) and layout.lower[0] == layout.null[0]
    drop = (base.chi2 - found.chi2) / noise_scale**2
    p = p_value(drop, columns, one_sided) * first.shapes
    return Candidate(layout, found, evidence(found, noise_scale), drop, p, starts=first)


def seen_directions(found: Fit, name: str) -> int:
    """How many directions of an effect's parameters the data see beside the other terms."""
    own = own_columns(found.terms, name)
    others = projected(found.jacobian[:, own], found.jacobian[:, ~own])
    power = np.linalg.eigvalsh(others.T @ others)
    return max(1, int(np.sum(power > 1e-2)))


def own_columns(terms: Sequence[Term], name: str) -> np.ndarray:
    """(p,) bool, the parameters of one effect."""
    return np.concatenate([np.full(len(t.layout), t.name == name) for t in terms])


def _starts(problem: Problem, base: Fit, layout: Layout, factor: Array) -> Starts:
    shapes = layout.effect.shapes(base.state.prediction.setup)
    scored: list[tuple[float, int, Array, dict[str, float]]] = []
    seen = False
    orthogonal = base.span
    for shape in shapes:
        null = layout.start(shape)
        scale = layout.scale * ~layout.shape
        white = amplitude_columns(problem, base, layout, null) * scale
        seen = seen or bool(np.max(np.abs(white), initial=0.0) > _UNSEEN)
        left = white - orthogonal @ (orthogonal.T @ white)
        z, gain, directions = _linear(left, base.state.white)
        z = np.clip(z, -_START_SIZES, _START_SIZES)
        vector = np.clip(null + z * scale, layout.lower, layout.upper)
        scored.append((gain, directions, vector, shape))
    if not scored:
        return Starts([], 0.0, 1, 1.0, False)
    scored.sort(key=lambda item: -item[0])
    vectors = [vector for _g, _d, vector, _s in scored[:2]]
    if np.any((layout.lower == layout.null) & ~layout.shape):
        # the derivative at a bound can point the wrong way: start inside as well
        inside = layout.start(scored[0][3])
        vectors = [vectors[0], np.where(layout.shape, inside, inside + 0.5 * layout.scale)]
    elif len(shapes) == 1:
        vectors = vectors[:1]
    if int(np.sum(~layout.shape)) > 1 and _some_slack(base):
        balanced = equation_start(problem, base.state, layout, layout.start(scored[0][3]), factor)
        vectors += [] if balanced is None else [balanced]
    # neighbouring shapes are alike: about every third is one more chance of its own
    return Starts(vectors, scored[0][0], scored[0][1], max(1.0, len(shapes) / 3.0), seen)


def _some_slack(base: Fit) -> bool:
    """Whether cables go slack in enough places for a fit to end in a hollow."""
    slack = base.state.prediction.found.states[..., cable_law.SLACK] > 0
    return float(np.mean(slack)) > _SLACK_PART


def amplitude_columns(problem: Problem, base: Fit, layout: Layout, null: Array) -> Array:
    """(N, p) whitened derivatives by the effect's own parameters at null; 0 for shapes."""
    terms = ordered((*base.terms, Term(layout, null)))
    own = own_columns(terms, layout.name)
    wanted = np.flatnonzero(own)
    amplitudes = wanted[~layout.shape]
    out = np.zeros((len(base.state.white), len(layout)))
    state = base.state.of(terms)
    if len(amplitudes):
        out[:, ~layout.shape] = derivatives(problem, state, amplitudes.tolist(), frozen=True)
    return out


def _linear(x: Array, r: Array) -> tuple[Array, float, int]:
    """Linear fit of r by columns x with a weak prior: values, fall of chi2, directions seen."""
    normal = x.T @ x
    z: Array = np.asarray(np.linalg.solve(normal + 1e-2 * np.eye(x.shape[1]), x.T @ r), float)
    left = r - x @ z
    directions = int(np.sum(np.linalg.eigvalsh(normal) > 1e-2))
    return z, float(r @ r - left @ left), max(1, directions)


def null_fit(problem: Problem, terms: Sequence[Term], factor: Array, refit: bool) -> Fit:
    """The model as it stands, as a fit: refitted, or at its stated values."""
    if refit and terms:
        return fit(problem, ordered(terms), factor)
    state = evaluate(problem, ordered(terms), factor)
    p = len(flat(terms, "null"))
    jacobian = np.zeros((len(state.white), p))
    return Fit(state, jacobian, np.zeros((p, p)), np.zeros(p, dtype=bool), state.valid, "", 0)
