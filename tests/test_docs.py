"""Pages and pictures that are made from the sources are current, and what pages point to exists."""

from __future__ import annotations

import json
import re
from pathlib import Path

import draw_effects
import draw_floors
import link_words
import make_api
import make_commands
import make_effects
import numpy as np
import pytest

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
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\((?!http)([^)]+)\)", text):
        name, _, anchor = target.partition("#")
        other = page.parent / name if name else page
        assert other.exists(), target
        assert not anchor or anchor in anchors(other.read_text(encoding="utf-8")), target


@pytest.mark.parametrize("page", link_words.PAGES, ids=lambda p: p.name)
def test_words_of_the_glossary_are_linked_where_a_page_first_uses_them(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    if page.name != "glossary.md":
        assert link_words.with_links(text) == text, "run: python scripts/link_words.py"


def test_a_word_without_its_link_is_seen() -> None:
    once = "On `held-out runs`, and on [held-out\nruns](glossary.md); held-out runs."
    assert link_words.with_links(once.replace("[", "").replace("](glossary.md)", "")) == once
    assert link_words.with_links(once) == once


def test_the_page_about_effects_is_current() -> None:
    page = make_effects.PAGE.read_text(encoding="utf-8")
    assert make_effects.with_tables(page) == page, AGAIN
    assert all(f"| `{effect.name}` |" in page for effect in BUILT_IN)
    assert all(f"| `{name}` |" in page for name in QUANTITIES)


def test_the_pictures_of_effects_are_current() -> None:
    """By their numbers: drawn lines differ in the last digit from machine to machine."""
    folder = draw_effects.FOLDER
    drawn = json.loads(draw_effects.NUMBERS.read_text(encoding="utf-8"))
    for name, now in draw_effects.numbers().items():
        assert drawn[name].keys() == now.keys(), AGAIN
        for key, value in now.items():
            same = value == drawn[name][key]
            assert same or value == pytest.approx(drawn[name][key], rel=2e-3, abs=1e-4), AGAIN
    pictures = {path.stem: path.stat().st_size for path in folder.glob("*.svg")}
    assert pictures.keys() == drawn.keys() == {effect.name for effect in BUILT_IN}
    assert max(pictures.values()) < 30_000


def numbers_beside_axes(svg: str) -> list[list[float]]:
    """What the ticks of each axis of a drawing say, in their order."""
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
    return list(said.values())


def evenly_spaced(values: list[float]) -> bool:
    steps = np.diff(values)
    return len(values) > 1 and steps.min() > 0.0 and np.allclose(steps, steps[0], 1e-6)


def test_axes_of_the_pictures_of_effects_have_evenly_spaced_numbers() -> None:
    for path in draw_effects.FOLDER.glob("*.svg"):
        every = numbers_beside_axes(path.read_text(encoding="utf-8"))
        assert len(every) in (2, 4) and all(map(evenly_spaced, every)), f"{path.name}: {AGAIN}"


def test_small_changes_keep_the_digits_of_their_axis() -> None:
    x = np.linspace(0.2, 0.6, draw_effects.COUNT)
    x = np.concatenate([x, x[-2::-1]])
    small = 5e-6 * np.stack([x, -x, x**2], axis=1)
    change = draw_effects.Change(BUILT_IN[0](), "demobot_cogiro", 1.0, x, small, small, small)
    svg = draw_effects.picture(change)
    # the names of clips and markers are counted: Matplotlib's own come from unrounded places
    assert set(re.findall(r"#([^)\"]+)", svg)) >= {f"{BUILT_IN[0].name}-{k}" for k in (1, 2)}
    assert re.search(r"#[mpC][0-9a-f]{10}\b", svg) is None
    every = numbers_beside_axes(svg)
    assert len(every) == 4 and all(map(evenly_spaced, every))


def test_the_page_of_public_names_is_current() -> None:
    assert make_api.page() == make_api.PAGE.read_text(encoding="utf-8"), AGAIN


def test_the_page_of_names_shows_what_a_method_takes() -> None:
    page = make_api.PAGE.read_text(encoding="utf-8")
    assert "- `.count(verdict: Verdict) -> int`: " in page
    assert "- `.fixed(*names: str) -> Term`: " in page
    assert "\nJoint(kind: str, name: str, axis: Array, point: Array)\n" in page


def test_one_line_of_a_docstring_may_explain_several_names() -> None:
    words = "Args:\n    a: the first. b, c: others,\n        further down.\n    d: a last: one."
    shown = "- `a`: the first.\n- `b`, `c`: others, further down.\n- `d`: a last: one.\n"
    assert list(make_api.as_markdown(words, "abcd")) == [shown]
    assert list(make_api.as_markdown("Returns:\n    a :class:`X`,\n    or none.", "")) == [
        "Returns: a `X`, or none.\n"
    ]


def test_the_page_of_commands_is_current() -> None:
    page = make_commands.PAGE.read_text(encoding="utf-8")
    assert make_commands.page() == page, AGAIN
    assert "\n### crosscheck diagnose\n" in page and "\n### seecr correct\n" in page
    assert "| `--max-position 0.5mm` | Limit on the rms position error. |" in page


def test_the_page_of_public_names_has_them_all() -> None:
    page = make_api.PAGE.read_text(encoding="utf-8")
    for face in (crosscheck, seecr):
        assert all(f"\n### {face.__name__}.{name}\n" in page for name in face.__all__)
    assert " at 0x" not in page


def test_the_picture_of_the_floors_is_current() -> None:
    assert draw_floors.picture() == draw_floors.PICTURE.read_text(encoding="utf-8"), AGAIN


def test_the_picture_shows_each_room_and_no_detours() -> None:
    assert draw_floors.without_detours(
        {
            "top": frozenset({"middle", "ground"}),
            "middle": frozenset({"ground"}),
            "ground": frozenset(),
        }
    ) == {"top": {"middle"}, "middle": {"ground"}, "ground": set()}
    drawn = draw_floors.picture()
    names = {name.split(".")[1] for name in draw_floors.FLOORS}
    assert all(re.search(rf">{name}/?</text>", drawn) for name in names)


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
