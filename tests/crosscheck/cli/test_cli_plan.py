"""``crosscheck plan`` from outside."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from called import refused, run
from made_data import case

from seecr.folders import staged

pytestmark = pytest.mark.slow

XML = "planar_vertical"


@pytest.fixture(scope="module")
def poses(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Commands without readings."""
    folder = tmp_path_factory.mktemp("poses")
    xml, data = case(folder, points=4)
    rows = [line.split(",") for line in data.read_text().splitlines()]
    keep = [i for i, name in enumerate(rows[0]) if not name.startswith("meas")]
    planned = folder / "poses.csv"
    planned.write_text("".join(",".join(row[i] for i in keep) + "\n" for row in rows))
    return xml, planned


def plan_in(folder: Path) -> dict[str, Any]:
    document: dict[str, Any] = json.loads((folder / "plan.json").read_text())
    return document


def test_a_plan_says_what_shows_what_is_alike_and_what_to_add(
    poses: tuple[Path, Path], tmp_path: Path
) -> None:
    result = run("plan", *poses, "--out", tmp_path)
    assert result.exit_code == 0 and result.stderr == ""
    for words in (
        *("noise of positions is not stated", "pulley_radius", "frame_compliance (exactly)"),
        *("add: record the cable tensions", "needs", "of these could be named"),
    ):
        assert words in result.stdout
    document = plan_in(tmp_path)
    stiffness = next(e for e in document["effects"] if e["effect"] == "stiffness")
    assert stiffness["visible"] is True and stiffness["smallest_identifiable"] is None
    alike = {"effect": "platform_mass", "exact": True, "signal": 0.0}
    assert alike in stiffness["cannot_be_told_from"]
    assert stiffness["smallest_visible"]["factor"] < 0.3
    assert len(document["confusion"]["containment"]) == len(document["confusion"]["effects"])
    assert {s["kind"] for s in document["add"]} >= {"tensions", "payload"}


@pytest.mark.usefixtures("unpaged")
def test_json_and_stated_noise(poses: tuple[Path, Path], tmp_path: Path) -> None:
    sizes = ("position=0.1mm", "orientation=1mrad", "tension=0.05N")
    noise = [word for size in sizes for word in ("--sigma", size)]
    document = json.loads(run("plan", *poses, *noise, "--json", "--out", tmp_path).stdout)
    assert document == plan_in(tmp_path)
    assert document["sigma"]["position_m"] == pytest.approx(1e-4)
    assert document["sigma"]["tension_N"] == pytest.approx(0.05)
    assert document["notes"] == []
    assert "tension_scale" in [e["effect"] for e in document["effects"]]
    assert "tensions" not in [s["kind"] for s in document["add"]]


@pytest.mark.usefixtures("unpaged")
def test_a_plan_from_nothing_but_a_robot(tmp_path: Path) -> None:
    out, again = tmp_path / "plan", tmp_path / "again"
    given = ("--reads", "position,tension", "--sigma", "tension=0.05N", "--highest", "60")
    result = run("plan", XML, "--rows", 12, *given, "--out", out, status=0)
    assert "commands in poses.csv" in result.stdout
    document = plan_in(out)
    assert document["reads"] == ["position", "tension"] and document["rows"]["used"] == 12
    # what was written is read again, and shows the same
    run("plan", XML, out / "poses.csv", *given, "--out", again)
    assert plan_in(again)["sentence"] == document["sentence"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("POSES --rows 9", "expected POSES.csv or --rows N, got both"),
        ("", "got neither"),
        ("none.csv", "none.csv"),
        ("POSES --sigma position=0.1", "--sigma position: expected a number with its unit"),
        ("POSES --sigma tension=1mm", "got unit 'mm'"),
        (
            "POSES --reads position,colour",
            "reads: expected some of position, orientation, tension, got 'colour'",
        ),
        ("--rows 9 --box 1,2", "--box: expected X0,Y0"),
        ("--rows 9 --box 0,0,0,1,1,inf", "--box: expected X0,Y0"),
        ("--rows 9 --box 0,0,0,1e300,1,1", "X: expected metres, in the range of"),
        ("--rows 9 --highest 0.1", "can be held at 0 of"),
        ("--rows 9 --highest 0.1", "ask for fewer rows, a wider range of tensions"),
    ],
)
def test_what_is_asked_of_a_plan_wrongly_is_said(
    poses: tuple[Path, Path], tmp_path: Path, words: str, said: str
) -> None:
    given = words.replace("POSES", str(poses[1])).split()
    assert said in refused("plan", poses[0], *given, "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("unpaged")
def test_a_plan_replaces_an_older_one_but_not_what_it_reads(tmp_path: Path) -> None:
    """The user's commands were overwritten, and files of the older plan stayed beside the new."""
    out, given = tmp_path / "p", ("--reads", "position", "--sigma", "position=0.1mm")
    assert run("plan", XML, "--rows", 8, *given, "--out", out).exit_code == 0
    written = {file.name: file.read_bytes() for file in out.iterdir()}
    assert "add-payload.csv" in written
    text = refused("plan", XML, out / "add-payload.csv", *given, "--out", out)
    assert "add-payload.csv: would be overwritten, but was read" in text
    assert {file.name: file.read_bytes() for file in out.iterdir()} == written
    # what is planned is not stale, though the older plan wrote it
    with staged(out) as older:
        (older / "add-tensions.csv").write_text("of a plan that had an addition more")
    assert run("plan", XML, out / "poses.csv", *given, "--out", out).exit_code == 0
    assert (out / "poses.csv").read_bytes() == written["poses.csv"]
    assert {file.name for file in out.glob("*.csv")} == {"poses.csv", *plan_in(out)["files"]}
