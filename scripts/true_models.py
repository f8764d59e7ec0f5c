"""Models that hold what was hidden in the shared cases, from their ``answers.json``.

The answers name values as their simulator does. Its gravity leans where our frame does the
opposite, its friction does not fade (a third number, which is zero), and its frames yield alike
to both sides.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seecr.description.robot import Robot
from seecr.effects import Term, Terms, layout_of

# The answers' name of a value, the effect that it is of, and the first of its parameters there.
_VALUES = {
    "anchor_err": ("anchor_point_error", 0),
    "com": ("centre_of_mass", 0),
    "drum_gain": ("drum_gain", 0),
    "ea_scale": ("stiffness", 0),
    "exit_err": ("exit_point_error", 0),
    "frame_comp": ("frame_compliance", 0),
    "home_error": ("initial_pose_error", 0),
    "hyst": ("hysteresis", 0),
    "l0_offset": ("cable_length_offset", 0),
    "mass_add": ("platform_mass", 0),
    "pulley_r": ("pulley_radius", 0),
    "quad": ("nonlinear_elasticity", 0),
    "target_rot": ("tracker_target", 3),
    "target_t": ("tracker_target", 0),
    "tilt": ("gravity_tilt", 0),
    "track_rot": ("tracker_frame", 3),
    "track_t": ("tracker_frame", 0),
    "w_true": ("cable_weight", 0),
    "wrench": ("external_wrench", 0),
}


def is_known(values: Mapping[str, Any]) -> bool:
    """Whether the catalogue holds all that was hidden."""
    return values.keys() <= _VALUES.keys()


def true_terms(values: Mapping[str, Any], robot: Robot) -> Terms:
    """The effects of an answer with the values that were hidden."""
    vectors: dict[str, NDArray[np.float64]] = {}
    for key, value in values.items():
        effect, first = _VALUES[key]
        layout = layout_of(effect, robot)
        vector = vectors.setdefault(effect, layout.null.copy())
        numbers = _as_ours(key, np.ravel(value))
        vector[first : first + len(numbers)] = numbers
    return Terms(Term(layout_of(name, robot), vector) for name, vector in vectors.items())


def _as_ours(key: str, numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    """The numbers of a value as parameters of our effect."""
    if key == "tilt":
        return -numbers
    if key == "frame_comp":
        return numbers[[0, 2]]
    return numbers[:2] if key == "hyst" else numbers


def as_toml(terms: Terms) -> str:
    """Such effects as a model file."""
    blocks = [
        "\n".join(
            [
                "[[effect]]",
                f'name = "{term.name}"',
                "[effect.parameters]",
                *(
                    f"{key} = {value!r}"
                    for key, value in zip(term.layout.names, term.vector.tolist(), strict=True)
                ),
            ]
        )
        for term in terms
    ]
    return "\n\n".join(["format = 1", *blocks, ""])
