"""Settings of firmware: robots of them, and the settings of robots."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from called import as_json, ran, refused_in_a_line

import seecr
from seecr.importing.firmware import FIRMWARE, firmware_text, read_firmware

# The anchors that RepRapFirmware has without M669, and Klipper's example-winch.cfg [mm].
ANCHORS = np.array([[0, -2000, -100], [2000, 1000, -100], [-2000, 1000, -100], [0, 0, 3000.0]])
REPRAP = """; settings
M669 K6 N4 P2000 A0:-2000:-100 B2000:1000:-100 C-2000:1000:-100 D0:0:3000 ; anchors
M666 Q0.0356 R65.2:65.1:65.3:64.7 U2:2:2:4 W2.5 S20000 I0:0:0:5 X70:70:60:120
"""
KLIPPER = "# winches\n[printer]\nkinematics: winch\n" + "".join(
    f"[stepper_{letter}]\nmicrosteps: 16\nanchor_x: {x:g}\nanchor_y = {y:g}\nanchor_z: {z:g}\n"
    for letter, (x, y, z) in zip("abcd", ANCHORS, strict=True)
)
# Of FluidNC's documentation.
MASLOW = """Maslow_vertical: {}
Maslow_tlX: -27.6
Maslow_tlY: 2064.9
Maslow_tlZ: 100.0
Maslow_trX: 2924.3
Maslow_trY: 2066.5
Maslow_blX: 0
Maslow_blY: 0
Maslow_brX: 2953.2
Maslow_brY: 0
"""


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_hangprinter_is_a_point_on_reeved_lines() -> None:
    """A line that runs U times, with E S of S, resists U S / l: each of its U parts S / l."""
    Path("config.g").write_text(REPRAP)
    robot, notes = read_firmware("reprap", Path("config.g")).robot()
    np.testing.assert_allclose(robot.exit_points, 1e-3 * ANCHORS)
    assert [joint.name for joint in robot.joints] == ["x", "y", "z"] and robot.mass == 2.5
    np.testing.assert_allclose(robot.ea, [40e3, 40e3, 40e3, 80e3])
    np.testing.assert_allclose(robot.reference_pose[:3], 0.0)
    np.testing.assert_allclose(robot.rest_lengths[3], 3.0)
    assert any("run to and fro as U of M666 says" in note for note in notes)
    # and rests by its uppermost line alone: m g = E S e / l of the others slack
    document = as_json("seecr new hp.xml --from reprap config.g")
    # the largest of U I, the least of U X
    assert document["tension_limits_N"] == [4 * 5.0, 2 * 60.0]
    assert document["home"]["pose"][2] == pytest.approx(-2.5 * 9.81 / 80e3 * 3.0, rel=1e-3)


def test_klippers_winches_and_older_heights() -> None:
    Path("printer.cfg").write_text(KLIPPER)
    klipper = read_firmware("klipper", Path("printer.cfg"))
    np.testing.assert_allclose(klipper.exit_points, 1e-3 * ANCHORS)
    assert klipper.cable_names == ("line_a", "line_b", "line_c", "line_d")
    Path("old.g").write_text(REPRAP.replace("D0:0:3000", "D3000").partition("M666")[0])
    old = read_firmware("reprap", Path("old.g"))
    np.testing.assert_allclose(old.exit_points, klipper.exit_points)
    said = refused_in_a_line("seecr new x.xml --from klipper printer.cfg")
    assert "does not say the platform's mass" in said and "how far its cables stretch" in said


@pytest.mark.parametrize(("upright", "plane", "axis"), [("true", "xz", 2), ("false", "xy", 1)])
def test_maslow_is_a_point_in_its_plane(upright: str, plane: str, axis: int) -> None:
    Path("maslow.yaml").write_text(MASLOW.format(upright))
    ran("seecr new m.xml --from maslow maslow.yaml --mass 8kg --ea 50kN --pretension 20", 0)
    robot = seecr.load_robot("m.xml")
    assert "".join(joint.name for joint in robot.joints) == plane
    np.testing.assert_allclose(robot.exit_points[:, 0], [-0.0276, 2.9243, 0, 2.9532], atol=1e-12)
    np.testing.assert_allclose(robot.exit_points[:, axis], [2.0649, 2.0665, 0, 0], atol=1e-12)
    # and what was calibrated goes back
    errors = [f"error_{i}_{a}_m = {0.002 * (i == 2 and a == 'x')}" for i in (1, 2, 3, 4)
              for a in "xyz"]  # fmt: skip
    model = f'[[effect]]\nname = "exit_point_error"\nparameters = {{ {", ".join(errors)} }}\n'
    Path("m.toml").write_text(model)
    said = ran("seecr export m.xml new.xml --model m.toml --firmware maslow", 0).stdout
    assert "new-maslow.yaml has the exit points for maslow" in said
    again = read_firmware("maslow", Path("new-maslow.yaml")).exit_points
    np.testing.assert_allclose(again[:, :2], robot.exit_points[:, [0, axis]] + [
        [0, 0], [0.002, 0], [0, 0], [0, 0]], atol=1e-6)  # fmt: skip
    # a file of the user's own stays
    Path("new-maslow.yaml").write_text("mine")
    refused = refused_in_a_line("seecr export m.xml new.xml --firmware maslow")
    assert "new-maslow.yaml: is of no export" in refused
    assert Path("new-maslow.yaml").read_text() == "mine"


@pytest.mark.parametrize("kind", FIRMWARE)
def test_settings_are_read_back(kind: str) -> None:
    points = np.random.default_rng(0).normal(size=(4, 3)) * (1 if kind != "maslow" else [1, 1, 0])
    Path("settings").write_text(firmware_text(kind, points))
    np.testing.assert_allclose(read_firmware(kind, Path("settings")).exit_points, points, atol=1e-6)
    with pytest.raises(seecr.InputError, match="exit points"):
        firmware_text(kind, np.zeros((9, 3)))


@pytest.mark.parametrize(
    ("kind", "text", "told"),
    [
        ("reprap", "G28\n", ["has no anchors; expected a line such as M669 K6 A0:-2000:-100"]),
        ("klipper", "[stepper_x]\n", ["has no anchors; expected sections [stepper_a] with anchor"]),
        ("klipper", KLIPPER.replace("anchor_z: -100", "", 1).replace("x: 2000", "x: a"),
         ["line 6: anchor a: expected x, y and z [mm], got 0 -2000", "anchor b: expected x, y"]),
        ("reprap", REPRAP.replace("B2000:1000:-100", "B2000:1000"),
         ["line 2: anchor B: expected x, y and z [mm], got 2000 1000"]),
        ("maslow", MASLOW.replace("Maslow_brX: 2953.2\n", "").replace("Maslow_brY: 0\n", ""),
         ["anchor br: expected x, y and z [mm], got none"]),
    ],
)  # fmt: skip
def test_what_is_no_settings_is_told(kind: str, text: str, told: list[str]) -> None:
    Path("settings").write_text(text)
    with pytest.raises(seecr.InputFileError) as caught:
        read_firmware(kind, Path("settings"))
    assert all(one in str(caught.value) for one in told), str(caught.value)
