"""Missing effects on a page: what a mechanic needs of each, and all of its values."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from crosscheck.diagnosis.result import Diagnosis, MissingEffect
from crosscheck.diagnosis.words import probability_name, removed
from crosscheck.fit.reasons import probability_words
from crosscheck.fit.words import rms_words
from crosscheck.show.blocks import (
    Bold,
    Cell,
    Code,
    Line,
    Panel,
    Small,
    Styled,
    TextTable,
    Words,
    codes,
    present,
)
from seecr.counted import counted
from seecr.effects import Terms
from seecr.units import in_unit, measured, parameter_name, short, with_error

# Correlations above this are named; parameters beyond this many expected sizes are doubtful.
_CORRELATED, PLAUSIBLE = 0.9, 5.0
_MOST_CORRELATIONS = 8
# More parameters than this stand in two columns.
_ONE_COLUMN = 8
# Values of an effect without values for each cable that are told in one line.
_MOST_IN_BRIEF = 3
_OF_CABLE = re.compile(r"(?P<word>[a-z]+)_(?P<cable>\d+)(?:_(?P<axis>[xyz]))?")
# Relative values, which people read in percent.
_RELATIVE = ("gain", "factor")


def in_brief(finding: MissingEffect, cables: Sequence[str]) -> Words:
    """What is wrong, by how much and how to check it, in a line; ``cables`` are their names."""
    title = finding.title
    alike = f" (or {', '.join(finding.indistinguishable)})" if finding.rivals else ""
    values = _values_in_brief(finding, cables)
    return (
        Bold(f"{title[0].upper()}{title[1:]}"), " ", Code(finding.effect), alike,
        f": {values}. Independent check: {finding.check}.",
    )  # fmt: skip


def _values_in_brief(finding: MissingEffect, cables: Sequence[str]) -> str:
    """Its largest value, of those for each cable, or its first few."""
    layout, sizes = finding.layout, np.abs(finding.term.sizes)
    seen = np.isfinite(finding.stderr) & ~layout.shape
    if not seen.any():
        return "its values are not determined by these data"
    order = np.argsort(-np.where(seen, sizes, -1.0), kind="stable")
    of_cable = _OF_CABLE.fullmatch(parameter_name(layout.names[order[0]], layout.units[order[0]]))
    if of_cable is not None and 1 <= int(of_cable["cable"]) <= len(cables):
        k = int(order[0])
        along = f" along {of_cable['axis']}" if of_cable["axis"] else ""
        return f"largest at {cables[int(of_cable['cable']) - 1]}, {_value(finding, k)}{along}"
    first = [k for k in range(len(layout.names)) if seen[k]]
    parts = [
        f"{parameter_name(layout.names[k], layout.units[k]).replace('_', ' ')} {_value(finding, k)}"
        for k in first[:_MOST_IN_BRIEF]
    ]
    more = len(first) - len(parts)
    return ", ".join(parts) + (f" and {more} more" if more > 0 else "")


def _value(finding: MissingEffect, k: int) -> str:
    layout, value, error = finding.layout, finding.values[k], finding.stderr[k]
    relative = parameter_name(layout.names[k], layout.units[k]).partition("_")[0] in _RELATIVE
    if not relative:
        return measured(float(value), float(error), layout.units[k])
    number, spread = with_error(100.0 * float(value - layout.null[k]), 100.0 * float(error))
    return f"{number} ± {spread} %"


def card(found: Diagnosis, number: int, finding: MissingEffect) -> Panel:
    """A missing effect on the page: what it does, its values, how to check it."""
    rivals = finding.indistinguishable
    removes, errors = removed(finding.share), rms_words(finding.held_out_rms)
    name, also = probability_name(found).capitalize(), " or one of its equivalents" * bool(rivals)
    instead = "that" if len(rivals) == 1 else "one of those"
    correlated = correlations(found, finding)
    title = finding.title
    return Panel(
        (f"{number}. {title[0].upper()}{title[1:]} ",
         Small(f"{finding.effect}, {finding.layout.effect.place}")),
        present(
            Line(
                f"Adding it {removes}; the error there is then {errors}. {name} that it{also} is "
                f"missing: {probability_words(finding.probability)}."
            ),
            Line((Bold("Indistinguishable on these data from"), " ", *codes(rivals),
                  f": adding {instead} instead explains the error as well.")) if rivals else None,
            parameter_table(finding),
            Line(f"Correlated above {_CORRELATED:g}: {'; '.join(correlated)}.", "dim")
            if correlated else None,
        ),
        "card",
    )  # fmt: skip


def parameter_table(finding: MissingEffect) -> TextTable:
    """Values and standard errors of a missing effect, and what is doubtful about each."""
    layout = finding.layout
    sizes = (finding.values - layout.null) / layout.scale
    rows: list[list[Cell]] = []
    for name, si, value, error, bound, size in zip(
        layout.names, layout.units, finding.values.tolist(), finding.stderr.tolist(),
        finding.at_bound.tolist(), sizes.tolist(), strict=True,
    ):  # fmt: skip
        factor, unit = in_unit(si)
        shown, spread = with_error(factor * value, factor * error)
        seen = bool(np.isfinite(error))
        flags = [
            *["at its bound"] * bound,
            *["not determined by these data"] * (not seen),
            *[f"{short(abs(size), 2)} expected sizes"] * (abs(size) > PLAUSIBLE),
        ]
        rows.append([
            Code(parameter_name(name, si)),
            shown if seen or bound else "",
            f"± {spread}" if seen else spread,
            unit,
            Styled(", ".join(flags), "bad") if flags else "",
        ])  # fmt: skip
    heads = ["parameter", "#value", "#standard error", "unit", "doubts"]
    if not any(row[-1] for row in rows):
        heads, rows = heads[:-1], [row[:-1] for row in rows]
    return TextTable(heads, rows, kind="two" if len(rows) > _ONE_COLUMN else "")


def correlations(found: Diagnosis, finding: MissingEffect) -> list[str]:
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
    out = [f"{every[i]} with {every[j]} ({short(value)})"
           for (i, j), value in ranked[:_MOST_CORRELATIONS]]  # fmt: skip
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
