"""What a model's file says of its effects: of one parameter, of a whole table."""

from __future__ import annotations

from seecr.prediction.cells.cell import UNSEEN, Where, nearest_first, number_of
from seecr.prediction.cells.table import term_of

__all__ = ["UNSEEN", "Where", "nearest_first", "number_of", "term_of"]
