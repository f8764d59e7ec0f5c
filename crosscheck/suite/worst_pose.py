"""An MJCF of one pose, to open in MuJoCo's viewer: springs as they were, a keyframe at rest."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from crosscheck.errors import InputFileError
from crosscheck.files import written
from seecr.pose import Array

KEYFRAME = "worst"


def write_worst_pose_mjcf(
    model_path: str | Path, qpos: Array, rest_lengths: Array, ea: Array, path: str | Path
) -> None:
    """Copy an MJCF with other rest lengths and stiffnesses, and a keyframe ``worst``.

    The XML tree is edited rather than MuJoCo's own writer used: that one writes six digits,
    which moves the platform by half a micrometre. An ``<include>`` stays, its path made
    absolute, so a robot whose tendons are in another file is refused.

    Args:
        model_path: the robot's MJCF.
        qpos: (nq,) MuJoCo's coordinates of the pose.
        rest_lengths: (m,) [m].
        ea: (m,) [N].
        path: the file to write, through a temporary one.

    Raises:
        InputFileError: the MJCF cannot be read, or has not m tendons itself.
    """
    model_path, path = Path(model_path), Path(path)
    try:
        tree = ET.parse(model_path)
    except (OSError, ET.ParseError) as error:
        raise InputFileError(f"{model_path}: cannot read this as XML: {error}") from None
    root = tree.getroot()
    _set_springs(root, np.asarray(rest_lengths, float), np.asarray(ea, float), model_path)
    _make_paths_absolute(root, model_path.resolve().parent)
    for old in root.findall("keyframe"):
        root.remove(old)  # MuJoCo opens the first keyframe; it has to be this one
    ET.SubElement(
        ET.SubElement(root, "keyframe"), "key", name=KEYFRAME, qpos=_numbers(np.asarray(qpos))
    )
    ET.indent(tree)
    with written(path, failure="cannot write the MJCF") as (partial,):
        tree.write(partial, encoding="utf-8")


def _set_springs(root: ET.Element, rest_lengths: Array, ea: Array, path: Path) -> None:
    tendons = root.findall("tendon/spatial")
    if len(tendons) != len(rest_lengths):
        raise InputFileError(
            f"{path}: expected {len(rest_lengths)} <spatial> tendons in the file itself, got "
            f"{len(tendons)}; put included tendons into it"
        )
    for tendon, rest, stiff in zip(tendons, rest_lengths, ea, strict=True):
        tendon.set("springlength", _numbers(np.array([0.0, rest])))
        tendon.set("stiffness", repr(float(stiff / rest)))


def _make_paths_absolute(root: ET.Element, folder: Path) -> None:
    """Keep meshes, textures and includes found from another folder."""
    for include in root.iter("include"):
        include.set("file", str(folder / include.get("file", "")))
    compilers = root.findall("compiler")
    assets = [a for a in root.iter() if a.tag in _ASSETS and a.get("file")]
    if not assets:
        return
    compiler = compilers[0] if compilers else ET.SubElement(root, "compiler")
    for name in ("assetdir", "meshdir", "texturedir"):
        own = compiler.get(name)
        if own is not None or (name == "assetdir"):
            compiler.set(name, str(folder / (own or "")))


_ASSETS = {"mesh", "texture", "hfield", "skin", "model"}


def _numbers(values: Array) -> str:
    return " ".join(repr(float(v)) for v in values)
