"""The suite's results as ``junit.xml``, which continuous integration shows as tests."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from typing import TYPE_CHECKING

from crosscheck.suite import effect_words as effect_figures
from crosscheck.suite import words as figures
from crosscheck.suite.effect_suite import GROUP
from crosscheck.suite.run import EXIT_DIFFERS, EXIT_UNSOLVED

if TYPE_CHECKING:
    from crosscheck.suite.effect_suite import EffectResult
    from crosscheck.suite.results import Run
    from crosscheck.suite.run import CaseResult

# Characters that XML 1.0 cannot hold at all, escaped or not.
_FORBIDDEN = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def junit_xml(run: Run) -> str:
    """One test case a case of the suite; differences are failures, unsolved poses errors.

    Poses and effects are a suite each, where there are any.
    """
    both: list[CaseResult | EffectResult] = [*run.results, *run.effects]
    root = ET.Element("testsuites", {"name": "crosscheck run", **_counts(both, run.wall_s)})
    if run.results:
        counts = _counts(run.results, run.wall_s)
        suite = ET.SubElement(root, "testsuite", {"name": "crosscheck run", **counts})
        for result in run.results:
            _add_case(suite, result)
    if run.effects:
        counts = _counts(run.effects, sum(effect.wall_s for effect in run.effects))
        suite = ET.SubElement(root, "testsuite", {"name": GROUP, **counts})
        for effect in run.effects:
            _add_effect(suite, effect)
    ET.indent(root)
    return ET.tostring(root, encoding="utf-8", xml_declaration=True).decode() + "\n"


def _counts(results: Sequence[CaseResult | EffectResult], seconds: float) -> dict[str, str]:
    statuses = [result.exit_status for result in results]
    return {
        "tests": str(len(statuses)),
        "failures": str(statuses.count(EXIT_DIFFERS)),
        "errors": str(statuses.count(EXIT_UNSOLVED)),
        "time": f"{seconds:.3f}",
    }


def _add_effect(suite: ET.Element, result: EffectResult) -> None:
    case = ET.SubElement(
        suite,
        "testcase",
        classname=f"crosscheck.{GROUP}",
        name=_clean(result.task.name),
        time=f"{result.wall_s:.3f}",
    )
    text = _clean(effect_figures.text(result))
    tag = {EXIT_DIFFERS: "failure", EXIT_UNSOLVED: "error"}.get(result.exit_status)
    if tag is not None:
        message = f"{_clean(result.task.name)}: {text}"
        ET.SubElement(case, tag, message=message, type=tag).text = message
    ET.SubElement(case, "system-out").text = text


def _add_case(suite: ET.Element, result: CaseResult) -> None:
    case = ET.SubElement(
        suite,
        "testcase",
        classname="crosscheck",
        name=_clean(result.case.name),
        time=f"{result.wall_s:.3f}",
    )
    tag = {EXIT_DIFFERS: "failure", EXIT_UNSOLVED: "error"}.get(result.exit_status)
    if tag is not None:
        lines = figures.failures(result)
        message = f"{result.case.name}: {figures.remarks(result)}"
        bad = ET.SubElement(case, tag, message=_clean(message), type=tag)
        bad.text = _clean("\n".join(lines))
    ET.SubElement(case, "system-out").text = _clean("\n".join(_report(result)))


def _report(result: CaseResult) -> list[str]:
    lines = [
        f"{figures.NAMES[name]}: {worst.value:.3e}, allowed {worst.allowed:.3e}, pose {worst.pose}"
        for name, worst in result.worst.items()
    ]
    return [*lines, *figures.findings(result), *figures.widened(result)]


def _clean(text: str) -> str:
    return _FORBIDDEN.sub("\ufffd", text)
