"""Pages in a real browser, where there is one: nothing reaches beyond a telephone; tables sort."""

from __future__ import annotations

import json
from pathlib import Path

import browser
import made_diagnoses as made
import pytest
from made_data import case

import crosscheck
from crosscheck.show.pictures import render

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(browser.browser() is None, reason="no Chromium or Chrome here"),
]
PHONE = 390


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    files = case(folder, {"pulley_radius": {"radius_m": 0.01}}, points=4)
    found = {
        "comparison": crosscheck.compare(*files),
        "plan": crosscheck.make_plan(*files),
        "diagnosis": made.pulleys(),
    }
    for name, result in found.items():
        (folder / f"{name}.html").write_text(render(result), encoding="utf-8")
    return folder


@pytest.mark.parametrize("name", ["comparison", "plan", "diagnosis"])
def test_nothing_reaches_beyond_a_telephone(pages: Path, name: str) -> None:
    size = browser.measure(pages / f"{name}.html", PHONE)
    assert size.wide == [] and size.width == PHONE
    assert size.moved == [], "tables end beyond the screen"
    assert size.height > 1000, "the page is not there"


def test_what_is_too_wide_is_seen(tmp_path: Path) -> None:
    page = tmp_path / "wide.html"
    page.write_text('<body><p>fits</p><p style="width: 700px">wide</p></body>')
    size = browser.measure(page, PHONE)
    assert size.width > 700 and len(size.wide) == 1 and "700px" in size.wide[0]


def test_a_picture_is_dark_where_the_reader_is(pages: Path, tmp_path: Path) -> None:
    from PIL import Image

    corners = []
    for dark in (False, True):
        path = tmp_path / f"{dark}.png"
        browser.shoot(pages / "plan.html", path, PHONE, dark=dark, height=300)
        with Image.open(path) as taken:
            assert taken.size == (PHONE, 300)
            corners.append(taken.getpixel((2, 2)))
    assert corners[0] == (255, 255, 255) and max(corners[1]) < 64


@pytest.mark.parametrize("dark", [False, True])
def test_what_goes_on_to_the_right_has_a_shadow_there(tmp_path: Path, dark: bool) -> None:
    """A table that is all there has none."""
    from PIL import Image

    style = (Path(browser.__file__).parents[1] / "crosscheck/show/page.css").read_text()
    tables = "".join(
        '<div class="scrolls"><table style="margin: 0"><tr><td>cable1</td>'
        f'<td><div style="width: {wide}px; height: 100px"></div></td></tr></table></div>'
        for wide in (900, 100)
    )
    page, picture = tmp_path / "tables.html", tmp_path / "tables.png"
    page.write_text(f"<!DOCTYPE html><style>{style}</style><main>{tables}</main>")
    browser.shoot(page, picture, PHONE, dark=dark, height=300)
    with Image.open(picture) as taken:
        paper, goes_on, ends = (taken.getpixel((x, y)) for x, y in ((5, 5), (375, 60), (375, 180)))
    assert ends == paper and abs(goes_on[0] - paper[0]) > 20


CLICKED = """<script>document.querySelector("a[href^='#glossary-']").click(); setTimeout(() => {
  document.title = [document.querySelector("#glossary").open, scrollY > 500];
}, 100);</script></body>"""


def test_a_word_that_is_clicked_is_explained(pages: Path) -> None:
    text = (pages / "diagnosis.html").read_text(encoding="utf-8")
    clicked = pages / "explained.html"
    clicked.write_text(text.replace("</body>", CLICKED), encoding="utf-8")
    assert browser.title(clicked) == "true,true"


SORTED = """
const table = document.querySelector("table.sorts");
const read = () => [...table.tBodies[0].rows].map((row) => row.cells[CELL].innerText);
const head = table.tHead.rows[0].cells[CELL], seen = [];
for (let i = 0; i < 2; i++) {
  head.querySelector("button").click();
  seen.push([head.getAttribute("aria-sort"), read()]);
}
document.title = JSON.stringify(seen);
"""


def sorted_by(page: Path, cell: int) -> list[tuple[str, list[str]]]:
    """What a column holds after one click on its head, and after two."""
    text = page.read_text(encoding="utf-8")
    script = f"<script>{SORTED.replace('CELL', str(cell))}</script></body>"
    clicked = page.with_name("clicked.html")
    clicked.write_text(text.replace("</body>", script), encoding="utf-8")
    found: list[tuple[str, list[str]]] = json.loads(browser.title(clicked))
    return found


def number(text: str) -> float:
    return float(text.replace("−", "-"))


def test_tables_sort_by_number_and_by_word_and_back(pages: Path) -> None:
    up, down = sorted_by(pages / "comparison.html", 1)
    assert (up[0], down[0]) == ("ascending", "descending")
    assert len(up[1]) > 5 and down[1] == sorted(up[1], key=number)[::-1]
    assert up[1] == sorted(up[1], key=number)
    words, _ = sorted_by(pages / "plan.html", 0)
    assert words[1] == sorted(words[1])


def test_cells_without_a_number_stay_below(tmp_path: Path, pages: Path) -> None:
    script = (pages / "plan.html").read_text(encoding="utf-8").split("<script>")[1]
    cells = ["± 10", "–", "< 9", "-1e-3", "", "2 %"]
    rows = "".join(f"<tr><td>{cell}</td></tr>" for cell in cells)
    page = tmp_path / "toy.html"
    page.write_text(
        '<meta charset="utf-8"><body><table class="sorts"><thead><tr><th>n</th></tr></thead>'
        f"<tbody>{rows}</tbody></table><script>{script}",
        encoding="utf-8",
    )
    up, down = sorted_by(page, 0)
    assert up[1] == ["-1e-3", "2 %", "< 9", "± 10", "–", ""]
    assert down[1] == ["± 10", "< 9", "2 %", "-1e-3", "–", ""]
