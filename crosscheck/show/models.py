"""Two models on the terminal: what moved, what nobody knows, and the pooled model."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from rich.console import Console

from crosscheck.comparison.models import ModelComparison
from crosscheck.show.blocks import Block, Items, Line
from crosscheck.show.terminal import show


def print_models(
    found: ModelComparison, pooled: Path | None, console: Console | None = None
) -> None:
    """Print what moved, what neither settles, what one has alone, and where the pooled model is."""
    show(_on_terminal(found, pooled), console)


def _on_terminal(found: ModelComparison, pooled: Path | None) -> Iterator[Block]:
    yield Line(f"{found.before} → {found.now}", "bold")
    yield Line(found.sentence, "bold yellow" if found.differs else "green" if found.values else "")
    yield Items(found.details, "  ")
    if pooled is not None and found.pooled is not None:
        yield Line(f"Written to {pooled}: {', '.join(found.pooled.names)}, both together")
    elif pooled is not None:
        why = "the values differ" if found.differs else "they have no value in common"
        yield Line(f"{pooled} was not written: {why}, so that no one model holds for both")
