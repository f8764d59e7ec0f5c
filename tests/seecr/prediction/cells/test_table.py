"""One effect in a model's file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from seecr.description.mjcf import load_robot
from seecr.effects import Term
from seecr.errors import InputFileError
from seecr.pose import Array
from seecr.prediction.effect_tables import Where, term_of

ROBOT = load_robot("demobot_cogiro")
WHERE = Where(Path("m.toml"), "[[effect]]\n")


def read(name: str, **table: Any) -> tuple[Term, Array]:
    return term_of(WHERE, 0, {"name": name, **table}, ROBOT)


def values(whole: Mapping[str, Any]) -> list[float]:
    """The gains of drums of which number 3 is said by itself."""
    return read("drum_gain", parameters={**whole, "gain_3": 0.003})[0].vector.tolist()


def test_what_is_said_of_all_cables_is_said_of_each_that_has_nothing_of_its_own() -> None:
    assert values({"gain": 0.001}) == [0.001, 0.001, 0.003, *[0.001] * 5]


def test_of_each_cable_its_own_words_count_and_the_rest_is_that_of_all() -> None:
    both = {"gain": {"value": 0.001, "stderr": 1e-4}, "gain_2": {"value": 0.002, "stderr": 2e-4}}
    term, stderr = read("drum_gain", parameters=dict(both))
    assert term.vector.tolist() == [0.001, 0.002, *[0.001] * 6]
    assert stderr.tolist() == [1e-4, 2e-4, *[1e-4] * 6]
    both["gain_2"] = {"fixed": True}
    term, stderr = read("drum_gain", parameters=dict(both))
    assert term.vector[1] == 0.001 and stderr[1] == 1e-4
    assert np.flatnonzero(term.knowledge.fixed).tolist() == [1]


def test_an_effect_of_each_file_that_says_no_more_is_nothing_so_far() -> None:
    term, stderr = read("stiffness", per_file=True)
    assert term.vector.tolist() == [1.0] and np.isnan(stderr).all()
    assert term.own is not None and (term.own.kind, term.own.values) == ("file", {})
    with pytest.raises(InputFileError, match=r"expected a table \[effect.parameters\] with factor"):
        read("stiffness")


def test_keys_of_the_users_own_are_left_alone_unless_they_look_misspelt() -> None:
    assert read("stiffness", parameters={"factor": 1.2}, remark="on a Monday")[0].vector == [1.2]
    with pytest.raises(InputFileError, match="unknown Provenence; expected provenance"):
        read("stiffness", parameters={"factor": 1.2}, Provenence="here")


def test_of_many_missing_parameters_some_are_named() -> None:
    with pytest.raises(InputFileError) as error:
        read("exit_point_error", parameters={})
    said = str(error.value)
    assert "error_1_x_m" in said and "error_8_z_m" not in said and "= { value = 0 }" in said
