"""What the end of a search is worth: its last effects are hints until they are sure."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from crosscheck.diagnosis import settled
from crosscheck.diagnosis.chances import Chances
from crosscheck.diagnosis.search import Search
from crosscheck.diagnosis.settled import _by_evidence, _sure_part, _with_better

NOTHING: Any = None


def way(*added: str, noise_from: int) -> Search:
    """Steps that end with noise from this one on."""
    steps: Any = [
        SimpleNamespace(added=name, whiteness=SimpleNamespace(is_noise=k >= noise_from))
        for k, name in enumerate(("", *added))
    ]
    return Search(NOTHING, tuple(steps), {})


def chances(**each: float) -> Chances:
    classes = tuple(((name,), p) for name, p in each.items())
    return Chances(each, classes, None, None)


def test_a_last_effect_that_is_not_sure_is_no_finding() -> None:
    found = way("mass", "tilt", noise_from=1)
    assert _sure_part(found, chances(mass=0.999, tilt=0.94)).found == ("mass",)
    assert _sure_part(found, chances(mass=0.999, tilt=0.96)).found == ("mass", "tilt")


def test_all_that_are_not_sure_go_until_one_is() -> None:
    found = way("mass", "tilt", "creep", noise_from=0)
    assert _sure_part(found, chances(mass=0.6, tilt=0.7, creep=0.8)).found == ()
    assert _sure_part(found, chances(mass=0.6, tilt=0.99, creep=0.8)).found == ("mass", "tilt")


def test_of_what_is_not_sure_all_that_evidence_does_not_tell_apart_is_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A mass was told as cables that stiffen, at 74 %, with the mass at 12 % beside it."""
    asked: Any = []

    def rivals_of(_found: Search, name: str, apart: float) -> list[str]:
        asked.append((name, apart))
        return ["mass", "stiffness"]

    monkeypatch.setattr(settled, "rivals_of", rivals_of)
    rivals: Any = {"curve": ["stiffness"], "tilt": []}
    found = way("tilt", "curve", noise_from=2)
    wider: Any = _by_evidence(found, rivals, chances(curve=0.74, tilt=0.99))
    assert asked == [("curve", np.inf)]
    assert wider == {"curve": ["mass", "stiffness"], "tilt": []}
    assert _by_evidence(found, rivals, chances(curve=0.99, tilt=0.99)) == rivals


def test_what_explains_more_is_looked_for_until_nothing_does(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Neither it nor what it took the place of is told as a rival that explains as well."""
    found, other = way("tilt", "curve", noise_from=2), way("tilt", "mass", noise_from=2)
    better, alike = (SimpleNamespace(is_better=is_better) for is_better in (True, False))
    tried = {("tilt", "curve"): [better], ("tilt", "mass"): [alike]}
    monkeypatch.setattr(settled, "in_place_of", lambda search, _name: tried[search.found])
    monkeypatch.setattr(settled, "replaced", lambda s, some: other if better in some else s)
    last, rivals = _with_better(found, lambda _text: None)
    assert last is other and rivals == {"tilt": [alike], "mass": [alike]}
    # where nothing may take its place, what explains more is no rival either
    monkeypatch.setattr(settled, "replaced", lambda s, _some: s)
    assert _with_better(found, lambda _text: None) == (found, {"tilt": [], "curve": []})


def test_the_end_of_a_search_asks_what_explains_more(monkeypatch: pytest.MonkeyPatch) -> None:
    class Asked(Exception):
        pass

    def asks(found: Search, told: Any) -> Any:
        raise Asked(found.found)

    monkeypatch.setattr(settled, "_with_better", asks)
    monkeypatch.setattr(settled, "_all_rivals", lambda *_: {})
    with pytest.raises(Asked, match="tilt"):
        settled.settled(way("tilt", noise_from=1), [])


def test_an_effect_without_which_no_noise_is_left_stays() -> None:
    found = way("mass", "tilt", noise_from=2)
    assert _sure_part(found, chances(mass=0.999, tilt=0.5)).found == ("mass", "tilt")
    assert np.isclose(chances(mass=0.5).of("mass"), 0.5) and chances().of("mass") == 0.0
