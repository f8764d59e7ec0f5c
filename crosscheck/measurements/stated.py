"""Noise as the command line states it: ``position=0.1mm``."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from crosscheck.errors import CrosscheckError
from crosscheck.units import LEAST_NOISE, SI, parse_quantity

__all__ = ["parsed"]


def parsed(texts: Iterable[str]) -> dict[str, float]:
    """Noise in SI by fields of :class:`crosscheck.Sigma`, such as ``tension_N``.

    Args:
        texts: each a kind of reading and a quantity, such as ``"tension=0.5N"``.

    Raises:
        CrosscheckError: an unknown kind, no quantity, one in another unit, or two for one kind.
    """
    values: dict[str, float] = {}
    for text in texts:
        kind, equals, quantity = text.partition("=")
        kind = kind.strip()
        if not equals or kind not in SI:
            near = difflib.get_close_matches(kind, SI, n=len(SI), cutoff=0.0)
            raise CrosscheckError(
                f"--sigma {text}: expected KIND=QUANTITY such as position=0.1mm, KIND one of "
                f"{', '.join(near)} (nearest first)"
            )
        key = f"{kind}_{SI[kind]}"
        if key in values:
            raise CrosscheckError(
                f"--sigma {text}: expected one for the {kind}, got two; leave one out"
            )
        values[key] = parse_quantity(f"--sigma {kind}", kind, quantity, LEAST_NOISE)
    return values
