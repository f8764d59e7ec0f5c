"""Pages, pictures and figures made from the sources are current; what pages point to exists."""

from __future__ import annotations

import json
import re
from pathlib import Path

import bench
import draw_effects
import draw_floors
import link_words
import make_api
import make_commands
import make_effects
import numpy as np
import pytest
import score

import crosscheck
import seecr
from seecr import __version__
from seecr.effects import BUILT_IN
from seecr.effects.setup import QUANTITIES

ROOT = Path(__file__).resolve().parents[1]
PAGES = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), ROOT / "models" / "README.md"]
AGAIN = "run: make docs"


def anchors(page: str) -> set[str]:
    """Names by which GitHub links a page's headings."""
    titles = re.findall(r"^#+ +(.*)$", page, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    """And the glossary's words are linked where a page first uses them."""
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\((?!http)([^)]+)\)", text):
        name, _, anchor = target.partition("#")
        other = page.parent / name if name else page
        assert other.exists(), target
        assert not anchor or anchor in anchors(other.read_text(encoding="utf-8")), target
    if page in link_words.PAGES and page.name != "glossary.md":
        assert link_words.with_links(text) == text, "run: python scripts/link_words.py"


def test_a_word_without_its_link_is_seen() -> None:
    once = "On `test runs`, and on [test\nruns](glossary.md); test runs."
    assert link_words.with_links(once.replace("[", "").replace("](glossary.md)", "")) == once
    assert link_words.with_links(once) == once


def test_the_page_about_effects_is_current() -> None:
    page = make_effects.PAGE.read_text(encoding="utf-8")
    assert make_effects.with_tables(page) == page, AGAIN
    assert all(f"| `{name}` |" in page for name in (*QUANTITIES, *(e.name for e in BUILT_IN)))


def test_the_page_of_commands_is_current() -> None:
    page = make_commands.PAGE.read_text(encoding="utf-8")
    assert make_commands.page() == page, AGAIN
    assert "\n### crosscheck diagnose\n" in page and "\n### seecr correct\n" in page
    assert "| `--max-position 0.5mm` | Limit on the rms position error. |" in page


def test_the_page_of_public_names_is_current_and_has_them_all() -> None:
    page = make_api.PAGE.read_text(encoding="utf-8")
    assert make_api.page() == page, AGAIN
    for face in (crosscheck, seecr):
        assert all(f"\n### {face.__name__}.{name}\n" in page for name in face.__all__)
    assert " at 0x" not in page
    # and what a method takes
    assert "- `.count(verdict: Verdict) -> int`: " in page
    assert "- `.fixed(*names: str) -> Term`: " in page
    assert "\nJoint(kind: str, name: str, axis: Array, point: Array, ball: bool = False)\n" in page


def test_the_picture_of_the_floors_is_current_and_shows_each_room() -> None:
    drawn = draw_floors.PICTURE.read_text(encoding="utf-8")
    assert draw_floors.picture() == drawn, AGAIN
    rooms = [name for line in draw_floors.TABLE for name in draw_floors.rooms_of(line)]
    assert all(re.search(rf">{name.partition('.')[2]}/?</text>", drawn) for name in rooms)


def test_the_pictures_of_effects_are_current() -> None:
    """By their numbers: drawn lines differ in the last digit from machine to machine."""
    drawn = json.loads(draw_effects.NUMBERS.read_text(encoding="utf-8"))
    for name, now in draw_effects.numbers().items():
        assert drawn[name].keys() == now.keys(), AGAIN
        for key, value in now.items():
            same = value == drawn[name][key]
            assert same or value == pytest.approx(drawn[name][key], rel=2e-3, abs=1e-4), AGAIN
    pictures = {path.stem: path for path in draw_effects.FOLDER.glob("*.svg")}
    assert pictures.keys() == drawn.keys() == {effect.name for effect in BUILT_IN}
    for path in pictures.values():
        assert path.stat().st_size < 30_000
        assert numbers_of_axes(path.read_text(encoding="utf-8")) in (2, 4), path.name


def numbers_of_axes(svg: str) -> int:
    """How many axes of a drawing have numbers; those of each are evenly spaced."""
    said: dict[str, list[float]] = {}
    axes, of = 0, ""
    for what, tick, words in re.findall(
        r'<g id="(?:(axes)|([xy])tick)_\d+">|<text [^>]*>([^<]*)</text>', svg
    ):
        axes += what == "axes"
        if what or tick:
            of = tick and f"{axes}{tick}"
        if words and of:
            said.setdefault(of, []).append(float(words.replace("−", "-")))
            of = ""
    for values in said.values():
        steps = np.diff(values)
        assert len(values) > 1 and steps.min() > 0.0 and np.allclose(steps, steps[0], 1e-6), AGAIN
    return len(said)


