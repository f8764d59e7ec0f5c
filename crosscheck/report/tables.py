"""The page's tables: what was tested, candidates with reasons, what the error goes with."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crosscheck.comparison.associations import Association
from crosscheck.diagnosis.order import Step
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.diagnosis.steps import stages_of
from crosscheck.fit.effects.candidates import Candidate
from crosscheck.fit.effects.evidence import FALSE_ALARM, p_value
from crosscheck.fit.noise.whiteness import POOR_FIT, STRUCTURED
from crosscheck.fit.reasons import DiagnosisVerdict, probability_words
from crosscheck.report.findings import PLAUSIBLE
from crosscheck.units import chance, in_unit, parameter_name, short
from seecr.effects.base import Layout
from seecr.effects.setup import Setup


@dataclass(frozen=True)
class Check:
    """One thing that was tested: ``good`` is None where it says nothing by itself."""

    name: str
    good: bool | None
    words: str

    @property
    def mark(self) -> str:
        """A sign that reads without its colour."""
        return {True: "✓", False: "✗", None: "·"}[self.good]


def checks(found: Diagnosis) -> list[Check]:
    """What speaks for the verdict and what against it."""
    if found.search is None or found.whiteness is None:
        return []
    w = found.whiteness
    out = [
        Check(
            "size of the residuals", w.p > POOR_FIT,
            f"χ² per reading {short(w.chi2 / w.dof)} (p {chance(w.p)})",
        ),
        Check(
            "neighbouring rows", not w.structured,
            f"their correlation is {short(max(w.lag_errors, w.neighbour_errors))} standard errors "
            f"from zero; noise stays below {STRUCTURED:g}",
        ),
    ]  # fmt: skip
    return out + _of_effects(found)


def _of_effects(found: Diagnosis) -> list[Check]:
    assert found.search is not None
    tried = found.search.tried
    steps = [stage.step for stage in itertools.takewhile(lambda s: s.listed, stages_of(found))]
    if len(steps) == 1:
        smallest = min((c.p for c in steps[0].candidates if c.drop > 0), default=1.0)
        return [
            Check("effects tried", None, f"{tried}; none is significant (smallest p, corrected "
                f"for all of them: {chance(min(1.0, tried * smallest))})")
            if found.verdict is DiagnosisVerdict.NO_EFFECT_MISSING
            else Check("effects tried", None, str(tried))
        ]  # fmt: skip
    better, blocks = _better_runs(steps)
    worst, largest = max((_largest_sizes(step), step.added) for step in steps[1:])
    p = max(_chance(steps[k - 1], steps[k]) for k in range(1, len(steps)))
    bound = _at_bounds(steps[-1])
    return [
        Check("effects tried", None, str(tried)),
        Check("chance", p < FALSE_ALARM, f"explains the added effects with p {chance(p)}, "
            "corrected for all effects tried"),
        Check("held-out runs", better == blocks, "each added effect improves the prediction of "
            f"{better} of {blocks}"),
        Check("sizes", worst < PLAUSIBLE and not bound, f"at most {short(worst, 2)} plausible "
              f"sizes ({largest})" + (f"; at its bound: {', '.join(bound)}" if bound else "")),
    ]  # fmt: skip


def _better_runs(steps: list[Step]) -> tuple[int, int]:
    """Runs left out whose error falls with every effect that was added, and all."""
    falls = [a.held_out.chi2 - b.held_out.chi2 for a, b in itertools.pairwise(steps)]
    least = np.min(falls, axis=0)
    return int(np.sum(least > 0)), len(least)


def _largest_sizes(step: Step) -> float:
    return float(np.max(np.abs(step.fit.terms[step.added].sizes)))


def _at_bounds(step: Step) -> list[str]:
    """The effects of a model that have a parameter at its bound."""
    labels = np.array(step.fit.terms.labels)[step.fit.at_bound]
    return list(dict.fromkeys(effect for effect, _name in labels.tolist()))


def _chance(before: Step, after: Step) -> float:
    """Chance of the fall of chi2, for as many effects as were tried."""
    count = len(after.fit.terms[after.added].layout)
    p = p_value(before.whiteness.chi2 - after.whiteness.chi2, count, False)
    return min(1.0, p * max(before.tried, 1))


@dataclass(frozen=True)
class CandidateRow:
    """An effect that is not listed, as the page shows it.

    Attributes:
        effect, title: its name, and in words.
        alone: part of the excess chi2 that it takes away by itself, 0 to 1; None if not tried.
        needs: what it would take. why_not: the reason. probability: in words, "" if not known.
        together: that of its class, if it has equivalents.
    """

    effect: str
    title: str
    alone: float | None
    needs: str
    why_not: str
    probability: str
    together: str


def candidate_rows(found: Diagnosis) -> list[CandidateRow]:
    """Effects that were tried and are not listed, with the reason, the nearest miss first."""
    by_name = {}
    if found.search is not None:
        by_name = {c.name: c for c in found.search.steps[0].candidates}
    out = []
    for row in (row for row in found.candidates if not row.why_not.lacking):
        candidate = by_name.get(row.effect)
        out.append(
            CandidateRow(
                effect=row.effect,
                title=row.title,
                alone=_alone(found, candidate),
                needs=_needs(found, candidate),
                why_not=str(row.why_not),
                probability=_probability(found, row.effect),
                together=_together(found, row.effect),
            )
        )
    return out


def untried(found: Diagnosis) -> list[tuple[str, list[str]]]:
    """Reasons for which effects were no candidates, each with the effects."""
    out: dict[str, list[str]] = {}
    for row in found.candidates:
        if row.why_not.lacking:
            out.setdefault(str(row.why_not), []).append(row.effect)
    return list(out.items())


def _probability(found: Diagnosis, effect: str) -> str:
    if found.chances is None or effect not in found.chances.effect:
        return ""
    return probability_words(found.chances.effect[effect])


def _together(found: Diagnosis, effect: str) -> str:
    """The probability of the effect's class; "" if it has no other members."""
    for members, p in () if found.chances is None else found.chances.classes:
        if effect in members and len(members) > 1:
            return probability_words(p)
    return ""


