"""``seecr new``: what it writes, what it tells, and that nothing is half written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from called import BARE, as_json, following, ran, refused_in_a_line
from published import caspr_files, wirex_file

import seecr

POINTS = """name,exit_x_m,exit_y_m,exit_z_m,anchor_x_mm,anchor_y_mm,anchor_z_mm
a,0,0,3,-300,-200,100
b,6,0,3,300,-200,100
c,6,4,3,300,200,100
d,0,4,3,-300,200,100
"""
NEW = "seecr new hall.xml --points points.csv"


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder that commands write into, with a table of points."""
    monkeypatch.chdir(tmp_path)
    Path("points.csv").write_text(POINTS)
    return tmp_path


def test_a_table_becomes_a_robot_that_every_command_reads() -> None:
    result = ran(f"{NEW} --mass 25kg --ea 3e5N --at 3 2 1.2", 0)
    robot = seecr.load_robot("hall.xml")
    made = seecr.Robot.from_points(
        robot.exit_points, robot.anchor_points, mass=25, ea=3e5, at=[3, 2, 1.2], name="hall",
        names="abcd",
    )  # fmt: skip
    np.testing.assert_allclose(robot.rest_lengths, made.rest_lengths, rtol=1e-15)
    np.testing.assert_allclose(robot.ea, made.ea, rtol=1e-15)
    assert (robot.name, robot.mass, robot.cable_names) == ("hall", 25.0, tuple("abcd"))
    assert robot.reference_pose.tolist() == [3, 2, 1.2, 1, 0, 0, 0]
    first, *_others = result.stdout.splitlines()
    assert first == "hall.xml: hall: 4 cables, a free platform of 25 kg"
    assert "sent to its reference pose: at rest: forces balance" in result.stdout
    assert "4 of 4 cables taut" in result.stdout
    assert following(result).endswith("seecr map hall.xml")


def test_poses_may_be_turned_and_negative() -> None:
    ran(f"{NEW} --mass 25kg --ea 3e5 --at -0.5 2 1 0.6 0 0 0.8", 0)
    pose = seecr.load_robot("hall.xml").reference_pose
    np.testing.assert_allclose(pose, [-0.5, 2, 1, 0.6, 0, 0, 0.8])
    ran(f"{NEW} --mass 25kg --ea 3e5 --at=1,2,1 --com -0.1 0 0 --force", 0)
    robot = seecr.load_robot("hall.xml")
    assert robot.reference_pose[:3].tolist() == [1, 2, 1]
    assert robot.centre_of_mass.tolist() == [-0.1, 0, 0]


def test_ropes_are_known_here_and_where_a_cable_is_named() -> None:
    said = ran(f"{NEW} --mass 25kg --cable 'steel 7x19 3mm'", 0).stdout
    assert "note: steel 7x19 3mm: E S = 3.762e+05 N" in said and "weighs 0.336 N/m" in said
    assert "the reference pose, where the winches are zeroed, is not given: 3 2 1.5 m" in said
    there = as_json("seecr pose hall.xml 3 2 1.5 --cable '200kN'")
    rope = as_json("seecr pose hall.xml 3 2 1.5 --cable 'dyneema 3mm'")
    assert there["tensions_N"][0] > 0.0 and rope["tensions_N"] != there["tensions_N"]


def test_pretension_holds_the_reference_pose() -> None:
    document = as_json(f"{NEW} --mass 25kg --ea 3e5 --at 3 2 1 --pretension 90")
    assert np.abs(document["home"]["deviation_m"]).max() < 1e-12
    assert min(document["home"]["tensions_N"]) >= 90 - 1e-9
    assert document["joints"] == [] and document["why_not"] is None


CORNERS = [(x, y, z) for z in (3, 0) for x, y in ((0, 0), (6, 0), (6, 4), (0, 4))]
HEAD = "exit_x_m,exit_y_m,exit_z_m,anchor_x_m,anchor_y_m,anchor_z_m"


@pytest.mark.parametrize(
    ("cables", "options", "held", "told"),
    [
        (8, "--at 3 2 1.5", True, "hang slack there; tensions of 0 N or more could hold the"),
        (8, "--at 3 2 1.5 --pretension 30", True, ""),
        (4, "--at 6.5 2 1", False, "no tensions of 0 N or more in all cables balance the load"),
    ],
    ids=["a hall", "a tight hall", "outside"],
)
def test_at_rest_says_what_it_leaves_open(cables: int, options: str, held: bool, told: str) -> None:
    """What tensions could hold is asked as a map asks it.

    Eight cables that do not cross balance any weight in their middle, by symmetry. Outside the
    frame all four upper ones pull inwards, and none outwards: two hang slack, and it rests turned.
    """
    anchors = [(0.1 * (x - 3), 0.1 * (y - 2), 0.1 * (z - 1.5)) for x, y, z in CORNERS]
    rows = [",".join(map(str, (*a, *b))) for a, b in zip(CORNERS, anchors, strict=True)]
    Path("points.csv").write_text("\n".join([HEAD, *rows[:cables]]) + "\n")
    words = f"{NEW} --mass 25kg --ea 3e5 {options} --force"
    assert as_json(words)["can_be_held"] == held
    said = ran(words, 0).stdout
    assert told in said and ("hang slack" in said) == ("hang slack" in told)
    assert ("no tensions" in said) != held
    at = " ".join(options.split()[1:4])
    ran(f"seecr map hall.xml --grid {at} --no-elastic {BARE}", 0 if held else 2)


