"""The TOML file that keeps a robot's effects."""

from __future__ import annotations

from crosscheck.model.fitted import load_diagnosed
from crosscheck.model.write import (
    Provenance,
    calibrated,
    check_place,
    provenance_of,
    renewed,
    save_model,
    with_fit,
)

__all__ = [
    "Provenance",
    "calibrated",
    "check_place",
    "load_diagnosed",
    "provenance_of",
    "renewed",
    "save_model",
    "with_fit",
]
