"""Results as pages that need nothing else: one writer for all of them."""

from __future__ import annotations

from pathlib import Path

from crosscheck.comparison.result import Comparison
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.planning.result import Plan
from crosscheck.report.comparison import comparison_context
from crosscheck.report.diagnosis import diagnosis_context
from crosscheck.report.page import page_of
from crosscheck.report.plan import plan_context
from seecr.files import Made, write_text


def write_page(
    found: Comparison | Diagnosis | Plan, path: str | Path, made: Made | None = None
) -> None:
    """Write a result as one self-contained page.

    Args:
        found: the result.
        path: the ``.html`` file; a temporary one takes its place when complete.
        made: how it came about, for the page's foot.

    Raises:
        InputFileError: the file cannot be written.
    """
    write_text(Path(path), render(found, made), failure="cannot write the page")


def render(found: Comparison | Diagnosis | Plan, made: Made | None = None) -> str:
    """The page's text."""
    if isinstance(found, Diagnosis):
        return page_of("diagnosis.html.jinja", made, **diagnosis_context(found))
    if isinstance(found, Plan):
        return page_of("plan.html.jinja", made, **plan_context(found))
    return page_of("comparison.html.jinja", made, **comparison_context(found))
