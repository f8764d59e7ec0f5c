"""docs/import.md names every option and format, and its samples are read."""

from __future__ import annotations

import re
from pathlib import Path

import click
import pytest

from crosscheck.cli.importing import command
from crosscheck.importing.choices import ImportChoices
from crosscheck.importing.take import READERS

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "import.md").read_text(encoding="utf-8")
SAMPLES = re.findall(r"```text\n(.*?)```", PAGE, re.DOTALL)


def test_every_option_and_format_is_on_the_page():
    options = [p.opts[0] for p in command.params if isinstance(p, click.Option)]
    assert [name for name in options if name not in PAGE and name not in ("--json",)] == []
    assert all(f"`{form}`" in PAGE for form in READERS)


@pytest.mark.parametrize(("form", "sample"), list(zip(("motive", "vicon"), SAMPLES, strict=True)))
def test_samples_of_the_page_are_read(form, sample, tmp_path):
    file = tmp_path / "sample.csv"
    file.write_text(sample)
    export = READERS[form](file, ImportChoices(rotation="vector")).upright()
    ((position, quat),) = export.bodies.values()
    assert position[1] == pytest.approx([0.2, 0.25, 0.1])
    assert quat[1] == pytest.approx([1.0, 0.0, 0.0, 0.0])
