"""Write docs/robots.md: what becomes of the robots that CASPR and WireX publish.

    python scripts/make_robots.py CASPR/data/model_config WIREX/config/robots

Both folders are checkouts of other people's files, which are not in this repository. Each robot is
read, solved at its reference pose, and settled in MuJoCo along a sweep and at random poses; those
whose cables are slack at home for want of a load are tightened first.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from crosscheck import run_suite, user_cases
from crosscheck.suite.verdicts import Verdict
from seecr import Robot, SeecrError, Solution, correct, solve
from seecr.importing.caspr import read_caspr
from seecr.importing.draft import Draft
from seecr.importing.wirex import read_wirex
from seecr.show.pose_words import reason

PAGE = Path(__file__).resolve().parents[1] / "docs" / "robots.md"
# E S over the weight where a file says none, the tension that cables are tightened to [N], and the
# number of random poses for MuJoCo.
_STIFF, _PRETENSION, _RANDOM = 1000.0, 10.0, 50

_HEAD = """# Published robots

What becomes of the {total} robots that two other programs publish, if they are read by
`seecr new --from`: {read} are read, and {rest} of these come to rest at their reference pose, with
a certificate. The others are refused, or do not rest, for the reason in the last column. Written by
`scripts/make_robots.py` from [CASPR](https://github.com/darwinlau/CASPR) (`data/model_config`,
© 2017 Darwin Lau, BSD 3-Clause) and from
[WireX](https://gitlab.cc-asp.fraunhofer.de/wek/wirex) (`config/robots`, © 2006-2019 Andreas Pott,
MIT). Their files are not here; a few robots' numbers are, for tests, in
`tests/seecr/importing/published.toml`.

Where a file says no elasticity, E S is taken as 1000 times the weight (†). "10 N" marks robots that
no load stretches at the reference pose, made with `--pretension 10`. The platform's joints are
s(lides) and h(inges). MuJoCo's column counts the poses, along a sweep and at random, at which both
physics agree within the suite's thresholds, and says what the others are.
"""


def page(caspr: Path, wirex: Path) -> str:
    """The page's text."""
    bodies = sorted(path for path in caspr.rglob("*_bodies.xml") if "template" not in path.name)
    files = [*bodies, *sorted(wirex.glob("*.wcrfx"))]
    rows = [row for path in files for row in _row(path)]
    read = sum("refused" not in row for row in rows)
    rest = sum("| rests" in row for row in rows)
    head = _HEAD.format(total=len(rows), read=read, rest=rest)
    table = [
        "| robot | from | cables | platform | home pose | MuJoCo | remarks |",
        "|" + "---|" * 7,
    ]
    return "\n".join([head, *table, *rows, ""])


def _draft(path: Path) -> Draft:
    if path.suffix == ".wcrfx":
        return read_wirex(path)
    return read_caspr(path, path.with_name(path.name.replace("_bodies", "_cables")), None)


def _row(path: Path) -> Iterator[str]:
    name = path.stem.removesuffix("_bodies")
    source = "WireX" if path.suffix == ".wcrfx" else "CASPR"
    try:
        draft = _draft(path)
        unsaid = bool(np.isnan(draft.ea).any())
        ea = f"{_STIFF * 9.81 * (draft.mass or 1.0)}N"
        robot, _notes = (draft.with_options(ea=ea) if unsaid else draft).robot()
    except SeecrError as error:
        text = str(error).partition(": ")[2]
        yield f"| {name} | {source} | – | – | refused | – | {text} |"
        return
    robot, home, remark = _home(robot)
    kind = "".join(joint.kind[0] for joint in robot.joints) or "free"
    cells = f"{robot.n_cables}{'†' if unsaid else ''} | {kind}"
    yield f"| {name} | {source} | {cells} | {home} | {_agreement(robot)} | {remark} |"


def _home(robot: Robot) -> tuple[Robot, str, str]:
    """The robot, tightened if need be; how it ends at its reference pose; why it does not rest."""
    solution = solve(robot, robot.reference_pose)
    if solution.converged.all():
        return robot, f"rests, {_off(solution)}", ""
    if solution.slack.all():
        held = correct(robot, robot.reference_pose[None], lowest=_PRETENSION)
        if held.reached.all() and held.commands.lengths is not None:
            tight = replace(robot, rest_lengths=held.commands.lengths[0])
            if solve(tight, robot.reference_pose).converged.all():
                return tight, f"rests, {_PRETENSION:g} N", ""
        return robot, "does not rest", f"no load there, and {held.why_not[0]}"
    return robot, "does not rest", reason(solution)


def _off(solution: Solution) -> str:
    return f"{1e3 * np.linalg.norm(solution.deviation[0, :3]):.3g} mm off"


def _agreement(robot: Robot) -> str:
    """At how many poses MuJoCo agrees, and what the others are."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot.xml"
        robot.save(path)
        results = run_suite(user_cases(path, n_random=_RANDOM)).results
    poses = sum(len(one.case.poses) for one in results)
    counts = {verdict: sum(one.count(verdict) for one in results) for verdict in Verdict}
    agree = counts.pop(Verdict.AGREES)
    words = [f"{count} {verdict.value}" for verdict, count in counts.items() if count]
    return "; ".join([f"{agree} of {poses}", *words])


if __name__ == "__main__":
    PAGE.write_text(page(Path(sys.argv[1]), Path(sys.argv[2])), encoding="utf-8")
