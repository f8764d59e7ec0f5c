"""The safe aim keeps tensions inside limits, as often as models drawn from the covariance say."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from calibrated import KEPT, MODEL, POSES, ROBOT, model_of
from called import ran, refused_in_a_line

import seecr
from seecr.pose import Array

# Tensions can be 0.53 N or more at the first pose; their errors are 0.04 N.
LOWEST = 0.41


def kept(model: seecr.Model, commands: seecr.Commands, lowest: float, highest: float) -> Array:
    """How many of 300 models drawn from the covariance keep all tensions within limits."""
    sizes = np.concatenate([model.stderr[name] for name in model.terms.names])
    labels = [effect for effect, _key in model.terms.labels]
    correlation = np.eye(len(labels))
    a, b = labels.index("platform_mass"), labels.index("stiffness")
    correlation[a, b] = correlation[b, a] = 0.5  # as KEPT says
    vectors = np.random.default_rng(3).multivariate_normal(
        model.terms.vector, correlation * np.outer(sizes, sizes), 300
    )
    seen = []
    for vector in vectors:
        pulls = seecr.solve(ROBOT, commands, effects=model.terms.with_vector(vector)).tensions
        seen.append(((pulls >= lowest) & (pulls <= highest)).all(axis=1))
    return np.asarray(np.mean(seen, axis=0))


@pytest.mark.parametrize(
    ("lowest", "edge_has", "safe_has"), [(0.36, 0.9, 0.97), (LOWEST, 0.55, 0.87)]
)
def test_the_default_keeps_away_from_the_limits(
    tmp_path: Path, lowest: float, edge_has: float, safe_has: float
) -> None:
    """It was at the edge; with the second limit there is less room than would be safe."""
    model, highest = model_of(tmp_path, MODEL + KEPT), 1.6
    limits = {"lowest": lowest, "highest": highest}
    edge = seecr.correct(ROBOT, POSES, effects=model, aim="minimum", **limits)
    safe = seecr.correct(ROBOT, POSES, effects=model, **limits)
    assert edge.reached.all() and safe.reached.all()
    assert kept(model, edge.commands, lowest, highest).min() < edge_has
    assert kept(model, safe.commands, lowest, highest).min() > safe_has
    said = seecr.kept_chance(ROBOT, safe.commands, model, **limits)
    assert said is not None and said.min() > safe_has


def test_hysteresis_adds_to_the_margin(tmp_path: Path) -> None:
    model = model_of(tmp_path, MODEL + KEPT)
    more = model.terms.with_term(seecr.Term(seecr.layout_of("hysteresis", ROBOT), [0.03, 1e-4]))
    sticky = replace(model, terms=more)
    plain, wider = (
        seecr.correct(ROBOT, seecr.Commands(POSES[:1]), effects=one, lowest=0.33)
        for one in (model, sticky)
    )
    least = [found.solution.tensions.min() for found in (plain, wider)]
    assert wider.reached.all() and 0.01 < least[1] - least[0] < 0.03 + 1e-3


def test_without_a_covariance_the_smallest_tensions_are_taken(tmp_path: Path) -> None:
    model = model_of(tmp_path, MODEL)
    for effects in ((), model):
        safe, least = (
            seecr.correct(ROBOT, POSES, effects=effects, lowest=LOWEST, aim=aim)
            for aim in ("safe", "minimum")
        )
        assert np.array_equal(safe.lengths, least.lengths)
    with pytest.raises(seecr.InputError, match="one of safe, minimum, middle or tensions"):
        seecr.correct(ROBOT, POSES, aim="most")


def test_where_limits_leave_no_room_the_largest_part_of_it_is_taken(tmp_path: Path) -> None:
    model = model_of(tmp_path, MODEL + KEPT)
    pulls = seecr.correct(ROBOT, POSES, effects=model, lowest=LOWEST).solution.tensions
    for highest in (1.02 * pulls.max(), pulls.max()):
        limits = {"lowest": LOWEST, "highest": float(highest)}
        chances = [
            seecr.kept_chance(ROBOT, found.commands, model, **limits)
            for aim in ("safe", "minimum")
            if (found := seecr.correct(ROBOT, POSES, effects=model, aim=aim, **limits)).held.all()
        ]
        assert len(chances) == 2 and np.all(chances[0] >= chances[1])


def test_a_grid_is_a_look_up_table(tmp_path: Path) -> None:
    out = tmp_path / "table"
    ran(f"seecr correct demobot_cogiro --grid 0.3:0.5:3 0.2:0.3:2 0.1:2:2 --highest 3 --out {out}")
    with (out / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    lengths = [f"length_{k}_m" for k in range(1, 9)]
    assert list(rows[0]) == ["x_m", "y_m", "z_m", *lengths, "reached"]
    places = [tuple(float(row[f"{axis}_m"]) for axis in "xyz") for row in rows]
    x, y, z = [0.3, 0.4, 0.5], [0.2, 0.3], [0.1, 2.0]
    assert places == [(a, b, c) for a in x for b in y for c in z]
    # above the frame nothing holds
    assert [row["reached"] for row in rows] == ["1", "0"] * 6
    there = [k for k, row in enumerate(rows) if row["reached"] == "1"]
    told = np.array([[float(rows[k][name]) for name in lengths] for k in there])
    want = np.array([[*places[k], 1.0, 0.0, 0.0, 0.0] for k in there])
    rest = seecr.solve(ROBOT, seecr.Commands(want, lengths=told, told=True))
    assert np.abs(rest.pose[:, :3] - want[:, :3]).max() < 1e-6
    # a later list of poses leaves no stale table
    poses = tmp_path / "poses.csv"
    poses.write_text("cmd_x_m,cmd_y_m,cmd_z_m\n0.4,0.25,0.15\n")
    ran(f"seecr correct demobot_cogiro {poses} --out {out}", 0)
    assert not (out / "table.csv").exists() and (out / "corrected.csv").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("", "expected one of POSES.csv, --line, --grid; got none"),
        ("{poses} --grid 0 0 0", "got POSES.csv and --grid"),
        ("--grid 0:1 0 0.1", "--grid: expected FIRST:LAST:COUNT"),
        ("--grid 400:500:3 0 0.1", "X: expected metres"),
        ("{poses} --turned 1 0 0 0", "--turned applies to --line and --grid"),
    ],
)
def test_what_is_no_grid_is_told(tmp_path: Path, words: str, said: str) -> None:
    poses = tmp_path / "poses.csv"
    poses.write_text("cmd_x_m,cmd_y_m,cmd_z_m\n0.4,0.25,0.15\n")
    given = f"seecr correct demobot_cogiro {words.format(poses=poses)} --out {tmp_path / 'o'}"
    assert said in refused_in_a_line(given)
    assert not (tmp_path / "o").exists()
