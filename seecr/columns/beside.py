"""The commands part of the TOML beside a file; the rest of it is about measurements."""

from __future__ import annotations

from seecr.files import Toml

# Allowed values of each key, the default first.
CHOICES = {"lengths": ("absolute", "told"), "start": ("reference", "first_row")}


def choice(toml: Toml, key: str) -> str:
    """The value of a key of :data:`CHOICES`.

    Raises:
        InputFileError: the value is not an allowed one.
    """
    value = toml.content.get(key, CHOICES[key][0])
    if value not in CHOICES[key]:
        words = " or ".join(f'"{word}"' for word in CHOICES[key])
        raise toml.error(f"{key} must be {words}, got {value!r}", key)
    return str(value)
