"""Small robots and files of a few lines."""

from __future__ import annotations

from pathlib import Path

import pytest
from measured_csv import ARM, FREE, HINGE, PLANAR, SLIDE, mjcf

from seecr.description.mjcf import load_robot
from seecr.description.robot import Robot


@pytest.fixture(scope="module")
def robots(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Robot]:
    folder = tmp_path_factory.mktemp("robots")
    texts = {
        "free": mjcf(FREE, 'pos="0 0.05 0" quat="0.8 0 0 0.6"'),
        "planar": mjcf(PLANAR, 'pos="0 0.05 0"'),
        "slides": mjcf(PLANAR.partition("\n")[0], 'pos="0 0.05 0" quat="0.8 0 0.6 0"'),
        "yawed": mjcf(PLANAR.partition("\n")[0], 'pos="0 0.05 0" quat="0.8 0 0 0.6"'),
        "slide then hinge": mjcf(SLIDE + HINGE, 'pos="0 0.05 0"'),
        "hinge then slide": mjcf(HINGE + SLIDE, 'pos="0 0.05 0"'),
        "arm": mjcf(ARM, 'pos="0 0.05 0"'),
        "eight": mjcf(FREE, 'pos="0 0 0"', n_cables=8),
    }
    for name, text in texts.items():
        (folder / f"{name}.xml").write_text(text)
    return {name: load_robot(folder / f"{name}.xml") for name in texts}


@pytest.fixture(scope="module")
def robot(robots: dict[str, Robot]) -> Robot:
    return robots["free"]


@pytest.fixture
def csv_file(tmp_path: Path):
    """Write lines to ``measured.csv``, with a TOML beside it if there is one; give its path."""

    def write(*lines: str, end: str = "\n", toml: str = "") -> Path:
        path = tmp_path / "measured.csv"
        path.write_bytes((end.join(lines) + end).encode())
        path.with_suffix(".toml").unlink(missing_ok=True)
        if toml:
            path.with_suffix(".toml").write_text(toml)
        return path

    return write
