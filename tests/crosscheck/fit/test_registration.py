"""The turn between points, and what shows none."""

from __future__ import annotations

import numpy as np
import pytest

from crosscheck.fit.registration import turn_of_points
from seecr.pose import quat_from_rotvec, quat_rotate

CORNERS = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.3, 0.0], [0.1, 0.2, 0.4]])


@pytest.mark.parametrize("count", [3, 4])
def test_the_turn_that_was_made_is_found(count: int) -> None:
    turn = quat_from_rotvec(np.array([0.3, -1.2, 2.0]))
    found = turn_of_points(CORNERS[:count], quat_rotate(turn, CORNERS[:count]) + 2.0)
    assert found is not None
    np.testing.assert_allclose(found * np.sign(found @ turn), turn, atol=1e-12)


@pytest.mark.parametrize("count", [0, 1, 2, 5])
def test_points_in_one_line_show_no_turn(count: int) -> None:
    """So do fewer than three; of one a singular value was looked up that it does not have."""
    line = np.linspace(0.0, 1.0, count)[:, None] * np.array([[0.2, 0.1, -0.4]])
    assert turn_of_points(line, line + 1.0) is None
