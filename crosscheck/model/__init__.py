"""The TOML file that keeps a robot's effects."""

from __future__ import annotations

from crosscheck.model.write import (
    Provenance,
    calibrated,
    provenance_of,
    renewed,
    save_model,
    with_fit,
)

__all__ = [
    "Provenance",
    "calibrated",
    "provenance_of",
    "renewed",
    "save_model",
    "with_fit",
]
