"""Faults planted in lines of the code: a check against something independent goes red for each.

The checks compare with MuJoCo, with finite differences, with whole covariances or with numbers that
went into the data. Faults of compiled functions are planted in the Python that they are made of.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_data import SIGMA, measured, soft_cogiro, term
from mujoco_modes import mujocos_modes
from planted import COMPILED, plant, run_in_python

import crosscheck
import seecr
from crosscheck.fit.problem import Problem
from crosscheck.inference.evidence import Linear, MemberColumns, log_gain
from crosscheck.inference.fit import Data, fit
from crosscheck.inference.noise import (
    Chain,
    Noise,
    NoisePrior,
    chain_of,
    estimate,
    log_det,
    mixture,
    whitened,
)
from crosscheck.settle.settler import Settler
from crosscheck.suite.agreement import load_thresholds
from crosscheck.suite.cases import Case, shipped_cases
from crosscheck.suite.effects import EffectCase
from crosscheck.suite.run import run_suite
from crosscheck.suite.verdicts import Outcome
from crosscheck.twin.measure import measure
from seecr.description.mjcf import model_path
from seecr.effects import Terms
from seecr.prediction.experiment import Experiment
from seecr.prediction.sensitivity import readings_difference

pytestmark = pytest.mark.slow

# --- checks ------------------------------------------------------------------------------------

ROWS = {
    "cogiro-vectran-turned": [2],
    "parallel-fishing-z0.10": [0],
    "off-centre-turned": [5],
    "planar-vertical-vectran-turned": [4],
    "planar-two-cable-inverted": [0],
}


@cache
def few_cases() -> tuple[Case, ...]:
    every = {case.name: case for case in shipped_cases(n_random=1)}
    return tuple(
        replace(one, poses=one.poses[rows], starts=None if one.starts is None else one.starts[rows])
        for one, rows in ((every[name], rows) for name, rows in ROWS.items())
    )


def rests() -> None:
    """The suite, at one pose of each of five robots."""
    run = run_suite(few_cases(), load_thresholds())
    assert run.outcome is Outcome.AGREE, str(run)


def modes() -> None:
    """Stiffness and frequencies are MuJoCo's, wherever the platform is put."""
    for case in few_cases()[:4]:
        robot, command = seecr.load_robot(case.model), case.poses[0]
        found = seecr.solve(robot, command)
        side = Settler(case.model)
        stiffness, frequencies = mujocos_modes(side, found.pose[0], command)
        scale = np.where(robot.hinges, robot.length, 1.0)
        own = np.linalg.eigvalsh(found.stiffness[0] / np.outer(scale, scale))
        np.testing.assert_allclose(own, stiffness, rtol=1e-5, atol=1e-6 * stiffness[-1])
        np.testing.assert_allclose(found.smallest_eigenvalue[0], stiffness[0], rtol=1e-4)
        np.testing.assert_allclose(found.frequencies[0], frequencies, rtol=1e-5)


_TRUTHS: dict[str, Any] = {}


def effect(name: str) -> None:
    """An effect as the robot in MuJoCo has it."""
    case = EffectCase(model_path("demobot_cogiro"), name)
    asked = replace(case.commands, loads=case.loads)
    experiment = Experiment(case.robot, asked)
    found = experiment.predict(case.effects)
    if case.name not in _TRUTHS:  # asked once, before any fault is planted
        _TRUTHS[case.name] = measure(
            case.robot, asked, case.effects, segments=(16, 32), steps=experiment.path.steps
        )
    truth = _TRUTHS[case.name]
    np.testing.assert_allclose(found.readings.position, truth.position, atol=1e-8)
    np.testing.assert_allclose(found.readings.tensions, truth.tension_readings, atol=1e-6)
    assert found.solved.all()


