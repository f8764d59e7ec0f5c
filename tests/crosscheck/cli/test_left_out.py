"""What the statics leave out of a robot's file is told once by every command that fits or plans."""

from __future__ import annotations

from pathlib import Path

import made_diagnoses as made
import pytest
from made_data import run

from crosscheck.measurements.write import write_measurements
from seecr.description.mjcf import load_robot, model_path

pytestmark = pytest.mark.slow

FEW = ("--only", "stiffness,platform_mass")


@pytest.fixture(scope="module")
def rough(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A planar robot whose slide has an end, and readings of it."""
    folder = tmp_path_factory.mktemp("rough")
    xml, data = folder / "rough.xml", folder / "measured.csv"
    text = model_path("planar_vertical").read_text(encoding="utf-8")
    old = '<joint name="x" type="slide"'
    assert text.count(old) == 1
    xml.write_text(text.replace(old, f'{old} range="-1 1"'), encoding="utf-8")
    write_measurements(data, made.readings(radius_m=0.01))
    return xml, data


@pytest.mark.usefixtures("unpaged")
@pytest.mark.parametrize(
    ("command", "options"),
    [
        (["compare"], ["--no-recording"]),
        (["diagnose"], ["--no-recording", *FEW]),
        (["add", "pulley_radius"], ["--model", "MODEL"]),
        (["calibrate"], ["--model", "MODEL", *FEW]),
        (["plan"], []),
    ],
    ids=["compare", "diagnose", "add", "calibrate", "plan"],
)
def test_a_command_tells_it_once(
    rough: tuple[Path, Path], tmp_path: Path, command: list[str], options: list[str]
) -> None:
    places = [str(tmp_path / "m.toml") if word == "MODEL" else word for word in options]
    got = run(*command, *rough, *places, "--out", tmp_path / "out")
    assert got.exit_code in (0, 1), got.output
    assert got.stdout.count("left out here") == 0
    (note,) = load_robot(rough[0]).notes
    assert got.stderr.splitlines().count(f"note: {note}") == 1
