"""Effects of a diagnosis: those that are missing, with what a mechanic needs; those not listed."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from crosscheck.diagnosis.path import ModelPath
from crosscheck.diagnosis.result import PROBABLE, Diagnosis, MissingEffect, NotListed
from crosscheck.diagnosis.words import probability_name, removed, within_words
from crosscheck.fit.reasons import Why, probability_words
from crosscheck.fit.words import rms_words
from crosscheck.show.blocks import (
    Bar,
    Below,
    Block,
    Bold,
    Cell,
    Code,
    Items,
    Line,
    Panel,
    Small,
    Styled,
    TextTable,
    Words,
    codes,
    present,
)
from seecr.counted import counted, some
from seecr.effects import Term
from seecr.effects.base import Layout
from seecr.effects.setup import Setup
from seecr.units import in_unit, measured, parameter_name, short, with_error

# --- missing effects ------------------------------------------------------------------------------

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
    names = list(map(parameter_name, layout.names, layout.units))
    k = int(np.argmax(np.where(seen, sizes, -1.0)))
    of_cable = _OF_CABLE.fullmatch(names[k])
    if of_cable is not None and 1 <= int(of_cable["cable"]) <= len(cables):
        along = f" along {of_cable['axis']}" if of_cable["axis"] else ""
        return f"largest at {cables[int(of_cable['cable']) - 1]}, {_value(finding, k)}{along}"
    each = [
        f"{names[k].replace('_', ' ')} {_value(finding, k)}" for k in np.flatnonzero(seen).tolist()
    ]
    return some(each, _MOST_IN_BRIEF)


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
    # as the cards' tables name them, those of other effects with whose they are
    every = [
        parameter_name(name, unit) + ("" if term.name == finding.effect else f" of {term.name}")
        for term in best.terms
        for name, unit in zip(term.layout.names, term.layout.units, strict=True)
    ]
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


# --- effects that are not listed: how probable each is, and why -----------------------------------

MOST_CANDIDATES, FILE = 6, "diagnosis.json"
"""How many are told where there is little room, and what has all."""
_ALONE = "explains by itself"
_ALONE_MEANS = (
    "Explains by itself: the part of the error beyond the noise that the effect removes when it "
    "alone is added to the model, on the rows that it was fitted to. That is not evidence for the "
    "effect."
)


def candidate_lines(found: Diagnosis) -> Iterator[Block]:
    """For the terminal: the first few, and how probable the others are."""
    # what the user left out need not be said
    rows = [row for row in found.candidates if row.why_not.why is not Why.EXCLUDED]
    lines = [f"{row.effect}: {row.why_not}{_all_the_same(found, row)}" for row in rows]
    yield Items(lines[:MOST_CANDIDATES], "not ", "dim")
    if len(rows) > MOST_CANDIDATES:
        yield Line(_others(found, rows[MOST_CANDIDATES:]), "dim")


def _all_the_same(found: Diagnosis, row: NotListed) -> str:
    """That an effect is probable, where its reason has it listed no more and does not say so."""
    chance = 0.0 if found.chances is None else found.chances.effect.get(row.effect, 0.0)
    if chance < PROBABLE or "{chance}" in row.why_not.why.value:
        return ""
    return f" ({probability_name(found)} {probability_words(chance)})"


def _others(found: Diagnosis, rows: Sequence[NotListed]) -> str:
    """How probable the effects are that are not printed, the probable ones by name."""
    chances = {} if found.chances is None else found.chances.effect
    likely = {row.effect: chances[row.effect] for row in rows if row.effect in chances}
    named = sorted((p, name) for name, p in likely.items() if p >= PROBABLE)[::-1]
    rest = [p for p in likely.values() if p < PROBABLE]
    said = [f"{name} {probability_words(p)}" for p, name in named]
    if rest:
        said.append(f"{'others ' if named else ''}{probability_words(max(rest))} or less")
    of = f" ({probability_name(found)}: {', '.join(said)})" if named else ""
    most = f" (probability {said[0]})" if said and not named else of
    return f"nor {counted(len(rows), 'other')}{most}: see candidates in {FILE}"


def candidate_blocks(found: Diagnosis) -> list[Block]:
    """Effects that were tried and are not listed, and those that were no candidates."""
    out: list[Block] = []
    if rows := candidate_rows(found):
        out.append(TextTable(list(rows[0]), [list(row.values()) for row in rows]))
        if _ALONE in rows[0]:
            out.append(Line(_ALONE_MEANS, "dim"))
        if within := within_words(found):
            out.append(Line(within, "dim"))
    return [*out, *(Line((Bold(f"{why}:"), " ", *codes(names))) for why, names in untried(found))]


def candidate_rows(found: Diagnosis) -> list[dict[str, Cell]]:
    """Effects that were tried and are not listed, by head: why not, the nearest miss first."""
    tried = [row for row in found.candidates if not row.why_not.lacking]
    alone = [None if found.path is None else found.path.alone(row.effect) for row in tried]
    fitted = any(one is not None and one[0] is not None for one in alone)
    out = []
    for row, one in zip(tried, alone, strict=True):
        cells: dict[str, Cell] = {
            "effect": (Code(row.effect), Below(row.title)),
            f"#{probability_name(found)}": _probabilities(found, row.effect),
        }
        if fitted:
            share = None if one is None else one[0]
            percent = "" if share is None else f"{np.floor(100 * share):.0f} %"
            cells[_ALONE] = "" if share is None else Bar(share, percent)
            needs = "" if one is None or found.path is None else _needs(found.path, one[1])
            cells["with a value of"] = needs
        out.append({**cells, "why not listed": str(row.why_not)})
    return out


def untried(found: Diagnosis) -> list[tuple[str, list[str]]]:
    """Reasons for which effects were no candidates, each with the effects."""
    out: dict[str, list[str]] = {}
    for row in found.candidates:
        if row.why_not.lacking:
            out.setdefault(str(row.why_not), []).append(row.effect)
    return list(out.items())


def _probabilities(found: Diagnosis, effect: str) -> list[str]:
    """The probability of an effect, and that of its class if it has other members."""
    if found.chances is None or effect not in found.chances.effect:
        return []
    together = [p for names, p in found.chances.classes if effect in names and len(names) > 1]
    return [
        probability_words(found.chances.effect[effect]),
        *(Below(f"with equivalents {probability_words(p)}") for p in together[:1]),
    ]


def _needs(path: ModelPath, term: Term) -> str:
    """What it would take: the parameter that is largest in expected sizes."""
    layout, setup = term.layout, path.first.state.prediction.setup
    size = np.where(_makes_size(layout, setup), term.sizes, 0.0)
    k = int(np.argmax(np.abs(size)))
    factor, unit = in_unit(layout.units[k])
    name = parameter_name(layout.names[k], layout.units[k])
    doubt = f" ({short(abs(float(size[k])), 2)} expected sizes)" if abs(size[k]) > 3 else ""
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
