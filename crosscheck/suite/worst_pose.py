"""The pose of a run that deserves a look in MuJoCo's viewer, as an MJCF with a keyframe."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from crosscheck.suite.results import CaseResult, worst_of
from crosscheck.suite.verdicts import FINDINGS, UNSOLVED, Verdict
from seecr.errors import InputFileError
from seecr.files import written
from seecr.pose import Array

__all__ = ["FILE_NAME", "KEYFRAME", "worst_pose", "write_worst_pose", "write_worst_pose_mjcf"]

KEYFRAME = "worst"
FILE_NAME = "worst_pose.xml"


def worst_pose(results: Sequence[CaseResult]) -> tuple[CaseResult, int]:
    """The case and pose farthest beyond its thresholds; else an unsolved one; else the nearest."""
    worst = worst_of(results)
    if worst is None or worst[1].ratio <= 1.0:
        for kinds in ((Verdict.DIFFERS, *FINDINGS), UNSOLVED):
            for result in results:
                poses = [one.pose for one in result.findings if one.fails and one.verdict in kinds]
                if poses:
                    return result, poses[0]
    if worst is None:
        return results[0], 0
    return worst[0], worst[1].pose


def write_worst_pose(results: Sequence[CaseResult], folder: Path) -> str:
    """Write its MJCF into a folder; returns a sentence about what it shows."""
    result, i = worst_pose(results)
    mujoco, settling = result.mujoco_robot(), result.settling[i]
    if settling.settled:
        qpos, state = settling.qpos, "as MuJoCo found it at rest"
    else:
        qpos, state = mujoco.qpos(result.case.poses[i]), "as commanded, since MuJoCo did not settle"
    lengths = result.mujoco_rest_lengths[i]
    try:
        write_worst_pose_mjcf(
            result.case.mujoco_model, qpos, lengths, mujoco.settler.ea, folder / FILE_NAME
        )
    except InputFileError as error:  # a robot in several files can be run, but not rewritten
        return f"There is no `{FILE_NAME}`: {error}."
    return f"`{FILE_NAME}` opens in MuJoCo's viewer at pose {i} of {result.case.name}, {state}."


def write_worst_pose_mjcf(
    model_path: str | Path, qpos: Array, rest_lengths: Array, ea: Array, path: str | Path
) -> None:
    """Copy an MJCF with other rest lengths and stiffnesses, and a keyframe ``worst``.

    The XML tree is edited, since MuJoCo's own writer keeps six digits only, which moves the
    platform by half a micrometre. An ``<include>`` stays, with an absolute path; a robot whose
    tendons are in another file is therefore refused.

    Args:
        model_path: the robot's MJCF.
        qpos: (nq,) MuJoCo's coordinates of the pose.
        rest_lengths: (m,) [m].
        ea: (m,) [N].
        path: the file to write, through a temporary one.

    Raises:
        InputFileError: the MJCF cannot be read, or does not itself have m tendons.
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
    """Make paths of meshes, textures and includes independent of the file's folder."""
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
