"""The page's tables: what was tested, candidates with reasons, what the error goes with."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crosscheck.comparison.associations import Association
from crosscheck.diagnosis.path import ModelPath, Stage
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.fit.noise.whiteness import STRUCTURED
from crosscheck.fit.reasons import probability_words
from crosscheck.inference.priors import SURE
from crosscheck.report.findings import PLAUSIBLE
from seecr.effects import Term
from seecr.effects.base import Layout
from seecr.effects.setup import Setup
from seecr.units import chance, in_unit, parameter_name, short

# Noise within this factor of what was stated is as stated.
_AS_STATED = 1.25


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
    path, chances, w = found.path, found.chances, found.whiteness
    if path is None or chances is None or w is None:
        return []
    scales, _rhos = path.search.best.fit.noise.by_kind(path.problem)
    sizes = ", ".join(
        f"{short(value)} times the assumed one ({kind})" for kind, value in scales.items()
    )
    unknown = chances.unknown
    out = [
        Check("size of the noise", max(scales.values()) < _AS_STATED, sizes),
        Check(
            "neighbouring rows", not w.structured,
            f"their correlation is {short(max(w.lag_errors, w.neighbour_errors))} standard errors "
            f"from zero; white noise stays below {STRUCTURED:g}",
        ),
        Check(
            "something unknown", unknown < 1.0 - SURE,
            f"probability {probability_words(unknown)}",
        ),
        Check("effects tried", None, f"{path.tried}, in {len(path.search.cache)} models"),
    ]  # fmt: skip
    listed = path.stages
    if not any(stage.added for stage in listed):
        return out
    better, blocks = _better_runs(listed)
    worst, largest = max((_largest_size(stage), stage.added) for stage in listed if stage.added)
    bound = _at_bounds(listed[-1])
    return [
        *out,
        Check("held-out runs", better == blocks, "each added effect improves the prediction of "
            f"{better} of {blocks}"),
        Check("sizes", worst < PLAUSIBLE and not bound, f"at most {short(worst, 2)} plausible "
              f"sizes ({largest})" + (f"; at its bound: {', '.join(bound)}" if bound else "")),
    ]  # fmt: skip


def _better_runs(stages: Sequence[Stage]) -> tuple[int, int]:
    """Runs left out whose error falls with every effect that was added, and all.

    Only of steps with the same blocks: those of an effect with values for each run are others.
    """
    pairs = [(a.held_out.chi2, b.held_out.chi2) for a, b in itertools.pairwise(stages)]
    falls = [a - b for a, b in pairs if len(a) == len(b)]
    least = np.min(falls, axis=0) if falls else np.zeros(0)
    return int(np.sum(least > 0)), len(least)


def _largest_size(stage: Stage) -> float:
    return float(np.max(np.abs(stage.fit.terms[stage.added].sizes)))


def _at_bounds(stage: Stage) -> list[str]:
    """The effects of a model that have a parameter at its bound."""
    labels = np.array(stage.fit.terms.labels)[stage.fit.at_bound]
    return list(dict.fromkeys(effect for effect, _name in labels.tolist()))


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
    out = []
    for row in (row for row in found.candidates if not row.why_not.lacking):
        alone = None if found.path is None else found.path.alone(row.effect)
        out.append(
            CandidateRow(
                effect=row.effect,
                title=row.title,
                alone=None if alone is None else alone[0],
                needs="" if alone is None or found.path is None else _needs(found.path, alone[1]),
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


def _needs(path: ModelPath, term: Term) -> str:
    """What it would take: the parameter that is largest in plausible sizes."""
    layout, setup = term.layout, path.first.state.prediction.setup
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
