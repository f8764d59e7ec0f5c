"""Writes the reports of a run into a folder."""

from __future__ import annotations

from pathlib import Path

from crosscheck.suite.junit import junit_xml
from crosscheck.suite.run import Run, results_json
from crosscheck.suite.summary import summary_md
from crosscheck.suite.thresholds import thresholds_toml
from crosscheck.suite.worst_pose import write_worst_pose
from seecr.errors import InputError
from seecr.files import path_of, write_text

__all__ = ["RESULTS", "write_run"]

RESULTS = "results.json"


def write_run(run: Run, folder: str | Path) -> tuple[str, ...]:
    """Write what ``crosscheck run`` writes, but for recordings.

    Args:
        run: the result of :func:`crosscheck.run_suite`.
        folder: folder to write to; it is created if necessary.

    Returns:
        Names of the files.

    Raises:
        InputError: not a run, or not a folder's path.
    """
    if not isinstance(run, Run):
        raise InputError(f"expected a run, as run_suite returns it, got {type(run).__name__}")
    folder = path_of(folder, "a folder")
    folder.mkdir(parents=True, exist_ok=True)
    sentence = write_worst_pose(run.results, folder) if run.results else ""
    texts = {
        RESULTS: results_json(run),
        "junit.xml": junit_xml(run),
        "summary.md": summary_md(run, sentence),
        "thresholds.toml": thresholds_toml(run.thresholds),
    }
    for name, text in texts.items():
        write_text(folder / name, text)
    return tuple(texts)
