"""README's example prints what README says, and CI runs README's test command."""

from __future__ import annotations

import contextlib
import io
import json
import re
from pathlib import Path
from typing import Any

import draw_fall
import pytest
import render_pictures
from shown import Page

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def printed_by(
    number: int, before: dict[str, Any] | None = None
) -> tuple[str, str, dict[str, Any]]:
    """What an example of README prints, what README says that it prints, and its names.

    ``before`` are the names of the example that it goes on from.
    """
    examples = re.findall(r"```python\n(.*?)```\n\n```text\n(.*?)```", README, re.DOTALL)
    code, said = examples[number]
    printed, names = io.StringIO(), dict[str, Any](before or {})
    with contextlib.redirect_stdout(printed):
        exec(compile(code, "README.md", "exec"), names)
    return printed.getvalue(), said, names


def test_the_example_of_seecr_prints_what_it_says() -> None:
    printed, said, _ = printed_by(0)
    assert printed == said and said.startswith("x 0.17 m")


@pytest.mark.slow
def test_the_diagnosis_from_python_prints_what_it_says() -> None:
    """And the first picture has that diagnosis' numbers, which README gives in words too."""
    printed, said, names = printed_by(1)
    assert printed == said and said.startswith("effects_found")
    for name in (render_pictures.REPORT, render_pictures.DIAGNOSIS.name):
        shown = render_pictures.numbers_in(render_pictures.FOLDER / f"{name}.png")
        today = render_pictures.numbers_of_diagnosis(names["found"])
        assert shown == pytest.approx(today, rel=1e-3), "run: scripts/render_pictures.py"
    printed, said, after = printed_by(2, names)
    assert printed == said and after["corrected"].reached.all()
    fall = draw_fall.steps(names["robot"], names["twin"].measured, names["found"])
    drawn = json.loads(draw_fall.NUMBERS.read_text(encoding="utf-8"))
    now = draw_fall.numbers(fall)
    assert list(now) == list(drawn), "run: make docs"
    for model, errors in now.items():
        assert errors == pytest.approx(drawn[model], rel=2e-3), "run: make docs"
    told = [f"{errors['position_mm']:.2g} mm" for errors in drawn.values()][:-1]
    assert all(value in README.split("docs/pictures/fall.png")[0] for value in told)


@pytest.mark.sweep
def test_the_commands_of_one_robot_do_what_they_say(tmp_path: Path) -> None:
    """The tutorial's are the same commands; these take half a minute."""
    block = next(b for b in re.findall(r"```sh\n.*?```", README, re.DOTALL) if "--hide 13" in b)
    page = Page(tmp_path)
    page.run(f"\n\n{block}\n")
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


def test_pictures_and_pages_exist() -> None:
    for target in re.findall(r"\]\((?!http)([^)#]+)\)", README):
        assert (ROOT / target).exists(), target
