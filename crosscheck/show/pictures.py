"""Figures, pages and recordings of results, as their own methods give them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from crosscheck.comparison.result import Comparison
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.planning.result import Plan
from crosscheck.show.figures import collecting
from crosscheck.show.page import page_of, write_page
from crosscheck.show.study import study_figure
from crosscheck.studies.study import Study
from crosscheck.suite.results import CaseResult
from crosscheck.suite.run import Run
from seecr.counted import counted
from seecr.errors import InputError
from seecr.show.pictures import Pictures


def _figure_of(found: Comparison | Diagnosis | Plan, name: str) -> Any:
    """A figure of the result's page by the name that --figures gives its file; the first for ""."""
    with collecting() as drawn:
        page_of(found)
    if not drawn:
        raise InputError("nothing can be drawn: without readings or a verdict a page has no figure")
    if name and name not in drawn:
        raise InputError(f"no figure {name!r}; there are {', '.join(drawn)}")
    return drawn[name or next(iter(drawn))]


def _record_comparison(found: Comparison, path: Any) -> None:
    from crosscheck.show.error_recordings import write_comparison_recording

    write_comparison_recording(found, path)


def _record_diagnosis(found: Diagnosis, path: Any) -> None:
    from crosscheck.show.error_recordings import write_diagnosis_recording

    write_diagnosis_recording(found, path)


def _record_case(found: CaseResult, path: Any) -> None:
    from crosscheck.show.case_recording import write_case_recording

    write_case_recording(found, path)


def _record_run(found: Run, path: Any) -> None:
    if len(found.results) != 1:
        raise InputError(
            f"a recording is of one case, and this run has {counted(len(found.results), 'case')}; "
            "run.results[0].save_recording(path) writes that of the first"
        )
    _record_case(found.results[0], path)


PICTURES: Mapping[type, Pictures] = {
    Comparison: Pictures(_figure_of, write_page, _record_comparison),
    Diagnosis: Pictures(_figure_of, write_page, _record_diagnosis),
    Plan: Pictures(_figure_of, write_page),
    Study: Pictures(plot=lambda found, _name: study_figure(found, None)),
    CaseResult: Pictures(recording=_record_case),
    Run: Pictures(recording=_record_run),
}
"""By the class of result."""
