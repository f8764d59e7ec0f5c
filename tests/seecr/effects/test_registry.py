"""Effects by name."""

from __future__ import annotations

from typing import Any

import pytest

import seecr


def test_a_layout_is_found_by_name_and_by_class() -> None:
    by_name = seecr.layout_of("backlash", "demobot_cogiro")
    assert by_name.effect is seecr.effect_named("backlash")
    assert by_name.names == seecr.layout_of(by_name.effect, "demobot_cogiro").names


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("backlsh", "no effect 'backlsh'; known, nearest first: backlash, "),
        (
            "lab/robot.xml",
            "expected the name of an effect, such as pulley_radius, got 'lab/robot.xml', which "
            "looks like a file's name$",
        ),
        (["backlash"], "expected the name of an effect, got \\['backlash'\\]"),
        (float, "expected the name of an effect, or its class, got <class 'float'>"),
    ],
)
def test_what_is_no_effect_is_refused(given: Any, said: str) -> None:
    with pytest.raises(seecr.InputError, match=said):
        seecr.layout_of(given, "demobot_cogiro")