def slopes(name: str, *beside: str) -> None:
    """Sensitivities are the differences of predictions, also beside other effects."""
    case = EffectCase(model_path("demobot_cogiro"), name)
    experiment, own = Experiment(case.robot, case.commands), case.term
    terms = Terms([own, *(replace(case, effect=other).term for other in beside)])
    columns = [k for k, (effect, _key) in enumerate(terms.labels) if effect == name]
    found = seecr.sensitivities(experiment, terms, experiment.predict(terms.effects), columns)
    for k in range(0, len(own.vector), max(1, len(own.vector) // 3)):
        step = 1e-3 * (own.layout.scale[k] if not own.layout.shape[k] else own.vector[k])
        sides = [
            experiment.predict(terms.with_term(own.with_vector(own.vector + part)).effects)
            for part in np.outer([0.5 * step, -0.5 * step], np.eye(len(own.vector))[k])
        ]
        apart = readings_difference(sides[0].readings, sides[1].readings) / step
        for part in (slice(0, 3), slice(3, 6), slice(6, None)):
            most = np.abs(apart[:, part]).max()
            np.testing.assert_allclose(found[:, part, k], apart[:, part], atol=2e-3 * most + 1e-9)


def problem_of(data: Any, robot: Any) -> Problem:
    return Problem(robot, data, SIGMA, np.ones(data.n_rows, dtype=bool))


def fitted() -> None:
    """Values that are in the data, with the covariance of ordinary least squares."""
    robot = soft_cogiro()
    true = [
        term(robot, "platform_mass", added_kg=0.02),
        term(robot, "gravity_tilt", tilt_x_rad=0.01),
    ]
    data = measured(robot, true, points=6)
    start = Terms([one.with_vector(one.layout.null) for one in true])
    of = Data.of(problem_of(data, robot), start)
    found = fit(of, of.state(start))
    wanted = np.concatenate([one.vector for one in true])
    off = found.terms.vector - wanted
    assert found.settled and off @ np.linalg.solve(found.covariance, off) < 16.0
    experiment = Experiment(robot, data.as_commands(robot))
    sigma = np.repeat([SIGMA.position_m, SIGMA.orientation_rad], 3)
    columns = []
    for k, size in enumerate(1e-2 * start.scale):
        moved = start.with_vector(wanted + size * np.eye(3)[k])
        both = [experiment.predict(t.effects).readings for t in (moved, Terms(true))]
        columns.append((readings_difference(*both)[:, :6] / sigma / size).ravel())
    slope = np.stack(columns, axis=1)
    power = slope.T @ slope + np.diag(start.scale**-2.0)
    error = np.sqrt(np.diag(np.linalg.inv(power)))
    np.testing.assert_allclose(found.stderr, error, rtol=0.25)
    assert found.noise.scale[:2] == pytest.approx(1.0, abs=0.2)


def evidence() -> None:
    """Sets of effects have the evidence of their whole covariance, and half Gaussians too."""
    random = np.random.default_rng(0)
    x = random.normal(size=(40, 6))
    y = x @ [1.5, -2.0, 0, 0, 0.7, 0] + random.normal(size=40)
    widths = np.array([0.3, 1.0, 3.0])
    linear = Linear.of(x, y, {n: MemberColumns(np.array([2 * k, 2 * k + 1]), widths)
                              for k, n in enumerate("abc")})  # fmt: skip

    def direct(chosen: dict[str, float]) -> float:
        whole = np.eye(40)
        for name, width in chosen.items():
            own = x[:, linear.groups[name].columns]
            whole = whole + width**2 * own @ own.T
        return float(-0.5 * (y @ np.linalg.solve(whole, y) + np.linalg.slogdet(whole)[1]))

    solved = linear.solved({"a": 1.0, "c": 3.0})
    assert solved.log_evidence == pytest.approx(direct({"a": 1.0, "c": 3.0}))
    for name in "abc":
        rest = {n: w for n, w in solved.chosen.items() if n != name}
        gains = [direct({**rest, name: w}) - direct(rest) for w in widths]
        np.testing.assert_allclose(solved.gains(name), gains, atol=1e-8)
        mean = np.log(np.mean(np.exp(gains)))
        assert solved.gain(name) == pytest.approx(mean, abs=1e-8)
    z = np.linspace(0.0, 20.0, 200_001)
    power, slope, width = 3.0, -1.2, 2.0
    like = np.exp(slope * z - 0.5 * power * z**2 - 0.5 * (z / width) ** 2)
    half = np.log(2.0 * np.sum(like) * (z[1] - z[0]) / (width * np.sqrt(2.0 * np.pi)))
    got = log_gain(np.array([[power]]), np.array([slope]), [width], [True])
    assert got == pytest.approx(half, abs=1e-3)


def noise() -> None:
    """Whitening, volume, size and outliers of noise, against its whole covariance."""
    n, random = 48, np.random.default_rng(3)
    row, before = np.arange(n), np.where(np.arange(n) % 24 == 0, -1, np.arange(n) - 1)
    chain = Chain(np.zeros(n, int), row, before, random.uniform(0.5, 2.0, n))
    one = Noise(np.array([1.7, 1.0, 1.0]), np.array([0.6, 0.0, 0.0]))
    root = np.zeros((n, n))
    for k in range(n):
        phi = 0.6 ** chain.gap[k] if before[k] >= 0 else 0.0
        root[k] = phi * root[before[k]]
        root[k, k] = np.sqrt(1.0 - phi**2)
    whole, weight = 1.7**2 * root @ root.T, np.ones(n)
    white = whitened(chain, one, weight, np.eye(n))
    np.testing.assert_allclose(white @ whole @ white.T, np.eye(n), atol=1e-12)
    assert log_det(chain, one) == pytest.approx(np.linalg.slogdet(whole)[1])
    x, y = random.normal(size=(n, 8)), 1.7 * root @ random.normal(size=n)
    found = estimate(chain, one, weight, x, y, np.full(8, 5.0))

    def likelihood(scale: float, rho: float) -> float:
        own = whitened(chain, Noise(np.array([scale, 1, 1]), np.array([rho, 0, 0])), weight,
                       np.column_stack([x, y]))  # fmt: skip
        beside = np.eye(n) + 25.0 * own[:, :8] @ own[:, :8].T
        volume = np.linalg.slogdet(beside)[1] + log_det(
            chain, Noise(np.array([scale, 1, 1]), np.array([rho, 0, 0]))
        )
        return float(-0.5 * (own[:, 8] @ np.linalg.solve(beside, own[:, 8]) + volume))

    best = likelihood(found.scale[0], found.rho[0])
    for by in (0.97, 1.03):
        assert likelihood(by * found.scale[0], found.rho[0]) < best
        assert likelihood(found.scale[0], by * found.rho[0]) < best
    residual = random.normal(size=n)
    residual[5] = 60.0
    counts = mixture(chain, Noise(np.ones(3), np.zeros(3)), residual)[0]
    assert counts[5] < 0.05 < 0.9 < np.median(counts)


def chains() -> None:
    """Readings follow one another within a run and a channel only."""
    robot = soft_cogiro()
    data = measured(robot, points=3)
    problem = problem_of(data, robot)
    chain = chain_of(problem)
    linked = chain.before >= 0
    assert linked.sum() == len(chain.row) - 6 * len(data.runs)
    run = data.run_index[problem.row_of]
    assert np.array_equal(run[linked], run[chain.before[linked]])
    column = problem.column_of
    assert np.array_equal(column[linked], column[chain.before[linked]])
    loud = Noise(np.array([6.0, 1.0, 1.0]), np.zeros(3))
    assert NoisePrior.of(problem).misjudged(loud)[0] > 0.9


def compared() -> None:
    """Errors that were put into the readings come out, row by row and by kind."""
    robot = soft_cogiro()
    data = measured(robot, points=4, tensions=True, sigma=replace(SIGMA, tension_N=1e-3))
    exact = seecr.predict(robot, data.as_commands(robot))
    random = np.random.default_rng(1)
    off, pull = 1e-3 * random.normal(size=(data.n_rows, 3)), random.normal(size=(data.n_rows, 8))
    turn = seecr.pose.quat_from_rotvec(np.array([0.0, 0.0, 0.01]))
    position, tensions = exact.readings.position + off, exact.readings.tensions + pull
    quat = seecr.pose.quat_multiply(turn, exact.readings.quat_wxyz)
    found = crosscheck.compare(
        robot, replace(data, position=position, quat_wxyz=quat, tensions=tensions)
    )
    assert found.rms["position_rms_m"] == pytest.approx(np.sqrt(np.mean(off**2)))
    assert found.rms["orientation_rms_rad"] == pytest.approx(0.01 / np.sqrt(3.0))
    assert found.rms["tension_rms_N"] == pytest.approx(np.sqrt(np.mean(pull**2)))
    np.testing.assert_allclose(found.errors_of("position"), np.linalg.norm(off, axis=1), rtol=1e-6)
    np.testing.assert_allclose(found.errors_of("tension"), np.abs(pull).max(axis=1), rtol=1e-6)
    assert found.coordinates[0].bias == pytest.approx(off[:, 0].mean())
    assert abs(found.coordinates[1].max) == pytest.approx(np.abs(off[:, 1]).max())
    assert found.times_noise["tension"] == pytest.approx(np.sqrt(np.mean(pull**2)) / 1e-3)
    worst = float(np.linalg.norm(off, axis=1).max())
    tight = crosscheck.Limits(max_position_worst=0.99 * worst)
    assert [e.value for e in crosscheck.exceeded(tight, found)] == pytest.approx([worst])
    assert not crosscheck.exceeded(crosscheck.Limits(max_position_worst=1.01 * worst), found)
    first = {group.name: group.rms["position_rms_m"] for group in found.runs}
    rows = data.run == data.runs[0]
    assert first[data.runs[0]] == pytest.approx(np.sqrt(np.mean(off[rows] ** 2)))


def named() -> None:
    """A diagnosis names the effect that is in the data, and none where there is none."""
    robot = soft_cogiro()
    hidden = term(robot, "centre_of_mass", shift_x_m=0.004)
    found = crosscheck.diagnose(robot, measured(robot, [hidden], points=4))
    assert found.verdict is crosscheck.DiagnosisVerdict.EFFECTS_FOUND
    assert [one.term.name for one in found.missing] == ["centre_of_mass"]
    (one,) = found.missing
    assert np.all(np.abs(one.term.vector - hidden.vector) < 4.0 * one.stderr)
    assert one.probability > 0.95 and one.share > 0.9
    nothing = crosscheck.diagnose(robot, measured(robot, points=4))
    assert nothing.verdict is crosscheck.DiagnosisVerdict.NO_EFFECT_MISSING


CSV = """run,t_ms,cmd_x_mm,cmd_y_mm,cmd_z_mm,cmd_rx_deg,cmd_ry_deg,cmd_rz_deg,meas_x_mm,meas_y_mm,\
meas_z_mm,meas_qw,meas_qx,meas_qy,meas_qz,tension_2_N,temperature_C,payload_g
a,500,400,250,150,0,0,0,401,249,148,1,0,0,0,3.5,21,100
a,1500,410,250,150,0,3,4,411,,148,0.8,0,0.6,0,,22,50
b,2500,400,260,150,2,0,0,401,259,148,,,,,3.5,21,0
"""


def read(folder: Path) -> None:
    """A file's numbers in SI, and written and read again."""
    robot, path = seecr.load_robot("demobot_cogiro"), folder / "some.csv"
    path.write_text(CSV, encoding="utf-8")
    path.with_suffix(".toml").write_text('[sigma]\nposition_m = "0.1mm"\n', encoding="utf-8")
    data = crosscheck.load_measurements(path, robot)
    again = folder / "again.csv"
    crosscheck.write_measurements(again, data)
    for one in (data, crosscheck.load_measurements(again, robot)):
        assert one.command_pose is not None and one.quat_wxyz is not None and one.loads is not None
        np.testing.assert_allclose(one.t_s, [0.5, 1.5, 2.5])
        np.testing.assert_allclose(one.position[0], [0.401, 0.249, 0.148])
        assert np.isnan(one.position[1, 1]) and np.isnan(one.quat_wxyz[2]).all()
        np.testing.assert_allclose(one.quat_wxyz[1], [0.8, 0.0, 0.6, 0.0])
        np.testing.assert_allclose(one.command_pose[1, :3], [0.41, 0.25, 0.15])
        half = np.deg2rad([1.5, 2.0])  # R = Ry(3 deg) Rz(4 deg)
        (sy, sz), (cy, cz) = np.sin(half), np.cos(half)
        np.testing.assert_allclose(
            one.command_pose[1, 3:], [cy * cz, sy * sz, sy * cz, cy * sz], atol=1e-9
        )
        np.testing.assert_allclose(one.tensions[0], [np.nan, 3.5, *[np.nan] * 6])
        np.testing.assert_allclose(one.loads.mass, [0.1, 0.05, 0.0])
        assert one.sigma.position_m == 1e-4 and one.runs == ("a", "b")
        np.testing.assert_allclose(one.temperature_C, [21, 22, 21])


# --- faults ------------------------------------------------------------------------------------


# By module: the text that changes, what it becomes, the check that has to go red, and about what.
FAULTS = {
    "seecr.compiled.newton": (
        ("if cholesky(hessian, -SINGULAR_PART * top, factor):", "if True:", rests),
        ("if size <= enough * scale or", "if size <= 1e-4 * scale or", rests),
    ),
    "seecr.compiled.platform": (
        ("BEFORE]) + cables[i, GAP]", "BEFORE]) - cables[i, GAP]", effect, "cable_length_offset"),
        ("-tension * uz\n", "-1.001 * tension * uz\n", rests),
        ("taut = elastic >= 0.0", "taut = True", rests),
        ("gradient[4] -= az * fx - ax * fz", "gradient[4] += az * fx - ax * fz", rests),
        ("hy - (az * fx - ax * fz)", "hy - (az * fx)", rests),
        ("along = rate - turning", "along = rate", modes),
        ("- ax * yz + sz + sx", "- ax * yz + sz", modes),
        ("- ax * xz - 0.5 * (fx * ay + fy * ax)", "- ax * xz", modes),
        ("mxy, mxz = mxx + xx, mxy + xy", "mxy, mxz = mxx + xx, mxy - xy", modes),
        ("hessian[4, 4] += az * fz + ax * fx", "hessian[4, 4] += ax * fx", modes),
        ("EXTERNAL_FORCE + k]\n        gradient[3",
         "EXTERNAL_FORCE + k] * per\n        gradient[3", effect, "external_wrench"),
        ("EXTERNAL_MOMENT + k] * per", "EXTERNAL_MOMENT + k]", effect, "external_wrench"),
        ("ea * yields + cables[i, WINCH_SIDE])", "ea * yields)", effect, "winch_side_length"),
    ),
    "seecr.compiled.joint_kinematics": (
        ("total += g[k] * columns[j, k]", "total += g[k] * columns[j, k] * (k < 3)", rests),
        ("columns[j, 5] = a, b, c", "columns[j, 5] = a, -b, c", rests),
    ),
    "seecr.compiled.cable_law": (
        ("row[COMPLIANCE])\n    soft", "0.0)\n    soft", effect, "frame_compliance"),
        ("if change >= 0.0 else -amplitude",
         "if change >= 0.0 else amplitude", effect, "hysteresis"),
        ("return tension / grip, 1.0 / grip", "return tension, 1.0", effect, "exit_friction"),
        ("strain * (q + c * strain)", "strain * (q - c * strain)", effect, "nonlinear_elasticity"),
        ("radius * (math.pi - psi)", "radius * (math.pi + psi)", effect, "pulley_radius"),
        ("share * column[i] * column[j]", "share * column[i]", slopes, "frame_compliance"),
    ),
    "seecr.compiled.catenary": (
        ("0.5 * (v + top) * stretch", "v * stretch", effect, "cable_weight"),
    ),
    "seecr.compiled.cable": (
        ("[TENSION] = tension\n    state[ENERGY]",
         "[TENSION] = h\n    state[ENERGY]", effect, "cable_weight"),
    ),
    "seecr.compiled.history": (
        ("kept[_CREPT] * (1.0 - before - now)", "kept[_CREPT]", effect, "creep"),
        ("share * before * kept[_PULLED]", "0.0", effect, "creep"),
        ("kept[_BEHIND] - paid * row[EA]",
         "kept[_BEHIND] + paid * row[EA]", effect, "exit_friction"),
        ("kept[_STRETCHED], kept[_HYSTERETIC]", "kept[_STRETCHED], 0.0", effect, "hysteresis"),
    ),
    "seecr.compiled.rates": (
        ("of[row] * p + of[row + 1] * q", "of[row] * p", slopes, "anchor_point_error"),
        ("e * t - f * v + b * j - c * h", "e * t - f * v", slopes, "anchor_point_error"),
        ("by_rest = more - slope", "by_rest = more + slope", slopes, "length_scale"),
        ("add_load(-1.0, minus_load[r]", "add_load(1.0, minus_load[r]", slopes, "platform_mass"),
        ("gradient[k] -= sign * load[EXTERNAL_FORCE + k]",
         "gradient[k] -= 0.0", slopes, "external_wrench"),
        ("top * (by_rest[1] + w * by_rest[2])",
         "top * by_rest[1]", slopes, "length_scale", "cable_weight"),
        ("by_rest[1] * up[k] - by_rest[0] * e[k]",
         "by_rest[1] * up[k]", slopes, "length_scale", "cable_weight"),
    ),
    "seecr.statics.vibration": (
        ("about - mass[:, None, None] * cross", "about - 2.0 * mass[:, None, None] * cross", modes),
        ("turn @ robot.inertia @ turn.swapaxes(1, 2)", "robot.inertia[None] + 0 * turn", modes),
        ("np.sqrt(squares) / (2.0 * np.pi)", "np.sqrt(squares)", modes),
    ),
    "seecr.statics.solution": (
        ("np.where(self.robot.hinges, self.robot.length, 1.0)",
         "np.where(self.robot.hinges, 1.0, 1.0)", modes),
    ),
    "seecr.statics.tables": (
        ("mass[:, None] * setup.gravity",
         "setup.robot.mass * setup.gravity", effect, "known_loads"),
        ("setup.commands.pose) - rest", "setup.commands.pose) - rest - 1e-6", rests),
    ),
    "seecr.prediction.sensitivity": (
        ("out = _after(at, -_inverse_stiffness(at) @ (force / apart)[",
         "out = _after(at, _inverse_stiffness(at) @ (force / apart)[", slopes, "platform_mass"),
        ("at.found.slopes @ step], axis=1)",
         "0.0 * at.found.slopes @ step], axis=1)", slopes, "platform_mass"),
        ("out[:, 6 + cable, cable] += own\n", "pass\n", slopes, "cable_length_offset"),
        ("np.moveaxis(0.5 * readings",
         "np.moveaxis(readings", slopes, "platform_mass", "tracker_scale"),
    ),
    "seecr.prediction.experiment": (
        ("if setup.backlash.any():", "if False:", effect, "backlash"),
    ),
    "seecr.units": (
        ("values * self.times / self.over", "values * self.over / self.times", read),
    ),
    "seecr.columns.poses": (
        ("unit: Array = quat / norm[:, None]", "unit: Array = quat[:, [1, 2, 3, 0]]", read),
        ("np.concatenate([position, orientation], axis=1)",
         "np.concatenate([position, np.tile(reference[3:], (columns.n_rows, 1))], axis=1)", read),
    ),
    "crosscheck.measurements.read": (
        ("sigma=beside.sigma,", "sigma=Sigma(),", read),
        ('columns.readings("tension", cables)', 'columns.readings("tension", cables[::-1])', read),
    ),
    "crosscheck.measurements.write": (
        ('lines.append(f"{key} = {float(value)!r}")', "pass", read),
    ),
    "crosscheck.fit.problem": (
        ("[data.position - readings.position, turned", "[data.position, turned", compared),
        ("np.sqrt((values**2).mean())", "np.abs(values).mean()", compared),
        ("size = np.max(np.abs(part), axis=1, initial=0.0)",
         "size = np.max(part, axis=1)", compared),
        ("size = np.linalg.norm(part, axis=1)", "size = np.abs(part).max(axis=1)", compared),
        ("back = quat_conjugate(readings.quat_wxyz)",
         "back = quat_conjugate(data.quat_wxyz)", compared),
    ),
    "crosscheck.comparison.residuals": (
        ("rows = (labels == name) & problem.use", "rows = problem.use", compared),
        ("bias=float(values.mean())", "bias=float(np.median(values))", compared),
    ),
    "crosscheck.comparison.limits": (
        ("float(np.nanmax(sizes)) if worst",
         "float(np.nanmean(sizes)) if worst", compared),
    ),
    "crosscheck.inference.evidence": (
        ("-0.5 * (self.linear.power - gained)", "-0.5 * self.linear.power + gained", evidence),
        ("2.0 * float(np.sum(np.log(self.width)))", "float(np.sum(np.log(self.width)))", evidence),
        ("square * self.along**2 / grown - np.log(grown)",
         "square * self.along**2 / grown", evidence),
        ("np.log(2.0) + chance", "chance", evidence),
        ("np.logaddexp.reduce(gains) - np.log(len(gains))", "np.logaddexp.reduce(gains)", evidence),
        ("precise - np.eye(len(own)) / self.chosen[name] ** 2", "precise", evidence),
    ),
    "crosscheck.inference.noise": (
        ("np.sqrt(1.0 - phi**2))", "(1.0 - phi**2))", noise),
        ("np.sum(np.log1p(-(phi**2)))", "0.0", noise),
        ("by_kind(squares - 1.0), by_kind(slope)", "by_kind(squares - 1.2), by_kind(slope)", noise),
        ("prior - 0.5 * each_power[:, None] / sizes**2", "prior", noise),
        ("& (column[order][1:] == column[order][:-1])", "", chains),
        ("chance * (self.stated & ~self.bound)", "0.0 * chance", chains),
    ),
    "crosscheck.inference.fit": (
        ("out = self.spread * np.outer(scale, scale)", "out = self.spread", fitted),
        ("slope = z[move] * inverse2 - gradient[move]",
         "slope = z[move] * inverse2 + gradient[move]", fitted),
        ("y = fit.state.white + x @ (z - middle)", "y = 2 * fit.state.white", fitted),
    ),
    # the whole of a diagnosis takes seconds
    "crosscheck.inference.hypothesis": (
        ("score += fit.log_outliers +", "score += 50.0 * len(key) +", named),
    ),
    "crosscheck.inference.verdict": (
        ("len(wanted & k) >= least), 1.0)", "len(wanted & k) > least), 1.0)", named),
        ("none = share[search.stood] * (1.0 - loud[search.stood])", "none = 0.0", named),
        ("if 1 <= len(sure) <= priors.FEW", "if 1 < len(sure) <= priors.FEW", named),
        ("posterior.none > 1.0 - priors.SURE", "posterior.none > 1.0", named),
    ),
}  # fmt: skip


@cache
def is_green(check: Callable[..., None], *about: Any) -> bool:
    """A check without a fault, which also asks MuJoCo whatever is asked of it later."""
    check(*about)
    return True


@pytest.mark.parametrize(
    ("module", "fault"),
    [pytest.param(module, fault, id=f"{module}: {fault[0][:40]}".replace(" ", "_"),
                  marks=[pytest.mark.sweep] if fault[2] is named else [])
     for module, faults in FAULTS.items() for fault in faults],
)  # fmt: skip
def test_a_planted_fault_makes_its_check_fail(module, fault, monkeypatch, tmp_path) -> None:
    old, new, check, *about = fault
    about = [tmp_path] if check is read else about
    assert is_green(check, *about)
    if module.startswith(COMPILED):
        run_in_python(monkeypatch)
    plant(monkeypatch, module, old, new)
    with pytest.raises((AssertionError, seecr.SeecrError)):
        check(*about)
