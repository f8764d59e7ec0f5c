"""The model of a diagnosis: how well its values are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_diagnoses import pulleys

from crosscheck.diagnosis import found_covariance, found_effects
from crosscheck.fit.reasons import DiagnosisVerdict


def test_the_covariance_is_that_of_the_errors_as_listed() -> None:
    found = pulleys()
    (listed,) = found.missing
    wider = replace(found, missing=(replace(listed, stderr=3.0 * listed.stderr),))
    for one, factor in ((found, 1.0), (wider, 3.0)):
        covariance = found_covariance(one)
        assert covariance is not None
        own = np.concatenate([effect.stderr for effect in found_effects(one)])
        assert np.sqrt(np.diag(covariance)) == pytest.approx(own)
        assert own[-1] == pytest.approx(factor * listed.stderr[-1])


@pytest.mark.parametrize(
    "verdict", [DiagnosisVerdict.MANY_EFFECTS, DiagnosisVerdict.UNKNOWN_EFFECT]
)
def test_where_more_is_missing_than_is_listed_there_is_none(verdict: DiagnosisVerdict) -> None:
    assert found_covariance(replace(pulleys(), verdict=verdict)) is None
