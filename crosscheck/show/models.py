"""Two models on the terminal: what moved, what nobody knows, and the pooled model."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from rich.console import Console

from crosscheck.comparison.models import ModelComparison
from crosscheck.show.blocks import Block, Items, Line
from crosscheck.show.terminal import show
from seecr.counted import some

_MOST = 12


def print_models(
    found: ModelComparison, pooled: Path | None, console: Console | None = None
) -> None:
    """Print what moved, what neither settles, what one has alone, and where the pooled model is."""
    show(_on_terminal(found, pooled), console)


def _on_terminal(found: ModelComparison, pooled: Path | None) -> Iterator[Block]:
    yield Items(found.notes, "note: ", "dim")
    yield Line(f"{found.before} → {found.now}", "bold")
    yield Line(found.sentence, "bold yellow" if found.differs else "green" if found.values else "")
    yield Items([one.words for one in found.moved], "  ")
    for name, effects in ((found.before, found.only_before), (found.now, found.only_now)):
        if effects:
            yield Line(f"Only in {name}: {', '.join(effects)}")
    if found.unsettled:
        names = some([one.label for one in found.unsettled], _MOST)
        yield Line(f"Neither settles: {names}; their errors are as large as what is plausible")
    if pooled is None:
        return
    if found.pooled is None:
        why = "the values differ" if found.differs else "they have no value in common"
        yield Line(f"{pooled} was not written: {why}, so that no one model holds for both")
    else:
        yield Line(f"Written to {pooled}: {', '.join(found.pooled.names)}, both together")
