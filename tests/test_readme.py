"""What README shows is what the programs print, and CI runs README's test command."""

from __future__ import annotations

import json
import re
from pathlib import Path

import draw_fall
import pytest
import render_pictures
from shown import Page

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
# What installs is what CI runs; everything else is run here.
SHOWN = re.sub(r"```sh\npython3 -m venv .*?```", "", README, flags=re.DOTALL)
COMMANDS = "".join(re.findall(r"\n\n```sh\n.*?```\n", SHOWN, re.DOTALL))
EXAMPLES = re.sub(r"```sh\n.*?```", "", SHOWN, flags=re.DOTALL)


@pytest.mark.slow
def test_the_examples_print_what_is_shown(tmp_path: Path) -> None:
    """And the pictures have that diagnosis' numbers, which README gives in words too."""
    page = Page(tmp_path)
    page.run(EXAMPLES)
    names = page.names
    assert names["corrected"].reached.all()
    for name in (render_pictures.REPORT, render_pictures.DIAGNOSIS.name):
        shown = render_pictures.numbers_in(render_pictures.FOLDER / f"{name}.png")
        today = render_pictures.numbers_of_diagnosis(names["found"])
        assert shown == pytest.approx(today, rel=1e-3), "run: scripts/render_pictures.py"
    now = draw_fall.numbers(draw_fall.steps(names["robot"], names["measured"], names["found"]))
    drawn = json.loads(draw_fall.NUMBERS.read_text(encoding="utf-8"))
    assert list(now) == list(drawn), "run: make docs"
    for model, errors in now.items():
        assert errors == pytest.approx(drawn[model], rel=2e-3), "run: make docs"
    told = [f"{errors['position_mm']:.2g} mm" for errors in drawn.values()][:-1]
    assert all(value in README.split("docs/pictures/fall.png")[0] for value in told)


def test_each_example_shows_what_it_prints() -> None:
    assert README.count("```python\n") == len(re.findall(r"```\n\n```text\n", README)) == 2


@pytest.mark.sweep
def test_the_commands_do_what_they_say(tmp_path: Path) -> None:
    """The tutorial's are the same commands; these take half a minute."""
    page = Page(tmp_path)
    page.run(COMMANDS)
    assert len(page.commands) == 7


def test_what_a_correction_gains_is_what_the_tutorial_measures() -> None:
    """Whose output a test of the tutorial compares."""
    said = re.search(r"off by up to (\S+) mm before, (\S+) mm after", " ".join(README.split()))
    page = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
    assert said
    for poses, error in zip(("commanded", "wanted"), said.groups(), strict=True):
        assert re.search(rf"^off the {poses} poses: .* rms, {error} mm at most", page, re.MULTILINE)


def test_ci_runs_the_test_command_of_the_readme() -> None:
    command = re.search(r"^python3 -m venv .*pytest$", README, re.MULTILINE)
    assert command
    assert command.group(0) in (ROOT / ".ci" / "run").read_text(encoding="utf-8")
