"""Values print to the digits that are known, in the units that people read."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import seecr
from crosscheck.model.fitted import Fitted
from seecr.units import measured

ROBOT = seecr.load_robot("demobot_cogiro")


def test_a_value_has_the_digits_of_its_error() -> None:
    assert measured(0.0083702, 1.3e-5, "m") == "8.370 ± 0.013 mm"
    assert measured(0.0083702, np.inf, "m") == "not determined by these data"
    assert measured(0.0083702, 0.0, "m") == "8.37 mm (fixed)"
    assert measured(np.deg2rad(1.5), np.deg2rad(0.12), "rad") == "1.50 ± 0.12 deg"


def test_models_terms_and_fits_print_alike(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text(
        '[[effect]]\nname = "pulley_radius"\n[effect.parameters]\n'
        "radius_m = { value = 0.0083702, stderr = 1.3e-5 }\n"
        '[[effect]]\nname = "stiffness"\n[effect.parameters]\n'
        "factor = { value = 0.91, fixed = true }\n",
        encoding="utf-8",
    )
    model = seecr.load_model(path, ROBOT)
    text = str(model)
    assert "pulley_radius: radius = 8.370 ± 0.013 mm" in text
    assert "stiffness: factor = 0.91 (fixed)" in text
    term = model.terms["pulley_radius"]
    assert repr(term) == "pulley_radius: radius = 8.37 mm"
    fitted = Fitted(term, np.array([1.3e-5]), np.array([False]))
    assert repr(fitted) == "pulley_radius: radius = 8.370 ± 0.013 mm"
    gains = seecr.Term.of(ROBOT, "drum_gain", gain_2=0.001)
    assert repr(gains) == "drum_gain: gain_1 = 0, gain_2 = 0.001, gain_3 = 0, gain_4 = 0 and 4 more"
    assert repr(gains.layout).startswith("Layout(drum_gain: gain_1, gain_2")
