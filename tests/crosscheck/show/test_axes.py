"""Axes of a chart: round numbers along its edges."""

from __future__ import annotations

from typing import Any

import numpy as np

from crosscheck.show.misfit import draw_axes


class Drawn:
    """Instead of a recording: what is drawn, by entity."""

    def __init__(self) -> None:
        self.entities: dict[str, Any] = {}

    def always(self, entity: str, *what: Any) -> None:
        self.entities[entity] = what[0]

    def labels(self, entity: str, _places: Any, words: list[str]) -> None:
        self.entities[entity] = words


def test_numbers_are_round_and_zero_has_no_sign() -> None:
    drawn = Drawn()
    draw_axes(drawn, "map", np.array([[0.0, 0.0], [1.0, 2.0]]), "mm")  # type: ignore[arg-type]
    labels = drawn.entities["map/numbers"]
    numbers = [float(label) for label in labels if label.replace(".", "").isdigit()]
    assert "-0" not in labels and 0.0 in numbers
    assert {0.0, 0.5, 1.0} <= set(numbers)
