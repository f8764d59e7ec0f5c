"""Results as self-contained pages, with their figures inside."""

from __future__ import annotations

from operator import attrgetter
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from crosscheck.comparison.result import Comparison
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.planning.result import Plan
from crosscheck.show import blocks, comparison, diagnosis, plan
from crosscheck.show.blocks import Bar, Cell, Page, Styled, Words, pieces
from crosscheck.show.glossary import with_glossary
from seecr.files import Made, write_text
from seecr.version import full_version

_TAGS = {
    blocks.Code: Markup("<code>{}</code>"),
    blocks.Bold: Markup("<b>{}</b>"),
    blocks.Small: Markup("<small>{}</small>"),
    blocks.Whole: Markup('<span class="whole">{}</span>'),
    blocks.Dot: Markup('<span class="key" style="background: {}"></span>'),
    blocks.Below: Markup('<br><span class="plain">{}</span>'),
}
_BAR = Markup(
    '<span class="whole"><span class="bar"><i style="width: {:.1f}%"></i></span>{}</span>'
)
_MIDDLE = Markup('<span class="middle"><i style="{}: 50%; width: {:.1f}%"></i></span>')


def write_page(
    found: Comparison | Diagnosis | Plan, path: str | Path, made: Made | None = None
) -> None:
    """Write a result as one self-contained page; how it came about stands at the page's foot.

    Raises:
        InputFileError: the file cannot be written.
    """
    write_text(Path(path), render(found, made), failure="cannot write the page")


def render(found: Comparison | Diagnosis | Plan, made: Made | None = None) -> str:
    """The page's text."""
    environment = Environment(
        loader=PackageLoader("crosscheck.show", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    kind = attrgetter("__class__.__name__")
    environment.filters |= {"html": _html, "cell": _cell, "kind": kind}
    page = environment.get_template("page.html.jinja").render(
        page=page_of(found), version=full_version(), made="" if made is None else made.words
    )
    return with_glossary(page.lstrip())


def page_of(found: Comparison | Diagnosis | Plan) -> Page:
    """The page of a result, with its figures drawn."""
    if isinstance(found, Diagnosis):
        return diagnosis.page_of_diagnosis(found)
    if isinstance(found, Plan):
        return plan.page_of_plan(found)
    return comparison.page_of_comparison(found)


def _html(words: Words) -> Markup:
    """Words with their tags; what users wrote stays text."""
    return Markup("").join(
        _TAGS[type(one)].format(str(one)) if type(one) in _TAGS else escape(str(one))
        for one in pieces(words)
    )


def _cell(cell: Cell) -> Markup:
    if cell is None:
        return Markup("–")
    if isinstance(cell, Bar):
        size = 100.0 * abs(cell.part)
        if cell.middle:
            return _MIDDLE.format("left" if cell.part >= 0 else "right", 0.5 * size)
        return _BAR.format(size, cell.words)
    if isinstance(cell, Styled):
        return Markup('<span class="{}">{}</span>').format(cell.style, cell.words)
    return _html(cell)
