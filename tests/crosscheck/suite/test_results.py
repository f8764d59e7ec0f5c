"""What the suite writes: JSON, JUnit, Markdown, the worst pose, and the folder they go to."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from crosscheck.show.suite import print_run
from crosscheck.suite.agreement import load_thresholds
from crosscheck.suite.cases import Case, demobot_sweep
from crosscheck.suite.results import CaseResult, remarks
from crosscheck.suite.run import Run, results_json, run_case, verdict_line
from crosscheck.suite.verdicts import PoseFinding, Verdict
from crosscheck.suite.write import junit_xml, summary_md, worst_pose, write_worst_pose
from seecr.description.mjcf import model_path
from seecr.files import json_text

THRESHOLDS = load_thresholds()


@pytest.fixture(scope="module")
def good() -> CaseResult:
    path = model_path("demobot_parallel")
    case = Case("good", path, path, "vectran", "sweep", demobot_sweep(0.1, 3))
    return run_case(case, THRESHOLDS)


def failed(result: CaseResult, name: str = "bad|<&>\x01") -> CaseResult:
    """The same case with pose 1 a millimetre off."""
    difference = replace(result.difference, position_m=np.array([0.0, 1e-3, 0.0]))
    verdict = np.array([Verdict.AGREES, Verdict.DIFFERS, Verdict.AGREES], dtype=object)
    finding = PoseFinding(1, Verdict.DIFFERS, "a <millimetre> apart", 1.0, 2.0, False, True, 1e-3)
    case = replace(result.case, name=name)
    return replace(result, case=case, difference=difference, verdict=verdict, findings=(finding,))


def unsolved(result: CaseResult) -> CaseResult:
    """The same case with no answer at pose 2."""
    nan = np.full(3, np.nan)
    verdict = np.array([*[Verdict.AGREES] * 2, Verdict.SEECR_UNSOLVED], dtype=object)
    difference = replace(result.difference, position_m=np.array([0.0, 0.0, nan[0]]))
    finding = PoseFinding(2, Verdict.SEECR_UNSOLVED, "SEECR: not at rest")
    case = replace(result.case, name="open")
    return replace(result, case=case, difference=difference, verdict=verdict, findings=(finding,))


def run_of(*results: CaseResult) -> Run:
    return Run(results, THRESHOLDS, seed=3, jobs=2, wall_s=1.25)


def test_json_holds_every_number_of_every_pose(good):
    document = json.loads(results_json(run_of(good)))
    assert document["verdict"] == "agree"
    assert document["exit_status"] == 0
    assert document["thresholds"] == json.loads(json_text(vars(THRESHOLDS)))
    assert set(document["packages"]) >= {"seecr", "mujoco", "numpy", "numba", "python"}
    assert document["poses"] == {
        "total": 3, "agrees": 3, "neutral": 0, "branch": 0, "differs": 0, "seecr_unsolved": 0,
        "mujoco_unsolved": 0,
    }  # fmt: skip
    (case,) = document["cases"]
    # to the last digit, so that recordings can be held against it
    assert np.array_equal(case["command"], good.case.poses)
    assert np.array_equal(case["seecr"]["pose"], good.solution.pose)
    assert np.array_equal(case["seecr"]["tensions_N"], good.solution.tensions)
    assert np.array_equal(case["mujoco"]["pose"], good.settling.pose)
    assert np.array_equal(case["mujoco"]["settled_pose"], good.settling.settled_pose)
    assert np.array_equal(case["difference"]["cable_tension_N"], good.difference.cable_tension_N)
    assert np.array_equal(case["allowed"]["position_m"], [1e-8] * 3)
    assert case["seecr"]["status"] == ["converged"] * 3
    assert case["mujoco"]["status"] == ["settled"] * 3
    worst = good.worst["tension_N"]
    assert case["worst"]["tension_N"] == {
        "quantity": "tension_N", "value": worst.value, "allowed": 1e-6, "pose": worst.pose,
        "ratio": worst.ratio,
    }  # fmt: skip
    assert document["worst"]["case"] == "good"


def test_json_says_null_where_there_is_no_number(good):
    text = results_json(run_of(unsolved(good), failed(good)))
    assert "NaN" not in text
    document = json.loads(text)
    assert document["verdict"] == "differ"  # a difference outweighs a solve without an answer
    assert document["exit_status"] == 1
    first, second = document["cases"]
    assert first["difference"]["position_m"] == [0.0, 0.0, None]
    assert first["verdict"][2] == "seecr_unsolved"
    assert first["findings"][0]["mujoco_stays"] is None
    assert first["exit_status"] == 3
    assert second["findings"][0]["energy_mujoco_J"] == 2.0
    assert json.loads(results_json(run_of(unsolved(good))))["verdict"] == "not_converged"


def test_a_run_shows_itself_and_has_a_row_per_pose(good):
    run = run_of(good, failed(good, "bad"))
    lines = str(run).splitlines()
    assert lines[0] == verdict_line(run)
    assert lines[1] == "bad, pose 1, commanded (0.4 0.25 0.1; 1 0 0 0): a <millimetre> apart"
    assert "a &lt;millimetre&gt; apart" in run._repr_html_()
    frame = run.to_frame()
    assert frame.num_rows == 6
    assert frame["verdict"].to_pylist()[4] == "differs"
    np.testing.assert_array_equal(frame["mujoco_x_m"].to_numpy()[:3], good.settling.pose[:, 0])
    np.testing.assert_array_equal(frame["seecr_qw"].to_numpy()[:3], good.solution.pose[:, 3])
    assert str(good).startswith("good: 3 poses, agree; worst difference ")
    assert str(failed(good, "bad")).splitlines()[1].startswith("pose 1, commanded ")


def test_json_is_the_same_in_one_piece_or_case_by_case(good):
    run = run_of(good, failed(good))
    assert json.loads(results_json(run)) == json.loads(json_text(run.as_json()))


def test_junit_has_a_test_per_case_and_names_the_pose(good):
    root = ET.fromstring(junit_xml(run_of(good, failed(good), unsolved(good))))
    (suite,) = root.findall("testsuite")
    assert {k: suite.get(k) for k in ("tests", "failures", "errors")} == {
        "tests": "3", "failures": "1", "errors": "1",
    }  # fmt: skip
    passed, failure, error = suite.findall("testcase")
    assert passed.get("name") == "good"
    assert passed.find("failure") is None
    assert "position: " in passed.findtext("system-out")
    assert failure.get("name") == "bad|<&>\ufffd"  # XML has no way to say the control character
    assert failure.find("failure").get("message").endswith("1 differ")
    assert "pose 1, commanded (0.4 0.25 0.1; 1 0 0 0): a <millimetre> apart" in failure.findtext(
        "failure"
    )
    assert "pose 2" in error.findtext("error")


def test_summary_is_a_table_with_failures_below(good):
    text = summary_md(run_of(good, failed(good)), "Look at it.")
    rows = [line for line in text.splitlines() if line.startswith("|")]
    assert len(rows) == 5  # heads, rule, two cases, what is allowed
    widths = {len(re.findall(r"(?<!\\)\|", row)) for row in rows}
    assert len(widths) == 1
    assert "SEECR and MuJoCo differ in bad" in text
    assert "## Failures" in text
    assert "a <millimetre> apart" in text
    assert "Look at it." in text
    clean = summary_md(run_of(good), "")
    assert "## Failures" not in clean
    assert "SEECR and MuJoCo agree at 3 poses of 1 case" in clean


def test_verdict_line_names_the_worst_difference(good):
    line = verdict_line(run_of(good, failed(good)))
    assert "worst difference 1.00e-03 m (position), 1e+05 times the allowed one" in line
    assert line.endswith("at pose 1.")
    everything = replace(good, verdict=np.full(3, Verdict.NEUTRAL, dtype=object))
    line = verdict_line(run_of(everything))
    assert "agree at 0 of 3 poses of 1 case (3 findings); no pose could be compared" in line


def test_verdict_line_says_why_where_all_differences_are_allowed(good):
    """It had said "differ ...; worst difference ..., 0.28 % of the allowed one"."""
    bad = failed(good, "slack")
    near = replace(bad, difference=good.difference)
    line = verdict_line(run_of(good, near))
    assert "differ in slack; all differences are allowed, but in slack at pose 1, commanded" in line
    assert "worst difference" not in line


def test_terminal_table_shows_units_thresholds_and_failures(good, capsys):
    print_run(run_of(good, failed(good, "bad")), Path("here"))
    out = capsys.readouterr().out
    heads, units = out.splitlines()[:2]
    names = ["settled", "settled", "polished", "polished", "tension", "SEECR", "MuJoCo"]
    assert heads.split() == names
    under = ["case", "poses", "[m]", "[rad]", "[m]", "[rad]", "[N]", "[µs]", "[ms]"]
    assert units.split() == [*under, "result", "remarks"]
    assert re.search(r"allowed +1e-06 +1e-05 +1e-08 +1e-07 +1e-06", out)
    assert "bad, pose 1, commanded" in out
    assert "DIFFER" in out
    assert out.endswith("results in here/\n")


def test_a_narrow_terminal_gets_fewer_columns_and_whole_numbers(good, capsys, monkeypatch):
    result = replace(good, case=replace(good.case, name="parallel-vectran-random"))
    for name, value in {"FORCE_COLOR": "1", "TERM": "dumb", "COLUMNS": "80"}.items():
        monkeypatch.setenv(name, value)
    print_run(run_of(result), Path("here"))
    table = capsys.readouterr().out.splitlines()[:4]
    assert max(map(len, table)) <= 80
    assert "…" not in "".join(table)
    assert table[1].split() == ["case", "[m]", "[rad]", "[m]", "[rad]", "[N]", "result"]
    assert table[2].split()[0] == "parallel-vectran-random"
    assert table[2].split()[-1] == "agree"


def test_terminal_tells_a_few_failures_and_counts_the_rest(good, capsys):
    bad = failed(good, "bad")
    print_run(run_of(replace(bad, findings=bad.findings * 8)), Path("here"))
    out = capsys.readouterr().out
    assert out.count("a <millimetre> apart") == 5
    assert "bad: 3 more in summary.md" in out


def test_widened_thresholds_are_told(good):
    allowance = replace(
        good.allowance,
        position_m=np.array([1e-8, 3e-5, 1e-8]),
        widened=np.array([False, True, False]),
    )
    run = run_of(replace(good, allowance=allowance))
    assert "allowed 1.0e-06 m (position after plain settling)" in summary_md(run, "")
    assert "3.0e-05 m (position)" in summary_md(run, "")
    assert "1 widened" in remarks(run.results[0])


def test_worst_pose_opens_in_mujoco_at_rest(good, tmp_path):
    sentence = write_worst_pose([good, failed(good, "bad")], tmp_path)
    assert "pose 1 of bad" in sentence
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "worst_pose.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    assert np.abs(data.qpos - good.settling[1].qpos).max() == 0.0
    # forces balance there: the springs are those of the pose, the digits all there
    assert np.abs(data.qacc).max() < 1e-9
    assert np.abs(data.ten_length - good.mujoco_rest_lengths[1]).max() > 1e-4


def test_worst_pose_prefers_what_failed(good):
    assert worst_pose([good, unsolved(good)])[1] == 2
    assert worst_pose([unsolved(good), failed(good)])[1] == 1
    bad = failed(good, "worse")
    position = np.array([0.0, 0.0, 1e-2])
    verdict = np.array([*[Verdict.AGREES] * 2, Verdict.DIFFERS], dtype=object)
    worse = replace(bad, difference=replace(bad.difference, position_m=position), verdict=verdict)
    assert worst_pose([failed(good), worse]) == (worse, 2)
    result, pose = worst_pose([good])
    assert result is good
    assert pose == max(good.worst.values(), key=lambda worst: worst.ratio).pose
