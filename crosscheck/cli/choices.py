"""Options of the commands that hold a model against measurements."""

from __future__ import annotations

from collections.abc import Sequence

import click

sigma_option = click.option(
    "--sigma",
    "sigmas",
    multiple=True,
    metavar="KIND=0.1mm",
    help="Noise of a kind of reading: position, orientation, tension, or of the commanded length; "
    "may be repeated, goes before [sigma] in the TOML.",
)
"""``--sigma position=0.1mm``, given to the command as ``sigmas``, a tuple of texts."""

only_option = click.option(
    "--only",
    multiple=True,
    metavar="EFFECT,...",
    help="Consider these effects alone, beside those of the model; may be repeated.",
)
"""``--only EFFECT,...``, given to the command as ``only``; see :func:`listed`."""

exclude_option = click.option(
    "--exclude", multiple=True, metavar="EFFECT,...", help="Do not consider these effects."
)
"""``--exclude EFFECT,...``, given to the command as ``exclude``; see :func:`listed`."""

tolerance_option = click.option(
    "--tolerance",
    "tolerances",
    multiple=True,
    metavar="0.1mm",
    help="What is left beyond noise counts as missing from this size on (rms, such as 0.1mm, "
    "0.05deg or 1N); may be repeated.  [default: half the noise]",
)
"""``--tolerance 0.1mm``, given to the command as ``tolerances``, a tuple of texts."""


def listed(texts: Sequence[str]) -> list[str]:
    """Words of an option that may be repeated and holds several, separated by commas."""
    return [word.strip() for text in texts for word in text.split(",") if word.strip()]
