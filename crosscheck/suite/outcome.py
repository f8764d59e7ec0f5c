"""How a case, an effect or a whole run ended."""

from __future__ import annotations

from collections.abc import Iterable
from enum import Enum


class Outcome(Enum):
    """How a case or a run ended; the value is the word that people read."""

    AGREE = "agree"
    DIFFER = "DIFFER"
    NOT_CONVERGED = "NOT CONVERGED"

    @property
    def exit_status(self) -> int:
        """0 agree (findings within limits), 1 differ by too much, 3 a solve did not converge."""
        return {Outcome.AGREE: 0, Outcome.DIFFER: 1, Outcome.NOT_CONVERGED: 3}[self]

    @classmethod
    def of_all(cls, outcomes: Iterable[Outcome]) -> Outcome:
        """A difference outweighs a solve that did not converge; of none, nothing converged."""
        found = set(outcomes) or {cls.NOT_CONVERGED}
        return next((one for one in (cls.DIFFER, cls.NOT_CONVERGED) if one in found), cls.AGREE)
