"""Noise stated on the command line: ``position=0.1mm``."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import fields, replace

from crosscheck.errors import CrosscheckError
from crosscheck.measurements.data import Measurements, Sigma
from crosscheck.units import LEAST_NOISE, SI, parse_quantity

__all__ = ["stated", "with_stated"]


def with_stated(data: Measurements, texts: Iterable[str]) -> Measurements:
    """The measurements with stated noise, in place of the TOML's for these kinds.

    Args:
        data: as read.
        texts: each a kind of reading and a quantity, such as ``"tension=0.5N"``.

    Raises:
        CrosscheckError: an unknown kind, no quantity, one in another unit, or two for one kind.
    """
    texts = list(texts)
    sigma, ratio = stated(data.sigma, texts), data.sigma_ratio.copy()
    said = [text.partition("=")[0].strip() for text in texts]
    for k, item in enumerate(fields(Sigma)):
        if item.name.partition("_")[0] in said:
            ratio[:, k] = 1.0  # in all files
    return replace(data, sigma=sigma, sigma_ratio=ratio)


def stated(sigma: Sigma, texts: Iterable[str]) -> Sigma:
    """The noise with some kinds replaced; see :func:`with_stated`."""
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
    return replace(sigma, **values)