def test_a_robot_that_does_not_rest_is_written_and_told() -> None:
    bodies, cables = caspr_files(Path(), "kntu_planar")
    words = f"seecr new k.xml --from caspr {bodies} {cables} --ea 1e5N"
    said = ran(words, 3).stdout
    assert "balanced, but free to move" in said and "nothing loads them" in said
    assert said.splitlines()[-1].endswith("seecr map k.xml --lowest=0.001 --highest=60")
    assert len(seecr.load_robot("k.xml").joints) == 3
    assert as_json(f"{words} --force --pretension 10")["home"]["tensions_N"] == pytest.approx(
        [10] * 4
    )


def test_wirex_needs_nothing_else() -> None:
    document = as_json(f"seecr new w.xml --from wirex {wirex_file(Path(), 'hrpcables')}")
    assert document["robot"] == "HRPCables" and document["mass_kg"] == 5.0
    assert document["home"]["status"] == "converged"
    assert any("pulley_radius" in note for note in document["notes"])


def test_a_planar_robot_is_deduced_or_said() -> None:
    Path("points.csv").write_text(
        "exit_x_m,exit_y_m,exit_z_m,anchor_x_m,anchor_y_m,anchor_z_m\n"
        "0,0,2,-0.1,0,0.05\n2,0,2,0.1,0,0.05\n"
    )
    given = f"{NEW} --mass 800g --ea 3kN"
    said = ran(given, 0).stdout
    assert "note: the platform is planar: it slides along x z and turns; --free frees it" in said
    assert len(seecr.load_robot("hall.xml").joints) == 3
    assert as_json(f"{given} --force --planar")["joints"] == ["slide x", "slide z", "hinge turn"]
    assert as_json(f"{given} --force --planar xz")["joints"] == ["slide x", "slide z", "hinge turn"]
    # free, it swings on its two cables, and rests all the same
    assert as_json(f"{given} --force --free")["joints"] == []


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (NEW, "points.csv: does not say the platform's mass; give it, such as --mass 25kg; nor how "
              "far its cables stretch; give E S or a rope, such as --ea 3e5N or --ea 'steel 7x19"),
        (f"{NEW} --mass 25kg", "points.csv: does not say how far its cables stretch"),
        (f"{NEW} --mass 25m --ea 3e5", "--mass: expected a mass above zero with its unit, as 25kg"),
        (f"{NEW} --mass 25 --ea soft", "--ea: expected E S such as 3e5N, or a rope by material"),
        (f"{NEW} --mass 25 --ea 1e4 --at 1 2", "expected X Y Z [QW QX QY QZ], got '1 2'"),
        (f"{NEW} --mass 25 --ea 1e4 --at 1 2 3 1 1 0 0", "with a unit quaternion, scalar first"),
        ("seecr new h.xml --points high.csv --mass 2 --ea 1 --planar", "in no one plane; say "),
        (f"{NEW} --mass 25 --ea 1e4 --pretension 9e9", "the reference pose cannot be held so, "),
        (f"{NEW} --mass 0kg --ea 1e4", "--mass: expected a mass above zero with its unit"),
        (f"{NEW} --mass 1 --ea 1e4 --com 900 0 0", "(not written): body platform has its centre"),
        ("seecr new hall.txt --points points.csv", "hall.txt: expected the name of an MJCF file"),
        ("seecr new hall.xml", "expected one of --points POINTS.csv, --from caspr BODIES.xml"),
        ("seecr new hall.xml --from caspr points.csv", "expected BODIES.xml CABLES.xml after"),
        ("seecr new hall.xml --from wirex points.csv", "points.csv: line 1: is no XML: syntax "),
        (f"{NEW} --set basic --mass 1 --ea 1", "--set is for --from caspr"),
        ("seecr new hall.xml --points no.csv", "no.csv: no such file"),
    ],
)  # fmt: skip
def test_bad_input_is_one_sentence_and_writes_nothing(words: str, told: str) -> None:
    Path("high.csv").write_text(POINTS.replace("6,4,3", "6,4,5"))
    before = set(Path().iterdir())
    assert told in refused_in_a_line(words)
    assert set(Path().iterdir()) == before


def test_no_file_that_is_read_is_replaced() -> None:
    bodies, cables = caspr_files(Path(), "cogiro")
    before = bodies.read_text()
    words = f"seecr new ./{bodies} --from caspr {bodies} {cables} --ea 1e5 --force"
    assert "is read here; expected the name of another file" in refused_in_a_line(words)
    assert bodies.read_text() == before


def test_a_file_that_is_there_stays_unless_it_is_said() -> None:
    Path("hall.xml").write_text("mine")
    assert "hall.xml: is there already; expected a new name, or --force" in refused_in_a_line(NEW)
    assert Path("hall.xml").read_text() == "mine"
    ran(f"{NEW} --mass 25 --ea 3e5 --force", 0)
    ran(f"{NEW} --mass 25 --ea 3e5 --out there", 0)
    assert seecr.load_robot("there/hall.xml").mass == seecr.load_robot("hall.xml").mass == 25.0
