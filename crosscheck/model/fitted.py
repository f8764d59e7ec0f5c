"""An effect as fitted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seecr.effects import Term
from seecr.pose import Array


@dataclass(frozen=True, eq=False)
class Fitted:
    """An effect as fitted.

    Attributes:
        term: with its values. stderr: (p,), inf if unseen. at_bound: (p,) bool.
    """

    term: Term
    stderr: Array
    at_bound: NDArray[np.bool_]

    def as_json(self) -> dict[str, Any]:
        """Its parameters by name, in SI units."""
        layout = self.term.layout
        return {
            key: {
                "value": float(self.term.vector[i]),
                "stderr": float(self.stderr[i]),
                "unit": layout.units[i],
                "at_bound": bool(self.at_bound[i]),
            }
            for i, key in enumerate(layout.names)
        }
