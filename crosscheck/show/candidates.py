"""Effects that a diagnosis does not list: how probable each is, and why it is not listed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from crosscheck.diagnosis.path import ModelPath
from crosscheck.diagnosis.result import PROBABLE, Diagnosis, NotListed
from crosscheck.diagnosis.words import probability_name, within_words
from crosscheck.fit.reasons import Why, probability_words
from crosscheck.show.blocks import (
    Bar,
    Below,
    Block,
    Bold,
    Cell,
    Code,
    Items,
    Line,
    TextTable,
    codes,
)
from seecr.counted import counted
from seecr.effects import Term
from seecr.effects.base import Layout
from seecr.effects.setup import Setup
from seecr.units import in_unit, parameter_name, short

# On the terminal; diagnosis.json has the others.
_MOST, _FILE = 6, "diagnosis.json"
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
    yield Items(lines[:_MOST], "not ", "dim")
    if len(rows) > _MOST:
        yield Line(_others(found, rows[_MOST:]), "dim")


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
    return f"nor {counted(len(rows), 'other')}{most}: see candidates in {_FILE}"


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
