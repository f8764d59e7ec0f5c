"""The TOML file that keeps a robot's effects."""

from __future__ import annotations

from crosscheck.model.write import Provenance, renewed, save_model, with_fit

__all__ = ["Provenance", "renewed", "save_model", "with_fit"]
