"""The suite's results as ``junit.xml``, which continuous integration shows as tests."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from typing import TYPE_CHECKING

from crosscheck.suite.effects import GROUP, effect_text
from crosscheck.suite.outcome import Outcome
from crosscheck.suite.results import (
    QUANTITY_NAMES,
    failure_lines,
    finding_lines,
    remarks,
    widened_lines,
)

if TYPE_CHECKING:
    from crosscheck.suite.effects import EffectResult
    from crosscheck.suite.results import CaseResult
    from crosscheck.suite.run import Run

# Characters that XML 1.0 cannot hold, escaped or not.
_FORBIDDEN = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


_TAGS = {Outcome.DIFFER: "failure", Outcome.NOT_CONVERGED: "error"}


def junit_xml(run: Run) -> str:
    """One test case per case of the suite; differences are failures, unsolved poses errors.

    Poses and effects are separate test suites, if there are any.
    """
    both: list[CaseResult | EffectResult] = [*run.results, *run.effects]
    root = ET.Element("testsuites", {"name": "crosscheck run", **_counts(both, run.wall_s)})
    if run.results:
        counts = _counts(run.results, run.wall_s)
        suite = ET.SubElement(root, "testsuite", {"name": "crosscheck run", **counts})
        for result in run.results:
            lines, found = failure_lines(result), _report(result)
            _add(
                suite, "crosscheck", result, remarks(result), "\n".join(lines),
                "\n".join(found),
            )  # fmt: skip
    if run.effects:
        counts = _counts(run.effects, sum(effect.wall_s for effect in run.effects))
        suite = ET.SubElement(root, "testsuite", {"name": GROUP, **counts})
        for effect in run.effects:
            said = effect_text(effect)
            wrong = f"{effect.case.name}: {said}"
            _add(suite, f"crosscheck.{GROUP}", effect, said, wrong, said)
    ET.indent(root)
    text: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return text.decode() + "\n"


def _counts(results: Sequence[CaseResult | EffectResult], seconds: float) -> dict[str, str]:
    outcomes = [result.outcome for result in results]
    return {
        "tests": str(len(outcomes)),
        "failures": str(outcomes.count(Outcome.DIFFER)),
        "errors": str(outcomes.count(Outcome.NOT_CONVERGED)),
        "time": f"{seconds:.3f}",
    }


def _add(
    suite: ET.Element, group: str, result: CaseResult | EffectResult, message: str, wrong: str,
    found: str,
) -> None:  # fmt: skip
    """A test case: what was found, and, unless both sides agree, what is wrong."""
    case = ET.SubElement(
        suite,
        "testcase",
        classname=group,
        name=_clean(result.case.name),
        time=f"{result.wall_s:.3f}",
    )
    tag = _TAGS.get(result.outcome)
    if tag is not None:
        said = _clean(f"{result.case.name}: {message}")
        ET.SubElement(case, tag, message=said, type=tag).text = _clean(wrong)
    ET.SubElement(case, "system-out").text = _clean(found)


def _report(result: CaseResult) -> list[str]:
    lines = [
        f"{QUANTITY_NAMES[name]}: {worst.value:.3e}, allowed {worst.allowed:.3e}, pose {worst.pose}"
        for name, worst in result.worst.items()
    ]
    return [*lines, *finding_lines(result), *widened_lines(result)]


def _clean(text: str) -> str:
    return _FORBIDDEN.sub("\ufffd", text)