def test_small_changes_keep_the_digits_of_their_axis() -> None:
    x = np.linspace(0.2, 0.6, draw_effects.COUNT)
    x = np.concatenate([x, x[-2::-1]])
    small = 5e-6 * np.stack([x, -x, x**2], axis=1)
    change = draw_effects.Change(BUILT_IN[0](), "demobot_cogiro", 1.0, x, small, small, small)
    svg = draw_effects.picture(change)
    # the names of clips and markers are counted: Matplotlib's own come from unrounded places
    assert set(re.findall(r"#([^)\"]+)", svg)) >= {f"{BUILT_IN[0].name}-{k}" for k in (1, 2)}
    assert re.search(r"#[mpC][0-9a-f]{10}\b", svg) is None
    assert numbers_of_axes(svg) == 4


def test_the_citation_names_this_version_and_the_paper() -> None:
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {__version__}\n" in citation
    assert "10.1109/ICRA57147.2024.10610384" in citation


def test_tasks_are_listed() -> None:
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    listed = set(re.findall(r"^([a-z]+):.*##", text, re.MULTILINE))
    assert listed >= {"setup", "quick", "test", "bench", "docs", "suite", "ci"}
    for script in re.findall(r"scripts/\w+\.py", text):
        assert (ROOT / script).exists(), script


PAGE = (Path(__file__).parents[1] / "docs" / "robots.md").read_text(encoding="utf-8")
ROWS = [line for line in PAGE.splitlines() if line.startswith("| ") and " | from | " not in line]


def test_the_head_counts_the_rows() -> None:
    total, read, rest = map(int, re.findall(r"(?:the|:|and) (\d+) (?:robots|are|of)", PAGE)[:3])
    refused = [row for row in ROWS if "| refused |" in row]
    resting = [row for row in ROWS if "| rests, " in row]
    assert (total, read, rest) == (len(ROWS), len(ROWS) - len(refused), len(resting))
    assert (total, rest) >= (79, 45)


def test_whoever_does_not_rest_has_a_reason_and_the_others_agree_with_mujoco() -> None:
    """Two equilibria, which both physics confirm, are no disagreement."""
    for row in ROWS:
        *_cells, home, agreement, remark = (cell.strip() for cell in row.strip("|").split("|"))
        if home.startswith("rests"):
            agree, _of, poses = agreement.partition(";")[0].split()
            both = re.search(r"(\d+) two stable equilibria", agreement)
            assert int(agree) + (int(both[1]) if both else 0) == int(poses), row
        else:
            assert len(remark) > 20, row


DOCS = Path(__file__).resolve().parents[1] / "docs"


def test_the_page_quotes_the_figures() -> None:
    found = json.loads((DOCS / "figures.json").read_text(encoding="utf-8"))["diagnosis"]
    page = (DOCS / "diagnosis.md").read_text(encoding="utf-8")
    quoted = page.partition(f"{score.BEGIN}\n")[2].partition(f"\n{score.END}")[0]
    assert quoted == score.page_of(found), "run: make score"


def test_the_page_of_speed_is_that_of_the_figures() -> None:
    found = json.loads((DOCS / "figures.json").read_text(encoding="utf-8"))["speed"]
    page = (DOCS / "performance.md").read_text(encoding="utf-8")
    assert page == bench.page_of(found), "run: make bench"


@pytest.mark.parametrize(
    ("hidden", "named", "false"),
    [
        ("stiffness", [["platform_mass", "stiffness"]], 0),
        ("stiffness", [["platform_mass"]], 1),
        ("exit_friction", [["winch_side_length"]], 0),  # friction is on a cable behind the exit
        ("winch_side_length", [["exit_friction"]], 1),
    ],
)
def test_a_name_is_false_where_nothing_it_stands_for_is_hidden(
    hidden: str, named: list[list[str]], false: int
) -> None:
    row = {"hidden": {hidden: 8.0}, "named": named}
    assert len(score.false_names(row)) == false


def test_every_number_that_steers_says_where_it_comes_from() -> None:
    text = Path(score.priors.__file__).read_text(encoding="utf-8")
    names = re.findall(r"^([A-Z_, ]+) = ", text, re.MULTILINE)
    assert len([n for line in names for n in line.split(", ")]) <= 25
    assert len(re.findall(r'^"""', text, re.MULTILINE)) >= len(names)
