"""A robot whose cables are stiffer than described, and its measurements, as files."""

from __future__ import annotations

from pathlib import Path

import pytest
from made_data import case


@pytest.fixture(scope="session")
def stiff(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return case(tmp_path_factory.mktemp("stiff"), {"stiffness": {"factor": 1.4}})
