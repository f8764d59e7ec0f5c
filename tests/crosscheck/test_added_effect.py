"""An effect is one class: declared here alone, it is predicted, fitted, diagnosed and added."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from made_data import measured

import seecr
from crosscheck.add import add_effect
from crosscheck.diagnosis.diagnose import diagnose
from crosscheck.model.write import Provenance, save_model, with_fit
from seecr.effects import registry
from seecr.pose import quat_from_rotvec, quat_rotate
from seecr.prediction.model import new_model


@dataclass(frozen=True, eq=False)
class MountedTurned(seecr.Effect):
    """The platform was mounted turned about its own vertical: its anchor points all turn."""

    name: ClassVar[str] = "mounted_turned"
    place: ClassVar[str] = "geometry"
    title: ClassVar[str] = "a platform mounted turned"
    advice: ClassVar[str] = "hold a square to the platform: expect {angle:.2f} deg"

    angle: float = seecr.parameter("rad", 0.01)

    def edit_setup(self, setup: seecr.Setup) -> None:
        turn = quat_from_rotvec(np.array([0.0, 0.0, self.angle]))
        setup.anchor_points = quat_rotate(turn, setup.anchor_points)


@pytest.fixture
def registered(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """As an installed package's entry point."""
    entry = EntryPoint("mounted_turned", f"{__name__}:MountedTurned", "seecr.effects")
    monkeypatch.setattr(EntryPoint, "load", lambda _entry: MountedTurned)
    monkeypatch.setattr(registry, "entry_points", lambda group: EntryPoints([entry]))
    registry.catalogue.cache_clear()
    yield
    registry.catalogue.cache_clear()


def test_one_class_is_all_it_takes(registered: None, tmp_path: Path) -> None:
    robot = seecr.load_robot(seecr.model_path("demobot_cogiro"))
    truth = seecr.Term.of(robot, "mounted_turned", angle_rad=0.004)
    data = measured(robot, [truth], points=6)
    found = add_effect(robot, data, "mounted_turned")
    angle, error = found.own.term.vector[0], found.own.stderr[0]
    assert found.pays and abs(angle - 0.004) < 4.0 * error < 2e-3
    assert found.after["orientation_rms_rad"] < found.before["orientation_rms_rad"]
    # a diagnosis names it among others
    diagnosis = diagnose(robot, data, only=("mounted_turned", "pulley_radius", "tracker_scale"))
    assert [missing.effect for missing in diagnosis.missing] == ["mounted_turned"]
    (missing,) = diagnosis.missing
    assert missing.values == pytest.approx([0.004], abs=4.0 * missing.stderr[0])
    expected = np.degrees(missing.values[0])
    assert missing.check == f"hold a square to the platform: expect {expected:.2f} deg"
    # and a model keeps it
    errors = {"before": found.before, "after": found.after, "held_out": found.held_out}
    source = Provenance("measured.csv", "2026-01-01", "1", "a test")
    model = with_fit(new_model(robot), found.fitted, ["mounted_turned"], source, errors)
    save_model(tmp_path / "m.toml", model)
    again = seecr.load_model(tmp_path / "m.toml", robot)
    assert again.terms.labels == (("mounted_turned", "angle_rad"),)
    assert again.terms.vector == pytest.approx([angle])
    poses = [[0.3, 0.2, 0.1, 1, 0, 0, 0]]
    moved = seecr.predict(robot, poses, again).pose - seecr.predict(robot, poses).pose
    assert np.abs(moved).max() > 1e-4