def _alone(found: Diagnosis, candidate: Candidate | None) -> float | None:
    """Part of the excess chi2 that the effect takes away by itself, in sample, 0 to 1."""
    if candidate is None or found.search is None or (candidate.fit or candidate.alone) is None:
        return None
    start = found.search.steps[0]
    excess = start.whiteness.chi2 - start.whiteness.dof
    return float(np.clip(candidate.drop / excess, 0.0, 1.0)) if excess > 0.0 else None


def _needs(found: Diagnosis, candidate: Candidate | None) -> str:
    """What it would take: the parameter that is largest in plausible sizes."""
    if candidate is None or found.search is None:
        return ""
    term = candidate.alone if candidate.fit is None else candidate.fit.terms[candidate.name]
    if term is None:
        return ""
    layout = term.layout
    setup = found.search.steps[0].fit.state.prediction.setup
    size = np.where(_makes_size(layout, setup), term.sizes, 0.0)
    k = int(np.argmax(np.abs(size)))
    factor, unit = in_unit(layout.units[k])
    name = parameter_name(layout.names[k], layout.units[k])
    doubt = f" ({short(abs(float(size[k])), 2)} plausible sizes)" if abs(size[k]) > 3 else ""
    # a factor near one is told from one by its later digits
    digits = 5 if layout.null[k] else 3
    return f"{name} = {short(factor * float(term.vector[k]), digits)} {unit}".strip() + doubt


def _makes_size(layout: Layout, setup: Setup) -> NDArray[np.bool_]:
    """(p,) which parameters make an effect large: not those that only say where to look for it.

    A length behind the exit point is one of these where friction is looked for: by itself it is
    another effect.
    """
    places = layout.effect.shapes(setup)
    own = ~layout.shape & (layout.start(places[0] if places else {}) == layout.null)
    return own if own.any() else ~layout.shape


@dataclass(frozen=True)
class BinBar:
    """Rows alike in a quantity: how many, their mean error, and its bar from -50 to 50."""

    label: str
    rows: int
    mean: str
    part: float


@dataclass(frozen=True)
class AssociationBlock:
    """One thing that the unexplained part goes with, in units for people."""

    against: str
    of: str
    strongest: str
    share: str
    p: str
    unit: str
    bins: list[BinBar]


def association_block(row: Association) -> AssociationBlock:
    """An association as the page shows it."""
    factor, unit = in_unit(row.unit)
    top = max((abs(part.mean) for part in row.bins if part.mean is not None), default=0.0)
    bins = [
        BinBar(
            label=part.label if len(row.bins) > 1 else "all",
            rows=part.rows,
            mean=short(None if part.mean is None else factor * part.mean),
            part=0.0 if not top or part.mean is None else 50.0 * part.mean / top,
        )
        for part in row.bins
    ]
    share = f"{100 * row.share:.0f} %"
    return AssociationBlock(row.against, row.of, row.strongest, share, chance(row.p), unit, bins)
