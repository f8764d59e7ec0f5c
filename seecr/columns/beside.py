"""What the TOML beside a file says of its commands; the rest of it is of measurements."""

from __future__ import annotations

from seecr.files import Toml

# What a key may say, the default first.
CHOICES = {"lengths": ("absolute", "told"), "start": ("reference", "first_row")}


def choice(toml: Toml, key: str) -> str:
    """What a key of :data:`CHOICES` says.

    Raises:
        InputFileError: another word than those it may say.
    """
    value = toml.content.get(key, CHOICES[key][0])
    if value not in CHOICES[key]:
        words = " or ".join(f'"{word}"' for word in CHOICES[key])
        raise toml.error(f"{key} must be {words}, got {value!r}", key)
    return str(value)
