"""Effects of the user's own files, as the option ``--effect`` names them."""

from __future__ import annotations

from collections.abc import Sequence

import click

from seecr import InputError, introduce
from seecr.effects.loaded import load_effect

_META = "seecr.own_effects"
"""In a context's ``meta``: what ``--effect`` was given, for the command that follows."""


def introduce_all(texts: Sequence[str]) -> list[str]:
    """Make the effects of ``FILE.py:CLASS`` part of the catalogue; their names.

    Raises:
        InputError: one that cannot be had, or two of one name.
    """
    found: dict[str, str] = {}
    for text in texts:
        name = introduce(load_effect(text)).name
        if found.setdefault(name, text) != text:
            raise InputError(
                f"--effect: {found[name]} and {text} are both called {name}; expected a name of "
                "its own for each"
            )
    context = click.get_current_context(silent=True)
    if context is not None and texts:
        context.meta[_META] = tuple(dict.fromkeys(texts))
    return list(found)


def given_effects() -> tuple[str, ...]:
    """What ``--effect`` was given to the command that is running, with its option, as words."""
    context = click.get_current_context(silent=True)
    texts = () if context is None else context.meta.get(_META, ())
    return tuple(word for text in texts for word in ("--effect", text))
