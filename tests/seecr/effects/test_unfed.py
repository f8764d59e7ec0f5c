"""Effects that need times or temperatures which the commands do not have."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from click.testing import CliRunner

import seecr
from seecr.cli import main
from seecr.effects.base import unfed

ROBOT = seecr.load_robot("planar_vertical")
WARM = seecr.Term.of(ROBOT, "thermal_expansion", expansion_1_per_K=1e-4)
CREEP = seecr.Term.of(ROBOT, "creep", amount=0.1, time_s=10.0)


def test_what_is_left_out_is_told_with_what_it_needs() -> None:
    found = seecr.predict(ROBOT, ROBOT.reference_pose, [WARM, CREEP])
    assert [note.split(" is left out")[0] for note in found.notes] == ["thermal_expansion", "creep"]
    assert "column temperature_C" in found.notes[0] and "column t_s" in found.notes[1]
    assert found.as_json()["notes"] == found.notes and str(found).endswith(found.notes[1])


def test_nothing_is_told_of_what_acts_or_is_absent() -> None:
    poses = np.tile(ROBOT.reference_pose, (2, 1))
    fed = seecr.Commands(poses, time=np.array([0.0, 9.0]), temperature=np.array([20.0, 25.0]))
    assert unfed([WARM.effect(), CREEP.effect()], fed) == ()
    none = seecr.Term.of(ROBOT, "thermal_expansion", expansion_1_per_K=0.0)
    assert seecr.predict(ROBOT, poses, [none]).notes == ()


def test_commands_say_it_and_write_it(tmp_path: Path) -> None:
    model, at = tmp_path / "m.toml", [str(value) for value in ROBOT.reference_pose[:3]]
    text = 'format = 1\n[robot]\nname = "planar_vertical"\n[[effect]]\nname = "thermal_expansion"\n'
    values = "expansion_1_per_K = { value = 1e-4 }\nzero_temperature_C = { value = 20.0 }\n"
    model.write_text(f"{text}[effect.parameters]\n{values}", encoding="utf-8")
    with_it = ["planar_vertical", "--model", str(model), "--json"]
    pose = CliRunner().invoke(main, ["pose", *with_it, *at])
    out = ["--out", str(tmp_path / "s"), "--no-recording", "--figure", "none"]
    sweep = CliRunner().invoke(main, ["sweep", *with_it, "--line", *at, *at, *out])
    for result in (pose, sweep):
        assert result.exit_code == 0, result.output
        notes = json.loads(result.output)["notes"]
        assert any(note.startswith("thermal_expansion is left out") for note in notes)
