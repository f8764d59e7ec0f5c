"""``crosscheck compare`` from outside: exit statuses, files, and one line for bad input."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from called import refused, run
from click.testing import Result

from seecr.folders import MANIFEST

pytestmark = pytest.mark.slow

Files = tuple[Path, Path]


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "out"


def compare(files: Files, out: Path, *more: object) -> Result:
    return run("compare", *files, "--no-recording", "--out", out, *more)


def comparison(out: Path) -> dict[str, Any]:
    document: dict[str, Any] = json.loads((out / "comparison.json").read_text())
    return document


def test_without_limits_it_reports_and_ends_0(stiff: Files, out: Path) -> None:
    result = compare(stiff, out)
    assert result.exit_code == 0 and result.stderr == ""
    for words in (
        *("The model misses something", "bias", "all rows", "noise alone", "run along_low_fwd"),
        *("travel +x", "region x", "mm", "deg"),
    ):
        assert words in result.stdout
    assert {file.name for file in out.iterdir()} == {
        "comparison.json", "comparison.html", MANIFEST
    }  # fmt: skip
    document = comparison(out)
    assert document["is_noise"] is False and document["exit_status"] == 0
    assert document["rows"] == {"all": 64, "compared": 64}
    errors = document["poses"]["error"]
    assert len(errors) == 64 and len(errors[0]) == 14
    assert errors[0][6] is None  # no tensions were read


@pytest.mark.usefixtures("unpaged")
def test_json_alone_on_standard_output(stiff: Files, out: Path) -> None:
    assert json.loads(compare(stiff, out, "--json").stdout) == comparison(out)


@pytest.mark.usefixtures("unpaged")
def test_two_files_are_one_comparison_with_runs_that_keep_apart(
    stiff: Files, tmp_path: Path, out: Path
) -> None:
    xml, first = stiff
    second = tmp_path / "second.csv"
    head, *rows = (line.split(",") for line in first.read_text().splitlines()[:17])
    x = head.index("meas_x_m")
    for row in rows:  # readings of their own: copied ones would not count
        row[x] = repr(float(row[x]) + 1e-6)
    second.write_text("\n".join(map(",".join, [head, *rows])) + "\n")
    second.with_suffix(".toml").write_text('[sigma]\nposition_m = "0.1mm"\n')
    result = compare(stiff, out, second, "--max-position-worst", "1um")
    assert result.exit_code == 1, result.output
    assert "run second.csv: along_low_fwd" in result.stdout
    assert "worst at line measured.csv " in result.stdout
    document = comparison(out)
    assert document["data"] == "measured.csv + second.csv" and document["rows"]["compared"] == 80
    assert "given twice; expected each file once" in refused("compare", xml, first, first)


@pytest.mark.usefixtures("unpaged")
def test_a_limit_exceeded_ends_1_and_says_by_how_much_and_where(stiff: Files, out: Path) -> None:
    result = compare(stiff, out, "--max-position", "0.05mm")
    assert result.exit_code == 1
    assert "exceeds 0.05 mm by" in result.stdout and "worst at line" in result.stdout
    assert comparison(out)["exceeded"][0]["name"] == "max_position"
    assert compare(stiff, out, "--max-position", "5mm").exit_code == 0
    worst = compare(stiff, out, "--max-orientation-worst", "0.001deg")
    assert worst.exit_code == 1 and "worst orientation error" in worst.stdout


@pytest.mark.usefixtures("unpaged")
def test_limits_from_a_file(stiff: Files, tmp_path: Path, out: Path) -> None:
    limits = tmp_path / "limits.toml"
    limits.write_text('max_position = "5mm"\nmax_orientation = "0.001deg"\n')
    result = compare(stiff, out, "--limits", limits)
    assert result.exit_code == 1 and "orientation error (rms)" in result.stdout
    result = compare(stiff, out, "--limits", limits, "--max-orientation", "1deg")
    assert result.exit_code == 0 and "All limits hold." in result.stdout


@pytest.mark.usefixtures("unpaged")
def test_the_model_is_taken_up(stiff: Files, tmp_path: Path, out: Path) -> None:
    model = tmp_path / "m.toml"
    model.write_text('[[effect]]\nname = "stiffness"\nparameters.factor = 1.4\n')
    result = compare(stiff, out, "--model", model, "--max-position", "0.05mm")
    assert result.exit_code == 0
    assert "Model and data agree: the residuals are noise" in result.stdout


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("ROBOT DATA --max-position 0.5",
         "--max-position: expected a number with its unit (m, cm, mm, um, µm)"),
        ("ROBOT DATA --max-orientation 1mm", "got unit 'mm'"),
        ("ROBOT DATA --max-tension 1N", "has no tension readings"),
        ("none.xml DATA", "none.xml"),
        ("ROBOT none.csv", "none.csv"),
        ("ROBOT DATA --model none.toml",
         "none.toml: no such file; expected a model as crosscheck add writes it"),
        ("ROBOT DATA --model other.toml",
         "made for another robot: other with 2 cables; demobot_cogiro has 8"),
    ],
)  # fmt: skip
def test_what_cannot_be_compared_writes_nothing(
    stiff: Files, out: Path, words: str, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(out.parent)
    Path("other.toml").write_text('[robot]\nname = "other"\ncables = ["a", "b"]\n')
    given = words.replace("ROBOT", str(stiff[0])).replace("DATA", str(stiff[1])).split()
    assert said in refused("compare", *given, "--out", out)
    assert not out.exists()


def test_rows_without_an_equilibrium_end_3_and_are_named(
    stiff: Files, tmp_path: Path, out: Path
) -> None:
    xml, data = stiff
    # no weight and cables a metre too long: every cable is slack and nothing holds the platform
    text, changes = re.subn(
        r'springlength="0 ([^"]+)"',
        lambda found: f'springlength="0 {float(found[1]) + 1.0!r}"',
        re.sub(r'gravity="[^"]*"', 'gravity="0 0 0"', xml.read_text()),
    )
    assert changes == 8 and 'gravity="0 0 0"' in text
    loose = tmp_path / "loose.xml"
    loose.write_text(text)
    result = compare((loose, data), out)
    assert result.exit_code == 3
    assert "every cable is slack" in result.stdout and "line 2, run along_low_fwd" in result.stdout
    assert "Nothing could be compared" in result.stdout
    document = comparison(out)
    assert document["rows"]["compared"] == 0 and len(document["unsolved"]) == 64
