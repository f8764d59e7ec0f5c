"""A frame that yields: sideways and upwards are two compliances, kept as one and a difference."""

from __future__ import annotations

import numpy as np
import pytest
from rectangle import RECTANGLE

from seecr.commands import Commands
from seecr.effects import layout_of
from seecr.effects.geometry import FrameCompliance
from seecr.effects.setup import Setup, plain_setup


def edited(*effects: FrameCompliance) -> Setup:
    setup = plain_setup(RECTANGLE, Commands(RECTANGLE.reference_pose[None]))
    for effect in effects:
        effect.edit_setup(setup)
    return setup


@pytest.mark.parametrize(("sideways", "upwards"), [(3e-4, 1e-4), (0.0, 2e-4), (2e-4, 2e-4)])
def test_upwards_a_frame_yields_by_what_sideways_and_lift_make(
    sideways: float, upwards: float
) -> None:
    setup = edited(FrameCompliance(sideways, upwards))
    assert setup.compliance.tolist() == [sideways] * 4
    assert setup.compliance + setup.lift == pytest.approx(np.full(4, upwards), abs=1e-19)


def test_two_that_yield_are_as_one_that_yields_by_both() -> None:
    both, one = (
        edited(FrameCompliance(1e-4, 3e-4), FrameCompliance(2e-4, 5e-4)),
        edited(FrameCompliance(3e-4, 8e-4)),
    )
    assert both.compliance == pytest.approx(one.compliance, rel=1e-14)
    assert both.lift == pytest.approx(one.lift, rel=1e-14)


def test_a_plausible_frame_yields_a_third_as_much_as_its_cables_stretch() -> None:
    """Cables of 2.5 m with E S = 1000 N stretch by 2.5 mm per newton."""
    layout = layout_of(FrameCompliance, RECTANGLE)
    assert layout.scale == pytest.approx([0.3 * 2.5e-3] * 2)
    assert layout.lower.tolist() == [0.0, 0.0]


def test_a_compliance_of_old_files_is_that_of_both_directions() -> None:
    layout = layout_of(FrameCompliance, RECTANGLE)
    assert FrameCompliance.renamed["compliance_m_per_N"] == layout.names
