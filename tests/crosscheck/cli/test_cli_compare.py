"""``crosscheck compare`` from outside: exit statuses, files, and one line for bad input."""

from __future__ import annotations

import json

import pytest
from made_data import case, refused, run

pytestmark = pytest.mark.slow

QUIET = ("--no-recording",)


@pytest.fixture(scope="module")
def stiff(tmp_path_factory):
    """A robot whose cables are stiffer than described."""
    return case(tmp_path_factory.mktemp("stiff"), {"stiffness": {"factor": 1.4}})


def compare(xml, data, *more):
    return run("compare", xml, data, *QUIET, *more)


def test_without_limits_it_reports_and_ends_0(stiff, tmp_path):
    result = compare(*stiff, "--out", tmp_path / "out")
    assert result.exit_code == 0 and result.stderr == ""
    assert "The model misses something" in result.stdout
    for words in ("bias", "all rows", "noise alone", "run along_low_fwd", "travel +x", "region x"):
        assert words in result.stdout
    assert "mm" in result.stdout and "deg" in result.stdout
    names = {file.name for file in (tmp_path / "out").iterdir()}
    assert names == {"comparison.json", "comparison.html"}
    document = json.loads((tmp_path / "out" / "comparison.json").read_text())
    assert document["is_noise"] is False and document["exit_status"] == 0
    assert document["rows"] == {"all": 64, "compared": 64}
    assert len(document["poses"]["error"]) == 64 and len(document["poses"]["error"][0]) == 14
    assert document["poses"]["error"][0][6] is None  # no tensions were read


def test_json_alone_on_standard_output(stiff, tmp_path, unpaged):
    result = compare(*stiff, "--json", "--out", tmp_path)
    assert json.loads(result.stdout) == json.loads((tmp_path / "comparison.json").read_text())


def test_two_files_are_one_comparison_with_runs_that_keep_apart(stiff, tmp_path, unpaged):
    xml, first = stiff
    second = tmp_path / "second.csv"
    header, *rows = first.read_text().splitlines()
    second.write_text("\n".join([header, *rows[:16]]) + "\n")
    second.with_suffix(".toml").write_text('[sigma]\nposition_m = "0.1mm"\n')
    result = compare(xml, first, second, "--max-position-worst", "1um", "--out", tmp_path / "out")
    assert result.exit_code == 1, result.output
    assert "run second.csv: along_low_fwd" in result.stdout
    assert "Identical rows" in result.stdout and "worst at line measured.csv " in result.stdout
    document = json.loads((tmp_path / "out" / "comparison.json").read_text())
    assert document["data"] == "measured.csv + second.csv" and document["rows"]["compared"] == 80
    assert "given twice; expected each file once" in refused("compare", xml, first, first)


def test_a_limit_exceeded_ends_1_and_says_by_how_much_and_where(stiff, tmp_path, unpaged):
    result = compare(*stiff, "--max-position", "0.05mm", "--out", tmp_path)
    assert result.exit_code == 1
    assert "exceeds 0.05 mm by" in result.stdout and "worst at line" in result.stdout
    document = json.loads((tmp_path / "comparison.json").read_text())
    assert document["exceeded"][0]["name"] == "max_position"
    assert compare(*stiff, "--max-position", "5mm", "--out", tmp_path).exit_code == 0
    worst = compare(*stiff, "--max-orientation-worst", "0.001deg", "--out", tmp_path)
    assert worst.exit_code == 1 and "worst orientation error" in worst.stdout


def test_limits_from_a_file(stiff, tmp_path, unpaged):
    limits = tmp_path / "limits.toml"
    limits.write_text('max_position = "5mm"\nmax_orientation = "0.001deg"\n')
    result = compare(*stiff, "--limits", limits, "--out", tmp_path)
    assert result.exit_code == 1 and "orientation error (rms)" in result.stdout
    result = compare(*stiff, "--limits", limits, "--max-orientation", "1deg", "--out", tmp_path)
    assert result.exit_code == 0 and "All limits hold." in result.stdout


def test_the_model_is_taken_up(stiff, tmp_path, unpaged):
    model = tmp_path / "m.toml"
    model.write_text('[[effect]]\nname = "stiffness"\nparameters.factor = 1.4\n')
    result = compare(*stiff, "--model", model, "--max-position", "0.05mm", "--out", tmp_path)
    assert result.exit_code == 0
    assert "Model and data agree: the residuals are noise" in result.stdout


def test_bad_limits_write_nothing(stiff, tmp_path):
    out = tmp_path / "out"
    text = refused("compare", *stiff, "--max-position", "0.5", "--out", out)
    assert "--max-position: expected a number with its unit (m, cm, mm, um, µm)" in text
    text = refused("compare", *stiff, "--max-orientation", "1mm", "--out", out)
    assert "got unit 'mm'" in text
    text = refused("compare", *stiff, "--max-tension", "1N", "--out", out)
    assert "has no tension readings" in text
    assert not out.exists()


def test_files_that_are_not_there(stiff, tmp_path):
    xml, data = stiff
    out = ("--out", tmp_path / "out")
    assert "none.xml" in refused("compare", tmp_path / "none.xml", data, *out)
    assert "none.csv" in refused("compare", xml, tmp_path / "none.csv", *out)
    text = refused("compare", xml, data, "--model", tmp_path / "none.toml", *out)
    assert "none.toml: no such file; expected a model as crosscheck add writes it" in text
    assert not (tmp_path / "out").exists()


def test_a_model_for_another_robot_is_refused(stiff, tmp_path):
    model = tmp_path / "m.toml"
    model.write_text('[robot]\nname = "other"\ncables = ["a", "b"]\n')
    text = refused("compare", *stiff, "--model", model)
    assert "made for another robot: other with 2 cables; demobot_cogiro has 8" in text


def test_rows_without_an_equilibrium_end_3_and_are_named(stiff, tmp_path):
    xml, data = stiff
    # no weight and cables a metre too long: every cable is slack and nothing holds the platform
    text = xml.read_text()
    head, *tendons = text.split('springlength="0 ')
    longer = [f"{float(t.split(chr(34))[0]) + 1.0!r}{t[t.index(chr(34)) :]}" for t in tendons]
    loose = tmp_path / "loose.xml"
    loose.write_text('springlength="0 '.join([head, *longer]))
    changed = loose.read_text()
    assert "gravity" in changed or "<option" in changed
    loose.write_text(_weightless(changed))
    result = compare(loose, data, "--out", tmp_path / "out")
    assert result.exit_code == 3
    assert "every cable is slack" in result.stdout and "line 2, run along_low_fwd" in result.stdout
    assert "Nothing could be compared" in result.stdout
    document = json.loads((tmp_path / "out" / "comparison.json").read_text())
    assert document["rows"]["compared"] == 0 and len(document["unsolved"]) == 64


def _weightless(text: str) -> str:
    import re

    if re.search(r'gravity="[^"]*"', text):
        return re.sub(r'gravity="[^"]*"', 'gravity="0 0 0"', text)
    return text.replace("<option", '<option gravity="0 0 0"', 1)
