"""Fitted values in words: what the data do not show is not printed as a number."""

from __future__ import annotations

import numpy as np
from made_data import soft_cogiro, term

from crosscheck.fit.words import value_lines


def test_what_is_not_determined_has_no_value_unless_it_is_at_its_bound() -> None:
    """In a plane, shift_y was 1.227e-09 mm."""
    layout = term(soft_cogiro(), "pulley_radius").layout
    for error, bound, line in [
        (np.inf, False, "radius = not determined by these data"),
        (np.inf, True, "radius = 10 mm (at its bound)"),
        (1e-4, False, "radius = 10.00 ± 0.10 mm"),
        (1e-4, True, "radius = 10.00 ± 0.10 mm (at its bound)"),
    ]:
        lines = value_lines(layout, np.array([0.01]), np.array([error]), np.array([bound]))
        assert list(lines) == [line]
