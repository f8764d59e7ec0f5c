"""Published robots settle in MuJoCo where SEECR says, along a sweep and at random poses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from published import caspr_files, wirex_file

from crosscheck import run_suite, user_cases
from crosscheck.suite.verdicts import Outcome
from seecr import correct
from seecr.importing.caspr import read_caspr
from seecr.importing.draft import Draft
from seecr.importing.wirex import read_wirex


def draft_of(folder: Path, name: str) -> Draft:
    if name == "hrpcables":
        return read_wirex(wirex_file(folder, name))
    return read_caspr(*caspr_files(folder, name), None).with_options(ea="1e5N")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cogiro", "kntu_planar", "example_spherical", "hrpcables"])
def test_a_published_robot_agrees_with_mujoco(name: str, tmp_path: Path) -> None:
    robot, _notes = draft_of(tmp_path, name).robot()
    if robot.joints:  # nothing loads these at home
        tight = correct(robot, robot.reference_pose[None], lowest=10.0).commands.lengths
        assert tight is not None
        robot = replace(robot, rest_lengths=tight[0])
    path = tmp_path / f"{name}.xml"
    robot.save(path)
    run = run_suite(user_cases(path, n_random=6))
    assert run.outcome is Outcome.AGREE
    assert all(result.compared.all() for result in run.results)
