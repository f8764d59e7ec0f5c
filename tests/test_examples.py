"""The examples run, and come to what they say."""

from __future__ import annotations

import ast
import json
import re
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


def names_of(script: str) -> dict[str, Any]:
    """What a script defines; it does nothing unless it is called."""
    path = EXAMPLES / script
    names: dict[str, Any] = {"__name__": path.stem, "__file__": str(path)}
    exec(compile(path.read_text(encoding="utf-8"), str(path), "exec", dont_inherit=True), names)
    return names


def cells_of(notebook: str) -> list[str]:
    """A notebook's code, cell by cell."""
    cells = json.loads((EXAMPLES / notebook).read_text(encoding="utf-8"))["cells"]
    assert all(cell.get("outputs", []) == [] for cell in cells), "kept without outputs"
    return ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]


def shown_by(cell: str, names: dict[str, Any]) -> str:
    """What a notebook shows under a cell: its last expression as HTML."""
    body = ast.parse(cell).body
    last = body.pop() if isinstance(body[-1], ast.Expr) else None
    exec(compile(ast.Module(body, []), "cell", "exec"), names)
    value = (
        None if last is None else eval(compile(ast.Expression(last.value), "cell", "eval"), names)
    )
    return "" if value is None else value._repr_html_()


@pytest.mark.slow
def test_mujoco_rests_where_the_planar_robot_does(capsys: pytest.CaptureFixture[str]) -> None:
    assert names_of("planar_robot.py")["main"]() < 1e-9
    assert capsys.readouterr().out.count("MuJoCo") == 5


@pytest.mark.slow
def test_a_trackers_csv_leads_to_commands(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = names_of("tracker_to_commands.py")["main"](tmp_path / "corrected.csv")
    said = capsys.readouterr().out
    assert "effects_found: drum_gain\nModel and data agree" in said
    assert found.reached.all() and np.abs(found.left).max() < 1e-9
    written = np.loadtxt(tmp_path / "corrected.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(written, found.lengths, atol=1e-6)


@pytest.mark.slow
def test_the_notebook_shows_the_diagnosis(monkeypatch: pytest.MonkeyPatch) -> None:
    matplotlib.use("Agg")
    monkeypatch.chdir(EXAMPLES)
    names: dict[str, Any] = {}
    shown = [shown_by(cell, names) for cell in cells_of("diagnosis.ipynb")]
    plt.close("all")
    assert "27 rows in 3 runs" in shown[0] and "17.1 times the noise" in shown[1]
    assert "effects_found: Adding drum_gain" in shown[2] and "<table>" in shown[2]
    assert names["after"].is_noise
    told = (EXAMPLES / "diagnosis.ipynb").read_text(encoding="utf-8")
    hidden = [float(x.replace("−", "-")) for x in re.findall(r"−?0\.\d\d(?=[, %]| and)", told)]
    fitted = [100 * value for value in names["found"].missing[0].term.vector]
    np.testing.assert_allclose(hidden, fitted, atol=0.04)
