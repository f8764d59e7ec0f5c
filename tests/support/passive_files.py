"""The shipped files with passive lines, and where they rest by nothing but SciPy.

The energies are written here from the XML, not from what the packages read: weight, springs that
pull, springs that push too, and T l of a constant tension.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
from scipy.optimize import minimize, root
from scipy.spatial.transform import Rotation

from seecr.description.mjcf import model_path

FOLDER = model_path("camera").parents[1] / "passive_lines"
KINDS = ("band", "spring", "counterweight")
LINE = {"band": "band", "spring": "spring", "counterweight": "weight"}


def _numbers(element: ET.Element | None, name: str) -> np.ndarray:
    assert element is not None
    return np.array(element.get(name, "").split(), dtype=float)


class Energy:
    """The energy [J] of a platform on the lines of a file, by its coordinates (d,)."""

    def __init__(self, path: Path) -> None:
        root = ET.parse(path).getroot()
        body = root.find("worldbody/body")
        assert body is not None
        self.home = _numbers(body, "pos")
        self.planar = body.find("freejoint") is None
        inertial = body.find("inertial")
        self.mass, self.centre = _numbers(inertial, "mass")[0], _numbers(inertial, "pos")
        sites = {site.get("name"): _numbers(site, "pos") for site in root.iter("site")
                 if site.get("name")}  # fmt: skip
        texts = {t.get("name"): t.get("data", "") for t in root.findall("custom/text")}
        self.lines = []
        for tendon in root.findall("tendon/spatial"):
            ends = [sites[site.get("site")] for site in tendon.findall("site")]
            length = _numbers(tendon, "springlength")
            self.lines.append((tendon.get("name"), *ends, length, _numbers(tendon, "stiffness")))
        self.force = {}
        for pair in texts.get("constant_tension", "").split():
            name, force = pair.split("=")
            self.force[name] = float(force.removesuffix("N"))
        pushing = [name for name, *_, long, _k in self.lines if len(long) and long[0] > 0.0]
        self.still = {*texts.get("passive", "").split(), *self.force, *pushing}

    def placed(self, x: np.ndarray) -> tuple[np.ndarray, Rotation]:
        if self.planar:  # slides along x and z, then a hinge about y
            return self.home + np.array([x[0], 0.0, x[1]]), Rotation.from_rotvec([0.0, x[2], 0.0])
        return self.home + x[:3], Rotation.from_rotvec(x[3:])

    def lengths(self, x: np.ndarray) -> np.ndarray:
        place, turn = self.placed(x)
        return np.array([np.linalg.norm(place + turn.apply(b) - a) for _n, a, b, *_ in self.lines])

    def told(self, command: np.ndarray) -> np.ndarray:
        """Rest lengths (m,) [m] as the winches pay them out for a command (d,)."""
        change = self.lengths(command) - self.lengths(np.zeros_like(command))
        own = np.array([long[-1] if len(long) else np.nan for *_, long, _k in self.lines])
        driven = np.array([name not in self.still for name, *_ in self.lines])
        return own + np.where(driven, change, 0.0)

    def at(self, x: np.ndarray, rest: np.ndarray) -> float:
        place, turn = self.placed(x)
        total = 9.81 * self.mass * (place + turn.apply(self.centre))[2]
        for (name, _a, _b, long, k), now, l0 in zip(self.lines, self.lengths(x), rest, strict=True):
            if name in self.force:
                total += self.force[name] * now
                continue
            stretch = now - l0
            # stiffness is that at the length in the file: E S over the length paid out
            if stretch > 0.0 or long[0] > 0.0:
                total += 0.5 * k[0] * long[-1] / l0 * stretch**2
        return float(total)

    def slope(self, x: np.ndarray, rest: np.ndarray) -> np.ndarray:
        """The energy's slope by central differences, (d,) [N, N m]."""
        steps = 1e-5 * np.eye(len(x))
        return np.array([self.at(x + s, rest) - self.at(x - s, rest) for s in steps]) / 2e-5

    def rest(self, command: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Position (3,), rotation vector (3,) and tensions (m,) where a command (d,) leads."""
        rest, x = self.told(command), np.array(command, dtype=float)
        x = minimize(self.at, x, (rest,), "BFGS", options={"gtol": 1e-6}).x
        # its one-sided differences end a micrometre off: from there the slope is to vanish
        x = root(self.slope, x, (rest,), options={"xtol": 1e-13}).x
        place, turn = self.placed(x)
        pulls = []
        for (name, _a, _b, long, k), now, l0 in zip(self.lines, self.lengths(x), rest, strict=True):
            if name in self.force:
                pulls.append(self.force[name])
            else:
                pull = k[0] * long[-1] / l0 * (now - l0)
                pulls.append(pull if long[0] > 0.0 else max(pull, 0.0))
        return place, turn.as_rotvec(), np.array(pulls)

    def pose(self, x: np.ndarray) -> np.ndarray:
        place, turn = self.placed(x)
        return np.concatenate([place, turn.as_quat()[[3, 0, 1, 2]]])
