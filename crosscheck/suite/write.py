"""Writes the reports of a run into a folder."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

from crosscheck.suite.agreement import thresholds_toml
from crosscheck.suite.effects import (
    EFFECT_HEADS,
    GROUP,
    EffectResult,
    against_line,
    effect_cells,
    effect_failures,
    effect_text,
    effects_line,
)
from crosscheck.suite.results import (
    QUANTITY_NAMES,
    TABLE_HEADS,
    CaseResult,
    case_cells,
    failure_lines,
    finding_lines,
    remarks,
    widened_lines,
    worst_of,
)
from crosscheck.suite.run import Run, results_json, threshold_cells, verdict_line
from crosscheck.suite.verdicts import FINDINGS, UNSOLVED, Outcome, Verdict
from seecr.description.passive import write_pull
from seecr.description.robot import Robot
from seecr.errors import InputError, InputFileError
from seecr.files import path_of, write_text, written
from seecr.pose import Array

# The suite's results as `junit.xml`, which continuous integration shows as tests.

# Characters that XML 1.0 cannot hold, escaped or not.
_FORBIDDEN = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


_TAGS = {Outcome.DIFFER: "failure", Outcome.NOT_CONVERGED: "error"}


def junit_xml(run: Run) -> str:
    """One test case per case of the suite; differences are failures, unsolved poses errors.

    Poses and effects are separate test suites, if there are any.
    """
    name, of_effects = "crosscheck run", sum(effect.wall_s for effect in run.effects)
    root = ET.Element("testsuites", {"name": name, **_counts(run.every, run.wall_s)})
    for kind, group, results, seconds in (
        (name, "crosscheck", run.results, run.wall_s),
        (GROUP, f"crosscheck.{GROUP}", run.effects, of_effects),
    ):
        if results:
            suite = ET.SubElement(root, "testsuite", {"name": kind, **_counts(results, seconds)})
            for result in results:
                _add(suite, group, result)
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


def _add(suite: ET.Element, group: str, result: CaseResult | EffectResult) -> None:
    """A test case: what was found, and, unless both sides agree, what is wrong."""
    name, seconds = result.case.name, f"{result.wall_s:.3f}"
    case = ET.SubElement(suite, "testcase", classname=group, name=_clean(name), time=seconds)
    if isinstance(result, CaseResult):
        message, wrong = remarks(result), failure_lines(result)
        found = [
            f"{QUANTITY_NAMES[key]}: {one.value:.3e}, allowed {one.allowed:.3e}, pose {one.pose}"
            for key, one in result.worst.items()
        ]
        found += [*finding_lines(result), *widened_lines(result)]
    else:
        message = effect_text(result)
        wrong, found = [f"{name}: {message}"], [message]
    tag = _TAGS.get(result.outcome)
    if tag is not None:
        said = _clean(f"{name}: {message}")
        ET.SubElement(case, tag, message=said, type=tag).text = _clean("\n".join(wrong))
    ET.SubElement(case, "system-out").text = _clean("\n".join(found))


def _clean(text: str) -> str:
    return _FORBIDDEN.sub("\ufffd", text)


# The suite's results as `summary.md`, for the step summary of continuous integration.


def summary_md(run: Run, worst_pose: str) -> str:
    """The verdict, a table of the cases, then failures, findings, widened thresholds, effects.

    Args:
        run: the run.
        worst_pose: sentence about the file with the worst pose.
    """
    parts = ["# SEECR against MuJoCo", verdict_line(run)]
    if run.results:
        parts += _cases(run, worst_pose)
    parts += [f"Note: {note}." for note in run.notes]
    if run.effects:
        parts += _effects(run)
    parts.append(
        f"{run.wall_s:.1f} s with {run.jobs} at a time; random numbers of seed {run.seed}."
    )
    return "\n\n".join(parts) + "\n"


def _cases(run: Run, worst_pose: str) -> list[str]:
    parts = [
        _table(TABLE_HEADS, [*map(case_cells, run.results), threshold_cells(run)], words=1),
        "Largest differences between SEECR and MuJoCo over each case's poses. `settled`: MuJoCo "
        "brought to rest by its own dynamics; `polished` and tensions: after Newton's method on "
        f"its inverse dynamics. Times are per pose, on one processor. {worst_pose}",
    ]
    parts += _section(run, "Failures", failure_lines)
    parts += _section(run, "Findings", finding_lines)
    parts += _section(run, "Widened thresholds", widened_lines)
    return parts


def _effects(run: Run) -> list[str]:
    """How the effects ended, which failed, and a folded table of all."""
    table = _table(EFFECT_HEADS, map(effect_cells, run.effects), words=2)
    failed = [f"- {line}" for line in effect_failures(run.effects)]
    return [
        "## Effects",
        effects_line(run.effects),
        against_line(run.effects),
        *(["\n".join(failed)] if failed else []),
        f"<details><summary>All {len(run.effects)}</summary>\n\n{table}\n\n</details>",
    ]


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]], words: int) -> str:
    """A table whose columns are numbers, but for so many at the left and two at the right."""
    rule = [*["---"] * words, *["---:"] * (len(heads) - words - 2), "---", "---"]
    return "\n".join(_row(row) for row in (heads, rule, *rows))


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _section(run: Run, title: str, lines: Callable[[CaseResult], list[str]]) -> list[str]:
    """A heading and, case by case, folded lists; empty if there are no items."""
    found = [(result, lines(result)) for result in run.results]
    blocks = [
        f"<details><summary>{result.case.name}: {len(items)}</summary>\n\n"
        + "\n".join(f"- {item}" for item in items)
        + "\n\n</details>"
        for result, items in found
        if items
    ]
    return [f"## {title}", *blocks] if blocks else []


# The pose of a run that deserves a look in MuJoCo's viewer, as an MJCF with a keyframe.

KEYFRAME = "worst"
FILE_NAME = "worst_pose.xml"


def worst_pose(results: Sequence[CaseResult]) -> tuple[CaseResult, int]:
    """The case and pose farthest beyond its thresholds; else an unsolved one; else the nearest."""
    worst = worst_of(results)
    if worst is None or worst[1].ratio <= 1.0:
        for kinds in ((Verdict.DIFFERS, *FINDINGS), UNSOLVED):
            for result in results:
                poses = [one.pose for one in result.findings if one.fails and one.verdict in kinds]
                if poses:
                    return result, poses[0]
    if worst is None:
        return results[0], 0
    return worst[0], worst[1].pose


def write_worst_pose(results: Sequence[CaseResult], folder: Path) -> str:
    """Write its MJCF into a folder; returns a sentence about what it shows."""
    result, i = worst_pose(results)
    mujoco, settling = result.case.settler(), result.settling[i]
    qpos, state = settling.qpos, "as MuJoCo found it at rest"
    if not settling.settled:
        mujoco.physics.place(result.case.poses[i])
        qpos, state = mujoco.physics.data.qpos, "as commanded, since MuJoCo did not settle"
    lengths, source = result.mujoco_rest_lengths[i], result.case.mujoco_model
    try:
        write_worst_pose_mjcf(source, qpos, lengths, mujoco.ea, folder / FILE_NAME, result.robot)
    except InputFileError as error:  # a robot in several files can be run, but not rewritten
        return f"There is no `{FILE_NAME}`: {error}."
    return f"`{FILE_NAME}` opens in MuJoCo's viewer at pose {i} of {result.case.name}, {state}."


def write_worst_pose_mjcf(
    model_path: str | Path, qpos: Array, rest_lengths: Array, ea: Array, path: str | Path,
    robot: Robot | None = None,
) -> None:  # fmt: skip
    """Copy an MJCF with other rest lengths and stiffnesses, and a keyframe ``worst``.

    The XML tree is edited, since MuJoCo's own writer keeps six digits only, which moves the
    platform by half a micrometre. An ``<include>`` stays, with an absolute path; a robot whose
    tendons are in another file is therefore refused.

    Args:
        model_path: the robot's MJCF.
        qpos: (nq,) MuJoCo's coordinates of the pose.
        rest_lengths: (m,) [m].
        ea: (m,) [N].
        path: the file to write, through a temporary one.
        robot: which of its lines push, or pull with a constant force; none without it.

    Raises:
        InputFileError: the MJCF cannot be read, or does not itself have m tendons.
    """
    model_path, path = Path(model_path), Path(path)
    try:
        tree = ET.parse(model_path)
    except (OSError, ET.ParseError) as error:
        raise InputFileError(f"{model_path}: cannot read this as XML: {error}") from None
    root = tree.getroot()
    _set_springs(root, np.asarray(rest_lengths, float), np.asarray(ea, float), model_path, robot)
    _make_paths_absolute(root, model_path.resolve().parent)
    for old in root.findall("keyframe"):
        root.remove(old)  # MuJoCo opens the first keyframe; it has to be this one
    ET.SubElement(ET.SubElement(root, "keyframe"), "key", name=KEYFRAME, qpos=_numbers(qpos))
    ET.indent(tree)
    with written(path, failure="cannot write the MJCF") as (partial,):
        tree.write(partial, encoding="utf-8")


def _set_springs(
    root: ET.Element, rest_lengths: Array, ea: Array, path: Path, robot: Robot | None
) -> None:
    """Give tendons their rest lengths (m,) [m] and E S (m,) [N], or let a constant force pull."""
    tendons = root.findall("tendon/spatial")
    if len(tendons) != len(rest_lengths):
        raise InputFileError(
            f"{path}: expected {len(rest_lengths)} <spatial> tendons in the file itself, got "
            f"{len(tendons)}; put included tendons into it"
        )
    for i, (tendon, rest, stiff) in enumerate(zip(tendons, rest_lengths, ea, strict=True)):
        pushes = robot is not None and robot.pushes[i]
        tendon.set("springlength", _numbers([rest] if pushes else [0.0, rest]))
        tendon.set("stiffness", repr(float(stiff / rest)))
        if robot is not None and robot.constant_tension_N[i] > 0.0:
            tendon.set("name", robot.cable_names[i])
            tendon.set("stiffness", "0")
            write_pull(root, robot.cable_names[i], float(robot.constant_tension_N[i]))


def _make_paths_absolute(root: ET.Element, folder: Path) -> None:
    """Make paths of meshes, textures and includes independent of the file's folder."""
    for include in root.iter("include"):
        include.set("file", str(folder / include.get("file", "")))
    compilers = root.findall("compiler")
    assets = [a for a in root.iter() if a.tag in _ASSETS and a.get("file")]
    if not assets:
        return
    compiler = compilers[0] if compilers else ET.SubElement(root, "compiler")
    for name in ("assetdir", "meshdir", "texturedir"):
        own = compiler.get(name)
        if own is not None or (name == "assetdir"):
            compiler.set(name, str(folder / (own or "")))


_ASSETS = {"mesh", "texture", "hfield", "skin", "model"}


def _numbers(values: Iterable[float]) -> str:
    return " ".join(repr(float(v)) for v in values)


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

    Example:
        ``crosscheck.write_run(crosscheck.run_suite(crosscheck.shipped_cases()[:1]), "run")``
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
