"""How a model's file states an effect and its parameters."""

from __future__ import annotations

from seecr.prediction.cells.cell import UNSEEN, Where, nearest_first, number_of
from seecr.prediction.cells.table import term_of

__all__ = ["UNSEEN", "Where", "nearest_first", "number_of", "term_of"]
