"""The page's cards: each missing effect with its parameters, and what is doubtful about them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crosscheck.diagnosis.result import Diagnosis, MissingEffect
from crosscheck.diagnosis.words import removed
from crosscheck.fit.reasons import probability_words
from crosscheck.fit.words import rms_words
from seecr.counted import counted
from seecr.effects import Terms
from seecr.units import in_unit, parameter_name, short, with_error

# Correlations above this are named; parameters beyond this many plausible sizes are doubtful.
_CORRELATED, PLAUSIBLE = 0.9, 5.0
_MOST_CORRELATIONS = 8
# More parameters than this stand in two columns.
_ONE_COLUMN = 8


@dataclass(frozen=True)
class ParameterRow:
    """A parameter as the page shows it; ``flags`` say what is doubtful about its value."""

    name: str
    value: str
    stderr: str
    unit: str
    flags: str
    seen: bool


@dataclass(frozen=True)
class FindingCard:
    """A missing effect as the page shows it."""

    effect: str
    title: str
    place: str
    removes: str
    rivals: list[str]
    check: str
    parameters: list[ParameterRow]
    correlations: list[str]
    errors: str
    probability: str

    @property
    def doubtful(self) -> bool:
        """Whether a value of it is."""
        return any(row.flags for row in self.parameters)

    @property
    def columns(self) -> int:
        """Of its table of parameters."""
        return 1 if len(self.parameters) <= _ONE_COLUMN else 2


def finding_card(found: Diagnosis, finding: MissingEffect) -> FindingCard:
    """A finding as the page shows it."""
    rows = [
        _parameter(*item)
        for item in zip(
            finding.layout.names, finding.layout.units, finding.values, finding.stderr,
            finding.at_bound, (finding.values - finding.layout.null) / finding.layout.scale,
            strict=True,
        )
    ]  # fmt: skip
    return FindingCard(
        effect=finding.effect,
        title=finding.title,
        place=finding.layout.effect.place,
        removes=removed(finding.share),
        rivals=[rival.name for rival in finding.rivals],
        check=finding.check,
        parameters=rows,
        correlations=_correlations(found, finding),
        errors=rms_words(finding.held_out_rms),
        probability=probability_words(finding.probability),
    )


def _parameter(
    name: str, unit: str, value: float, error: float, bound: bool, size: float
) -> ParameterRow:
    factor, words = in_unit(unit)
    shown, spread = with_error(factor * float(value), factor * float(error))
    flags = []
    if bound:
        flags.append("at its bound")
    if not np.isfinite(error):
        flags.append("not determined by these data")
        shown = shown if bound else ""
    if abs(size) > PLAUSIBLE:
        flags.append(f"{short(float(abs(size)), 2)} plausible sizes")
    return ParameterRow(
        parameter_name(name, unit), shown, spread, words, ", ".join(flags), bool(np.isfinite(error))
    )


def _correlations(found: Diagnosis, finding: MissingEffect) -> list[str]:
    """Parameters that the data hold together, the strongest first."""
    assert found.path is not None
    best = found.path.last.fit
    every = _spoken(best.terms, finding.effect)
    own = np.flatnonzero(best.terms.own(finding.effect))
    correlation = best.correlation
    pairs = {
        (min(i, j), max(i, j)): float(correlation[i, j])
        for i in own.tolist()
        for j in range(len(every))
        if i != j and abs(correlation[i, j]) > _CORRELATED
    }
    ranked = sorted(pairs.items(), key=lambda item: -abs(item[1]))
    out = []
    for (i, j), value in ranked[:_MOST_CORRELATIONS]:
        out.append(f"{every[i]} with {every[j]} ({short(value)})")
    if len(ranked) > _MOST_CORRELATIONS:
        out.append(f"and {counted(len(ranked) - _MOST_CORRELATIONS, 'more pair')}")
    return out


def _spoken(terms: Terms, effect: str) -> list[str]:
    """Parameters as the cards' tables name them, those of other effects with whose they are."""
    return [
        parameter_name(name, unit) + ("" if term.name == effect else f" of {term.name}")
        for term in terms
        for name, unit in zip(term.layout.names, term.layout.units, strict=True)
    ]
