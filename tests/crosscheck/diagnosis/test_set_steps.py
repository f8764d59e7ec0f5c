"""Sets as steps: what an effect does to chi2 by itself, and what it would need, in closed form."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.calibration.linear_evidence.gram import ColumnGroup, gram_of
from crosscheck.diagnosis import set_steps
from seecr.effects import Term, layout_of

WIDTHS = np.array([0.1, 1.0, 10.0])


def test_chi2_falls_by_what_the_own_columns_explain() -> None:
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(40, 5)), rng.normal(size=40)
    groups = {"a": ColumnGroup(np.arange(2), WIDTHS), "b": ColumnGroup(np.arange(2, 5), WIDTHS)}
    for name, own in (("a", x[:, :2]), ("b", x[:, 2:])):
        drop, seen = set_steps._drop(gram_of(x, y, groups), name)
        left = y - own @ np.linalg.lstsq(own, y, rcond=None)[0]
        assert drop == pytest.approx(y @ y - left @ left) and seen == own.shape[1]


def test_directions_that_move_nothing_do_not_count_but_one_does() -> None:
    rng = np.random.default_rng(1)
    x, y = rng.normal(size=(40, 1)), rng.normal(size=40)
    both = np.concatenate([x, 2.0 * x], axis=1)
    drop, seen = set_steps._drop(gram_of(both, y, {"a": ColumnGroup(np.arange(2), WIDTHS)}), "a")
    assert seen == 1 and drop == pytest.approx((x[:, 0] @ y) ** 2 / (x[:, 0] @ x[:, 0]))
    nothing = gram_of(1e-3 * both, y, {"a": ColumnGroup(np.arange(2), WIDTHS)})
    assert set_steps._drop(nothing, "a") == (0.0, 1)


def test_the_data_determine_directions_whose_signal_is_larger_than_the_prior(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A prior of width w and a column of length c weigh 1 and (c w)^2."""
    x, width = np.diag([3.0, 0.5, 0.5]), np.array([1.0, 1.0, 4.0])
    nothing: Any = None
    for columns, count in ((slice(0, 3), 2), (slice(1, 2), 0), (slice(0, 0), 0)):
        linear = SimpleNamespace(x=x[:, columns], width=width[columns])
        monkeypatch.setattr(set_steps, "linearised", lambda _setting, _joint, one=linear: one)
        assert set_steps.directions(nothing, nothing) == count


@pytest.mark.parametrize("wanted", [-3.0, 1e9])
def test_an_effect_would_need_what_alone_explains_the_readings(wanted: float) -> None:
    """Gains of drums, each seen as well as the noise: the widest prior takes 1/101 of them."""
    layout = layout_of("drum_gain", "demobot_cogiro")
    count = len(layout)
    groups = {"drum_gain": ColumnGroup(np.arange(count), WIDTHS)}
    gram = gram_of(np.eye(count), np.full(count, wanted), groups)
    start = Term(layout, layout.null)
    sought: Any = SimpleNamespace(
        catalogue=SimpleNamespace(start=lambda _name: start),
        found=SimpleNamespace(scores=SimpleNamespace(gram=gram)),
    )
    term = set_steps._needed(sought, "drum_gain")
    needed = layout.null + wanted * 100.0 / 101.0 * layout.scale
    np.testing.assert_allclose(term.vector, np.minimum(needed, layout.upper))
