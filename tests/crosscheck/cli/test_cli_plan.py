"""``crosscheck plan`` from outside."""

from __future__ import annotations

import json

import pytest
from made_data import case, refused, run

from seecr.description.mjcf import model_path

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def poses(tmp_path_factory):
    """Commands without readings."""
    folder = tmp_path_factory.mktemp("poses")
    xml, data = case(folder, points=4)
    lines = data.read_text().splitlines()
    keep = [i for i, name in enumerate(lines[0].split(",")) if not name.startswith("meas")]
    planned = folder / "poses.csv"
    planned.write_text(
        "\n".join(",".join(line.split(",")[i] for i in keep) for line in lines) + "\n"
    )
    return xml, planned


def test_a_plan_says_what_shows_what_is_alike_and_what_to_add(poses, tmp_path):
    result = run("plan", *poses, "--out", tmp_path)
    assert result.exit_code == 0 and result.stderr == ""
    out = result.stdout
    assert "noise of positions is not stated" in out
    assert "pulley_radius" in out and "frame_compliance (exactly)" in out
    assert "add: record the cable tensions" in out and "needs" in out
    assert "of these could be named" in out
    document = json.loads((tmp_path / "plan.json").read_text())
    stiffness = next(e for e in document["effects"] if e["effect"] == "stiffness")
    assert stiffness["visible"] is True and stiffness["smallest_identifiable"] is None
    assert {"effect": "platform_mass", "exact": True, "signal": 0.0} in stiffness[
        "cannot_be_told_from"
    ]
    assert stiffness["smallest_visible"]["factor"] < 0.3
    table = document["confusion"]["containment"]
    assert len(table) == len(document["confusion"]["effects"])
    added = next(s for s in document["add"] if s["kind"] == "poses")
    assert all(len(p) == 7 for p in added["poses"])


def test_json_and_stated_noise(poses, tmp_path, unpaged):
    options = ("--sigma", "position=0.1mm", "--sigma", "orientation=1mrad")
    tension = ("--sigma", "tension=0.05N")
    result = run("plan", *poses, *options, *tension, "--json", "--out", tmp_path)
    document = json.loads(result.stdout)
    assert document == json.loads((tmp_path / "plan.json").read_text())
    assert document["sigma"]["position_m"] == pytest.approx(1e-4)
    assert document["sigma"]["tension_N"] == pytest.approx(0.05)
    assert document["notes"] == []
    assert "tension_scale" in [e["effect"] for e in document["effects"]]
    assert "tensions" not in [s["kind"] for s in document["add"]]


def test_noise_without_a_right_unit_is_refused(poses, tmp_path):
    out = tmp_path / "out"
    text = refused("plan", *poses, "--sigma", "position=0.1", "--out", out)
    assert "--sigma position: expected a number with its unit" in text
    assert "got unit 'mm'" in refused("plan", *poses, "--sigma", "tension=1mm", "--out", out)
    assert "none.csv" in refused("plan", poses[0], tmp_path / "none.csv", "--out", out)
    assert not out.exists()


def test_a_plan_from_nothing_but_a_robot(tmp_path, unpaged):
    xml = model_path("planar_vertical")
    out, again = tmp_path / "plan", tmp_path / "again"
    given = ("--reads", "position,tension", "--sigma", "tension=0.05N", "--highest", "60")
    result = run("plan", xml, "--rows", 12, *given, "--out", out)
    assert result.exit_code == 0, result.output
    assert "commands in poses.csv" in result.stdout
    document = json.loads((out / "plan.json").read_text())
    assert document["reads"] == ["position", "tension"] and document["rows"]["used"] == 12
    # what was written is read again, and shows the same
    run("plan", xml, out / "poses.csv", *given, "--out", again)
    same = json.loads((again / "plan.json").read_text())
    assert same["sentence"] == document["sentence"]


def test_what_is_asked_of_a_plan_wrongly_is_said(poses, tmp_path):
    out = ("--out", tmp_path / "out")
    assert "expected POSES.csv or --rows N, got both" in refused("plan", *poses, "--rows", 9, *out)
    assert "got neither" in refused("plan", poses[0], *out)
    text = refused("plan", *poses, "--reads", "position,colour", *out)
    assert "reads: expected some of position, orientation, tension, got 'colour'" in text
    for box in ("1,2", "0,0,0,1,1,inf"):
        assert "--box: expected X0,Y0" in refused("plan", poses[0], "--rows", 9, "--box", box, *out)
    far = refused("plan", poses[0], "--rows", 9, "--box", "0,0,0,1e300,1,1", *out)
    assert "X: expected metres, in the range of" in far
    text = refused("plan", poses[0], "--rows", 9, "--highest", "0.1", *out)
    assert "can be held at 0 of" in text and "ask for fewer rows, a wider range of tensions" in text


@pytest.mark.usefixtures("unpaged")
def test_a_plan_replaces_an_older_one_but_not_what_it_reads(tmp_path):
    """The user's commands were overwritten, and files of the older plan stayed beside the new."""
    xml = model_path("planar_vertical")
    out, given = tmp_path / "p", ("--reads", "position", "--sigma", "position=0.1mm")
    assert run("plan", xml, "--rows", 8, *given, "--out", out).exit_code == 0
    written = {file.name: file.read_bytes() for file in out.iterdir()}
    assert "add-payload.csv" in written
    text = refused("plan", xml, out / "add-payload.csv", *given, "--out", out)
    assert "add-payload.csv: would be overwritten, but was read" in text
    assert {file.name: file.read_bytes() for file in out.iterdir()} == written
    # what is planned is not stale, though the older plan wrote it
    (out / "add-tensions.csv").write_text("of a plan that had an addition more")
    assert run("plan", xml, out / "poses.csv", *given, "--out", out).exit_code == 0
    assert (out / "poses.csv").read_bytes() == written["poses.csv"]
    files = json.loads((out / "plan.json").read_text())["files"]
    assert {file.name for file in out.glob("*.csv")} == {"poses.csv", *files}
