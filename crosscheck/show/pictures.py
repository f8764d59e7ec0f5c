"""Pages, figures and recordings of results, as commands and their own methods give them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from crosscheck.comparison.result import Comparison
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.planning.result import Plan
from crosscheck.show import blocks
from crosscheck.show.blocks import Bar, Cell, Page, Styled, Words, pieces
from crosscheck.show.comparison import page_of_comparison
from crosscheck.show.diagnosis import page_of_diagnosis
from crosscheck.show.figures import collecting
from crosscheck.show.glossary import Linker
from crosscheck.show.plan import page_of_plan
from crosscheck.show.study import study_figure
from crosscheck.studies.study import Study
from crosscheck.suite.results import CaseResult
from crosscheck.suite.run import Run
from seecr.counted import counted
from seecr.errors import InputError
from seecr.files import Made, write_text
from seecr.show.pictures import Pictures
from seecr.version import full_version

WithPage: TypeAlias = Comparison | Diagnosis | Plan
"""A result that has a page."""
_PAGES: dict[type, Callable[[Any], Page]] = {
    Comparison: page_of_comparison, Diagnosis: page_of_diagnosis, Plan: page_of_plan,
}  # fmt: skip

# --- pages ----------------------------------------------------------------------------------------

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


# Where words of the glossary are not linked: there they stand for themselves.
_UNLINKED = (blocks.Code, blocks.Bold, blocks.Small)


def write_page(found: WithPage, path: str | Path, made: Made | None = None) -> None:
    """Write a result as one self-contained page; how it came about stands at the page's foot.

    Raises:
        InputFileError: the file cannot be written.
    """
    write_text(Path(path), render(found, made), failure="cannot write the page")


def render(found: WithPage, made: Made | None = None) -> str:
    """The page's text."""
    environment = Environment(
        loader=PackageLoader("crosscheck.show", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    glossary = Linker()
    environment.filters |= {
        "html": _html, "cell": _cell, "kind": lambda block: type(block).__name__,
        "running": lambda words: _html(words, glossary),
    }  # fmt: skip
    page = environment.get_template("page.html.jinja").render(
        page=_PAGES[type(found)](found), version=full_version(),
        made="" if made is None else made.words, glossary=glossary,
    )  # fmt: skip
    return page.lstrip()


def _html(words: Words, glossary: Linker | None = None) -> Markup:
    """Words with their tags; what users wrote stays text. Running text has a glossary."""
    out = Markup()
    for one in pieces(words):
        linked = glossary is not None and not isinstance(one, _UNLINKED)
        text = glossary.linked(str(one)) if glossary and linked else escape(str(one))
        out += _TAGS[type(one)].format(text) if type(one) in _TAGS else text
    return out


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


# --- what draws which result ----------------------------------------------------------------------


def _figure_of(found: WithPage, name: str) -> Any:
    """A figure of the result's page by the name that --figures gives its file; the first for ""."""
    with collecting() as drawn:
        _PAGES[type(found)](found)
    if not drawn:
        raise InputError("nothing can be drawn: without readings or a verdict a page has no figure")
    if name and name not in drawn:
        raise InputError(f"no figure {name!r}; there are {', '.join(drawn)}")
    return drawn[name or next(iter(drawn))]


def _record(found: Comparison | Diagnosis | CaseResult, path: Any) -> None:
    from crosscheck.show import case_recording, error_recordings

    if isinstance(found, Comparison):
        error_recordings.write_comparison_recording(found, path)
    elif isinstance(found, Diagnosis):
        error_recordings.write_diagnosis_recording(found, path)
    else:
        case_recording.write_case_recording(found, path)


def _record_run(found: Run, path: Any) -> None:
    if len(found.results) != 1:
        raise InputError(
            f"a recording is of one case, and this run has {counted(len(found.results), 'case')}; "
            "run.results[0].save_recording(path) writes that of the first"
        )
    _record(found.results[0], path)


PICTURES: Mapping[type, Pictures] = {
    Comparison: Pictures(_figure_of, write_page, _record),
    Diagnosis: Pictures(_figure_of, write_page, _record),
    Plan: Pictures(_figure_of, write_page),
    Study: Pictures(plot=lambda found, _name: study_figure(found, None)),
    CaseResult: Pictures(recording=_record),
    Run: Pictures(recording=_record_run),
}
"""By the class of result."""
