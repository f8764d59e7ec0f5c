"""Says where fitted values contradict what somebody measured of them independently.

Independent readings enter every fit beside the data. Many rows outweigh them, and then the values
that explain the data are not those that were measured: one of the two is wrong.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from seecr.counted import some
from seecr.effects import Term

# So many of its standard errors, a value measured independently is contradicted.
CONTRADICTED = 3.0


def contradictions(terms: Iterable[Term]) -> list[str]:
    """A sentence for each effect with values far from their independent readings."""
    return [text for text in map(_contradiction, terms) if text]


def _contradiction(term: Term) -> str:
    off = np.abs(term.vector - term.knowledge.value) / term.knowledge.stderr
    against = term.knowledge.measured & (off > CONTRADICTED)
    if not against.any():
        return ""
    names = np.array(term.layout.names)[against].tolist()
    verb = "is" if len(names) == 1 else "are up to"
    return (
        f"{term.name}: {some(names)} {verb} {off[against].max():.3g} standard errors from "
        "what was measured independently: check that measurement, and what else was taken for known"
    )
