"""Hypothesis draws the same examples in every run, few of them, and keeps nothing on disk.

``SEECR_EXAMPLES=10000 pytest -n 0 tests/property`` draws that many for each test.
"""

from __future__ import annotations

import os

from hypothesis import HealthCheck, settings

settings.register_profile(
    "suite",
    derandomize=True,
    deadline=None,
    max_examples=int(os.environ.get("SEECR_EXAMPLES", "40")),
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
settings.load_profile("suite")
