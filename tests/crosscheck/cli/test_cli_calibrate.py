"""``crosscheck calibrate``: one call, a model at the noise, its covariance beside it."""

from __future__ import annotations

import json

import numpy as np
import pytest
from made_data import case, refused, run

from seecr import load_model, load_robot

HIDDEN = {"pulley_radius": {"radius_m": 0.01}, "centre_of_mass": {"shift_x_m": 0.004}}


@pytest.mark.slow
def test_the_model_predicts_to_the_noise_and_keeps_its_covariance(tmp_path):
    files = case(tmp_path, HIDDEN)
    model, out = tmp_path / "model.toml", tmp_path / "out"
    done = run("calibrate", *files, "--model", model, "--json", "--out", out)
    assert done.exit_code == 0
    told = json.loads(done.stdout)
    assert told["after"]["position_rms_m"] < 0.1 * told["before"]["position_rms_m"]
    assert told["noise"]["scale"]["position"] == pytest.approx(1.0, abs=0.3)
    assert json.loads((out / "calibration.json").read_text()) == told
    gate = ("--max-position", "0.04mm", "--max-orientation", "0.025deg", "--no-recording")
    compared = run("compare", *files, "--model", model, *gate, "--out", tmp_path / "compared")
    assert compared.exit_code == 0
    beside = json.loads(model.with_suffix(".covariance.json").read_text())
    covariance = np.array(beside["covariance"])
    assert covariance.shape == (len(beside["parameters"]),) * 2
    written = load_model(model, load_robot(files[0]))
    at = beside["parameters"].index("pulley_radius.radius_m")
    stated = written.stderr["pulley_radius"][0]
    assert np.sqrt(covariance[at, at]) == pytest.approx(stated, rel=0.01)
    assert written.terms["pulley_radius"].vector[0] == pytest.approx(0.01, abs=5 * stated)


def test_bad_input_is_one_line(tmp_path):
    text = refused("calibrate", tmp_path / "gone.xml", tmp_path / "gone.csv", "--model", "m.toml")
    assert "gone.xml" in text
