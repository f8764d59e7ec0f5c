"""Lines that no winch drives: elastic bands, springs that also push, counterweights.

An MJCF names them in its custom texts::

    <custom>
      <text name="passive" data="band1 band2"/>
      <text name="constant_tension" data="line7=40N"/>
    </custom>

The rest length of a passive line never changes. A line of constant tension, such as one over a
pulley to a counterweight, pulls with that force at any length. A tendon with two equal numbers,
``springlength="l0 l0"``, is a spring that pushes where it is shorter, and passive, too: no winch
can push.
"""

from __future__ import annotations

import difflib
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from seecr.errors import InputError
from seecr.pose import LARGEST, Array
from seecr.units import UNITS, number_and_unit

if TYPE_CHECKING:
    import mujoco

    from seecr.description.mjcf_text import MjcfText
    from seecr.description.robot import Robot

PASSIVE, CONSTANT = "passive", "constant_tension"
"""Names of the custom texts."""

_FORCES = {unit.suffix: unit for unit in UNITS if unit.si == "N"}
# A unit after a space belongs to the number before it.
_SPACED = re.compile(rf"(?<=[\d.])\s+(?=(?:{'|'.join(_FORCES)})(?:[\s,]|$))")


@dataclass(frozen=True, eq=False)
class Kinds:
    """Of m lines: whether winches drive them, and what springs they are; see :class:`Robot`."""

    driven: NDArray[np.bool_]
    pushes: NDArray[np.bool_]
    constant_tension_N: Array


def kinds_of(
    model: mujoco.MjModel, names: Sequence[str], text: MjcfText | None,
    also: Iterable[str] | str = (),
) -> tuple[Kinds, list[str]]:  # fmt: skip
    """What the lines of a compiled model are, and what is wrong with its texts and with ``also``.

    Args:
        model: as compiled. names: of its m tendons.
        text: its file; without one a tendon with one length is a spring that pushes, as in MuJoCo.
        also: names of further passive lines.

    Raises:
        InputError: ``also`` is not names.
    """
    faults: list[str] = []
    tensions = _tensions(_text(model, CONSTANT), names, faults)
    named, more = _text(model, PASSIVE).replace(",", " ").split(), _words_of(also)
    _find_faults(named, f'<text name="{PASSIVE}">', names, faults)
    _find_faults(more, "passive", names, faults)
    constant = np.array([tensions.get(name, 0.0) for name in names])
    still = np.array([name in (*named, *more) for name in names], dtype=bool) | (constant > 0.0)
    low, high = model.tendon_lengthspring.T
    pushes = (constant == 0.0) & (low == high) & (high > 0.0)
    if text is not None:  # MuJoCo's numbers are the same if one or none is written
        for i in np.flatnonzero(pushes):
            pushes[i] = len((text.attribute(int(i), "springlength") or "").split()) == 2
    return Kinds(~(still | pushes), pushes, constant), faults


def _text(model: mujoco.MjModel, name: str) -> str:
    """A custom text of the model; "" without one."""
    for k in range(model.ntext):
        if _at(model.names, int(model.name_textadr[k])) == name:
            return _at(bytes(model.text_data), int(model.text_adr[k]))
    return ""


def _at(data: bytes, first: int) -> str:
    """The text that begins at a byte of MuJoCo's."""
    return data[first:].split(b"\0", 1)[0].decode("utf-8", "replace")


def _words_of(also: Iterable[str] | str) -> list[str]:
    names = [also] if isinstance(also, str) else list(also)
    if not all(isinstance(name, str) for name in names):
        raise InputError(f"passive: expected names of lines, got {also!r}")
    return names


def _find_faults(words: list[str], where: str, names: Sequence[str], faults: list[str]) -> None:
    for word in dict.fromkeys(words):
        if word not in names:
            near = difflib.get_close_matches(word, names, n=max(1, len(names)), cutoff=0.0)
            faults.append(f"{where}: no tendon {word}; expected one of {', '.join(near)}")
        elif words.count(word) > 1:
            faults.append(f"{where}: {word} is named {words.count(word)} times; expected it once")


def _tensions(text: str, names: Sequence[str], faults: list[str]) -> dict[str, float]:
    """Tensions [N] of lines in a text such as ``line7=40N line8=0.02kN``."""
    where, found = f'<text name="{CONSTANT}">', {}
    tight = _SPACED.sub("", re.sub(r"\s*=\s*", "=", text)).replace(",", " ").split()
    pairs = [part.partition("=") for part in tight]
    _find_faults([name for name, _sign, _force in pairs], where, names, faults)
    for name, _sign, given in pairs:
        force = _force(given)
        if isinstance(force, str):
            faults.append(f"{where}: {name}: {force}")
        else:
            found[name] = force
    return found


def _force(given: str) -> float | str:
    """A force [N] of text, or what is wrong with it."""
    expected = "expected a force such as 40N"
    typed = number_and_unit(given)
    if typed is None:
        return f"{expected}, got {given!r}" if given else f"{expected} after =, got none"
    number, unit = typed
    if unit not in _FORCES:
        what = f"unknown unit {unit!r}" if unit else f"{given} has no unit"
        return f"{what}; {expected}, in {', '.join(_FORCES)}"
    force = _FORCES[unit].to_si(number)
    if not 0.0 < force <= LARGEST:
        return f"{expected} above zero, since a line cannot push, got {given}"
    return force


# The same, to be written.


def springlength(robot: Robot, i: int) -> tuple[float, float]:
    """``springlength`` of a tendon that is line i of a robot [m]."""
    rest = float(robot.rest_lengths[i])
    return (rest if robot.pushes[i] else 0.0), rest


def declare(path: Path, robot: Robot) -> None:
    """Rewrite an MJCF so that it names the passive lines of its robot; comments stay."""
    keeping = ET.XMLParser(target=ET.TreeBuilder(insert_comments=True))
    tree = ET.parse(path, keeping)
    write_kinds(tree.getroot(), robot)
    tree.write(path, encoding="utf-8")


def write_kinds(root: ET.Element, robot: Robot) -> None:
    """Add the custom texts about a robot's lines to an MJCF; those that it has are replaced."""
    # a line's own tension, as ``stiffness`` is its own
    pulls = zip(robot.cable_names, robot.constant_tension_N / robot.falls, strict=True)
    constant = {name: float(force) for name, force in pulls if force > 0.0}
    texts = {
        PASSIVE: " ".join(name for name in robot.passive_names if name not in constant),
        CONSTANT: " ".join(f"{name}={force!r}N" for name, force in constant.items()),
    }
    for custom in root.findall("custom"):
        for old in [one for one in custom.findall("text") if one.get("name") in texts]:
            custom.remove(old)
    if not any(texts.values()):
        return
    custom = ET.SubElement(root, "custom")
    for name, data in texts.items():
        if data:
            ET.SubElement(custom, "text", name=name, data=data)


def write_pull(root: ET.Element, tendon: str, force: float) -> None:
    """Let MuJoCo pull a tendon with a constant force [N]: by an actuator, since it is no spring."""
    actuator = root.find("actuator")
    actuator = ET.SubElement(root, "actuator") if actuator is None else actuator
    ET.SubElement(
        actuator, "general", name=f"{tendon} pull", tendon=tendon, gear="-1", gainprm="0",
        biastype="affine", biasprm=repr(force),
    )  # fmt: skip
