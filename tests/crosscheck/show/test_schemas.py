"""What every command prints as JSON has the form that its shipped schema says."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import pytest
from called import BARE, as_json, ran
from jsonschema import Draft202012Validator, ValidationError

import crosscheck
import seecr

PACKAGES = {face: Path(face.__file__ or "").parent / "schemas" for face in (seecr, crosscheck)}
SCHEMAS = {
    path.stem: json.loads(path.read_text(encoding="utf-8"))
    for folder in PACKAGES.values()
    for path in folder.glob("*.json")
}
# Keys that contracts promise.
PROMISED = {
    "diagnosis": "verdict missing before after held_out candidates measure_next catalogue classes",
    "sweep": "rows", "correction": "rows", "pose": "pose tensions_N slack", "plan": "effects add",
    "results": "verdict cases",
}  # fmt: skip
OF_ROWS = ["command", "pose", "deviation_m", "rotation_rad", "tensions_N", "slack", "status",
           "residual", "smallest_eigenvalue"]  # fmt: skip


@pytest.mark.parametrize("name", SCHEMAS)
def test_schemas_are_valid_and_leave_room(name: str) -> None:
    schema = SCHEMAS[name]
    Draft202012Validator.check_schema(schema)
    assert schema["$schema"] == Draft202012Validator.META_SCHEMA["$id"]
    assert "additionalProperties" not in json.dumps(schema)
    assert set(PROMISED.get(name, "made").split()) <= set(schema["required"])
    if name == "sweep":
        assert set(OF_ROWS) <= set(schema["properties"]["rows"]["items"]["required"])


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a twin, and poses, one of which cannot be held."""
    folder = tmp_path_factory.mktemp("schemas")
    (folder / "poses.csv").write_text(
        "cmd_x_m,cmd_y_m,cmd_z_m\n0.4,0.25,0.15\n0.45,0.25,0.15\n0.4,0.25,1.15\n"
    )
    crosscheck.make_twin("planar_vertical", 3, points=4, out=folder / "twin")
    return folder


COMMANDS = {
    "pose": "seecr pose planar_two_cable 0.5 0 0.5",
    "sweep": f"seecr sweep demobot_parallel --line 0.2 0.25 0.1 0.6 0.25 0.1 {BARE} --out s",
    "map": f"seecr map planar_vertical --grid 0.2:0.6:3 0 0.15 {BARE} --out m",
    "correction": "seecr correct demobot_cogiro poses.csv --out c",
    "export": "seecr export planar_vertical out.xml",
    "effects": "crosscheck effects pulley_radius",
    "twin": "crosscheck twin planar_vertical --hide 4 --effect stiffness --out t",
    "answer": "crosscheck twin --open twin",
    "comparison": "crosscheck compare {files} --no-recording --out a",
    "diagnosis": "crosscheck diagnose {files} --no-recording --only stiffness,backlash --out d",
    "plan": "crosscheck plan {files} --out p",
    "addition": "crosscheck add stiffness {files} --model model.toml",
    "calibration": "crosscheck calibrate {files} --model other.toml",
    "results": "crosscheck run --case planar-two-cable --no-recordings --jobs 1 --out r",
}


def test_every_schema_has_a_command() -> None:
    assert set(COMMANDS) == set(SCHEMAS)


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_outputs_have_the_form(name: str, case: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(case)
    files = "twin/robot.xml twin/measured.csv"
    document = json.loads(ran(f"{COMMANDS[name].format(files=files)} --json").stdout)
    Draft202012Validator(SCHEMAS[name]).validate(document)
    for key in SCHEMAS[name]["required"]:
        damaged: dict[str, Any] = copy.deepcopy(document)
        del damaged[key]
        with pytest.raises(ValidationError):
            Draft202012Validator(SCHEMAS[name]).validate(damaged)
    firm = next(key for key in ("made", "verdict") if key in document)
    with pytest.raises(ValidationError):
        Draft202012Validator(SCHEMAS[name]).validate({**document, firm: 1})


@pytest.mark.slow
def test_no_verdict_has_the_form(case: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(case)
    rows = Path("twin/measured.csv").read_text().splitlines()
    Path("few.csv").write_text("\n".join(rows[:4]) + "\n")
    command = "crosscheck diagnose planar_vertical few.csv --no-recording --out few --json"
    document = json.loads(ran(command).stdout)
    assert document["verdict"] == "no_verdict"
    Draft202012Validator(SCHEMAS["diagnosis"]).validate(document)


def test_a_row_that_lacks_what_is_promised_is_seen(
    case: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(case)
    document = as_json(COMMANDS["sweep"])
    for damage in ({"pose": None}, {"tensions_N": "much"}, {"residual": "small"}):
        rows = [{**document["rows"][0], **damage}]
        with pytest.raises(ValidationError):
            Draft202012Validator(SCHEMAS["sweep"]).validate({**document, "rows": rows})
