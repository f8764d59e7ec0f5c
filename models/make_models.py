"""Write the shipped robots' MJCF files, or check that they are what this script writes.

    python models/make_models.py            writes models/<robot>/<robot>.xml
    python models/make_models.py --check    exit status 1 and the names of those that differ

Numbers are written by ``repr``, so that a file holds the very floats computed here; where each
comes from is in models/README.md.
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
VECTRAN = 3000.0  # k_c = E S [N], the cable that the shipped files carry

Vector = tuple[float, float, float]

# Paper, Table II: (A_i in the base frame, B_i in the platform frame) [m].
# A4 is printed as (0.08, 0.04, 0.485), the same point as A1: a misprint, see docs/misprints.md.
COGIRO: tuple[tuple[Vector, Vector], ...] = (
    ((0.08, 0.04, 0.485), (0.04, -0.03, 0.018)),
    ((0.04, 0.08, 0.485), (-0.0515, 0.022, -0.018)),
    ((0.04, 0.42, 0.485), (-0.0515, -0.022, 0.018)),
    ((0.08, 0.46, 0.485), (0.04, 0.03, -0.018)),
    ((0.72, 0.46, 0.485), (-0.04, 0.03, 0.018)),
    ((0.76, 0.42, 0.485), (0.0515, -0.022, -0.018)),
    ((0.76, 0.08, 0.485), (0.0515, 0.022, 0.018)),
    ((0.72, 0.04, 0.485), (-0.04, -0.03, -0.018)),
)
PARALLEL: tuple[tuple[Vector, Vector], ...] = (
    ((0.04, 0.04, 0.486), (-0.0515, -0.022, 0.018)),
    ((0.04, 0.04, 0.450), (-0.0515, -0.022, -0.018)),
    ((0.04, 0.46, 0.486), (-0.0515, 0.022, 0.018)),
    ((0.04, 0.46, 0.450), (-0.0515, 0.022, -0.018)),
    ((0.76, 0.46, 0.486), (0.0515, 0.022, 0.018)),
    ((0.76, 0.46, 0.450), (0.0515, 0.022, -0.018)),
    ((0.76, 0.04, 0.486), (0.0515, -0.022, 0.018)),
    ((0.76, 0.04, 0.450), (0.0515, -0.022, -0.018)),
)
# The planar robots' dimensions are ours, the paper gives none: see models/README.md.
PLANAR_TWO_CABLE: tuple[tuple[Vector, Vector], ...] = (
    ((0.0, 0.0, 1.0), (-0.1, 0.0, 0.0)),
    ((1.0, 0.0, 1.0), (0.1, 0.0, 0.0)),
)
PLANAR_VERTICAL: tuple[tuple[Vector, Vector], ...] = (
    ((0.04, 0.0, 0.486), (-0.0515, 0.0, 0.018)),
    ((0.04, 0.0, 0.450), (-0.0515, 0.0, -0.018)),
    ((0.76, 0.0, 0.486), (0.0515, 0.0, 0.018)),
    ((0.76, 0.0, 0.450), (0.0515, 0.0, -0.018)),
)
PLANAR_HORIZONTAL: tuple[tuple[Vector, Vector], ...] = (
    ((0.04, 0.0, 0.486), (-0.0515, 0.0, 0.018)),
    ((0.143, 0.0, 0.486), (0.0515, 0.0, 0.018)),
    ((0.657, 0.0, 0.486), (-0.0515, 0.0, 0.018)),
    ((0.76, 0.0, 0.486), (0.0515, 0.0, 0.018)),
)
# CoGiRo of LIRMM and Tecnalia, measured with a laser tracker in November 2015. The base frame lies
# in the middle of the floor, the platform's in the middle of the platform's lower face.
COGIRO_LARGE: tuple[tuple[Vector, Vector], ...] = (
    ((-7.1775, -5.4361, 5.3911), (0.5032, -0.4928, 0.0)),
    ((-7.4594, -5.1504, 5.3999), (-0.5097, 0.3508, 0.9976)),
    ((-7.3911, 5.1940, 5.3976), (-0.5032, -0.2700, 0.0)),
    ((-7.1026, 5.4753, 5.4094), (0.4960, 0.3561, 0.9996)),
    ((7.2398, 5.3759, 5.4093), (-0.5032, 0.4928, 0.0)),
    ((7.5208, 5.0851, 5.4200), (0.4998, -0.3404, 0.9991)),
    ((7.4461, -5.2539, 5.3874), (0.5021, 0.2750, -0.0007)),
    ((7.1608, -5.5342, 5.3973), (-0.5045, -0.3463, 0.9976)),
)
# WireX, IPAnema3Design: frame 8 x 3.5 m, exit points at 3.25 and 0.25 m; the upper cables hold the
# lower edge of a platform of 1.5 x 0.5 x 0.5 m, the lower cables its upper edge.
IPANEMA: tuple[tuple[Vector, Vector], ...] = tuple(
    ((4.0 + sx * 3.8, 1.75 + sy * 1.75, 3.25), (sx * 0.55, sy * 0.25, -0.25))
    for sx, sy in ((-1, 1), (1, 1), (1, -1), (-1, -1))
) + tuple(
    ((4.0 + sx * 4.0, 1.75 + sy * 1.5, 0.25), (sx * 0.75, sy * 0.15, 0.25))
    for sx, sy in ((-1, 1), (1, 1), (1, -1), (-1, -1))
)
# Four masts at the corners of a pitch, a camera that hangs as a point.
CAMERA: tuple[tuple[Vector, Vector], ...] = tuple(
    ((x, y, 25.0), (0.0, 0.0, 0.0))
    for x, y in ((0.0, 0.0), (105.0, 0.0), (105.0, 68.0), (0.0, 68.0))
)


@dataclass(frozen=True)
class Model:
    """One robot to write.

    Attributes:
        name: of the folder, the file and the MJCF model.
        title: one line for the file's comment.
        cables: (exit point, anchor point) of each [m].
        reference: position of the platform in the reference pose, unturned [m].
        box: edges of the platform [m].
        frame: edges of the frame [m]; planar robots have none in depth.
        corner: lower left front corner of the frame in the base frame [m].
        middle: of the platform's box in the platform frame [m].
        inertia: xx, yy, zz, xy, xz, yz about its centre of mass [kg m^2]; None for a solid box.
        planar: moves in the x-z plane only.
        mass: of the platform [kg].
        bar: edge of the frame's square profile [m].
        cable_factors: stiffness of each cable over Vectran's; None for all alike.
        centre: of mass, in the platform frame [m].
        translates: moves along x, y and z and never turns.
        ea: k_c of its cables [N].
        pull: what cables pull with at the reference pose [N], as near as balances the weight;
            0 for rest lengths that are straight lengths.
        looks: size of all that is only drawn, over DemoBot's.
    """

    name: str
    title: str
    cables: tuple[tuple[Vector, Vector], ...]
    reference: Vector = (0.4, 0.25, 0.15)
    box: Vector = (0.102, 0.044, 0.036)
    frame: Vector = (0.80, 0.50, 0.50)
    corner: Vector = (0.0, 0.0, 0.0)
    middle: Vector = (0.0, 0.0, 0.0)
    inertia: tuple[float, ...] | None = None
    planar: bool = False
    mass: float = 0.4
    bar: float = 0.02
    cable_factors: tuple[float, ...] | None = None
    centre: Vector = (0.0, 0.0, 0.0)
    translates: bool = False
    ea: float = VECTRAN
    pull: float = 0.0
    looks: float = 1.0


MODELS = (
    Model("demobot_cogiro", "DemoBot, eight cables in the Cogiro configuration", COGIRO),
    Model("demobot_parallel", "DemoBot, eight cables in the parallel configuration", PARALLEL),
    Model(
        "demobot_uneven",
        "DemoBot, parallel configuration, no two cables of the same stiffness",
        PARALLEL,
        cable_factors=(1.0, 0.5, 1.4, 0.1, 0.8, 2.0, 0.3, 1.2),
    ),
    Model(
        "demobot_off_centre",
        "DemoBot, Cogiro configuration, its centre of mass off the middle",
        COGIRO,
        centre=(0.012, -0.007, -0.015),
    ),
    Model(
        "planar_two_cable",
        "Bar on two cables, under-actuated, in the x-z plane",
        PLANAR_TWO_CABLE,
        reference=(0.5, 0.0, 0.5),
        box=(0.2, 0.02, 0.02),
        frame=(1.04, 0.0, 1.02),
        corner=(-0.02, 0.0, 0.0),
        planar=True,
    ),
    Model(
        "planar_vertical",
        "Four cables, vertical parallelograms, in the x-z plane",
        PLANAR_VERTICAL,
        reference=(0.4, 0.0, 0.15),
        frame=(0.80, 0.0, 0.50),
        planar=True,
    ),
    Model(
        "planar_horizontal",
        "Four cables, horizontal parallelograms, in the x-z plane",
        PLANAR_HORIZONTAL,
        reference=(0.4, 0.0, 0.15),
        frame=(0.80, 0.0, 0.50),
        planar=True,
    ),
    Model(
        "cogiro_large",
        "CoGiRo, a suspended robot of 15 m, eight crossed steel cables",
        COGIRO_LARGE,
        reference=(0.0, 0.0, 1.5),
        box=(1.0, 1.0, 1.0),
        frame=(15.24, 11.24, 5.93),
        corner=(-7.62, -5.62, 0.0),
        middle=(0.0, 0.0, 0.5),
        mass=91.058,
        # its source prints products of inertia, +integral of x y dm: the matrix has minus them
        inertia=(36.598, 35.982, 25.439, 0.453, -3.012, 1.539),
        centre=(-0.034, -0.013, 0.264),
        bar=0.3,
        ea=100e9 * 8.2051e-6,
        looks=12.0,
    ),
    Model(
        "ipanema",
        "A fully constrained robot of IPAnema 3's kind, eight cables under pretension",
        IPANEMA,
        reference=(4.0, 1.75, 1.75),
        box=(1.5, 0.5, 0.5),
        frame=(8.0, 3.5, 3.5),
        mass=20.0,
        bar=0.1,
        ea=1.0e5,
        pull=500.0,
        looks=6.0,
    ),
    Model(
        "camera",
        "A camera on four cables above a pitch, which translates and never turns",
        CAMERA,
        reference=(52.5, 34.0, 10.0),
        box=(0.5, 0.5, 0.5),
        frame=(105.0, 68.0, 25.0),
        mass=20.0,
        bar=0.5,
        translates=True,
        ea=1.0e5,
        looks=60.0,
    ),
)


def pulls(model: Model) -> tuple[float, ...]:
    """Tensions [N] that balance the weight at the reference pose, nearest to ``pull``.

    Least squares, through the normal equations (Pott, Cable-Driven Parallel Robots, 2018, the
    closed form); none where nothing pulls.
    """
    if not model.pull:
        return (0.0,) * len(model.cables)
    columns = []
    for a, b in model.cables:
        way = [p - t - q for p, t, q in zip(a, model.reference, b, strict=True)]
        x, y, z = (w / math.hypot(*way) for w in way)
        columns.append((x, y, z, b[1] * z - b[2] * y, b[2] * x - b[0] * z, b[0] * y - b[1] * x))
    w = np.array(columns).T
    left = np.array([0.0, 0.0, 9.81 * model.mass, 0.0, 0.0, 0.0]) - w.sum(axis=1) * model.pull
    found = model.pull + np.linalg.lstsq(w, left, rcond=None)[0]
    return tuple(round(float(value), 9) for value in found)


def exact_spring(k_c: float, length: float) -> tuple[float, float]:
    """Stiffness [N/m] and rest length [m] whose product, rounded, is k_c [N] to the last digit.

    The quotient k_c / length alone can miss by a rounding, so its neighbours are tried. The rest
    length is two roundings (2e-16 m) short of the straight length, or what it takes: at exactly
    that length MuJoCo's viewer draws the cable as a catenary whose points are not numbers.
    """
    for step in range(-2, -400, -1):
        rest = _neighbour(length, step)
        for nudge in (0, -1, 1):
            stiffness = _neighbour(k_c / rest, nudge)
            if stiffness * rest == k_c:
                return stiffness, rest
    raise ValueError(f"no two floats near {k_c / length!r} and {length!r} multiply to {k_c!r}")


def _neighbour(x: float, steps: int) -> float:
    for _ in range(abs(steps)):
        x = math.nextafter(x, math.copysign(math.inf, steps))
    return x


def box_inertia(mass: float, edges: Vector) -> Vector:
    """Principal moments of a homogeneous box about its centre [kg m^2]."""
    a, b, c = edges
    return (
        mass / 12.0 * (b * b + c * c),
        mass / 12.0 * (a * a + c * c),
        mass / 12.0 * (a * a + b * b),
    )


def numbers(*values: float) -> str:
    """Floats as MJCF wants them, by repr; minus zero would only puzzle a reader."""
    return " ".join(repr(float(v) + 0.0) for v in values)


def _bare(*values: float) -> str:
    """Floats as :func:`numbers`, those that are nothing as plain 0."""
    return " ".join("0" if v == 0.0 else repr(v) for v in values)


def write_mjcf(model: Model) -> str:
    """The whole MJCF file of a robot."""
    lines = [
        *_head(model),
        "  <worldbody>",
        *_surroundings(model),
        *_frame(model),
        *_exit_points(model),
        *_platform(model),
        "  </worldbody>",
        *_tendons(model),
        "</mujoco>",
    ]
    return "\n".join(lines) + "\n"


def _head(model: Model) -> Iterator[str]:
    yield f'<mujoco model="{model.name}">'
    yield f"  <!-- {model.title}. Written by models/make_models.py; numbers: models/README.md -->"
    yield '  <compiler angle="radian" autolimits="true"/>'
    yield '  <option gravity="0 0 -9.81" timestep="0.001" integrator="discrete"/>'
    extent = 0.75 * math.hypot(*model.frame)
    yield f'  <statistic center="{numbers(*_middle(model))}" extent="{numbers(round(extent, 3))}"/>'
    dots = {"exit": 0.005, "anchor": 0.004}
    for line in _LOOKS:
        for name, size in dots.items():
            line = line.replace(f"{{{name}}}", numbers(round(model.looks * size, 6)))
        yield line


_LOOKS = """\
  <visual>
    <global offwidth="1920" offheight="1080" azimuth="112" elevation="-11"/>
    <headlight ambient="0.45 0.45 0.45" diffuse="0.30 0.30 0.30" specular="0.1 0.1 0.1"/>
    <map znear="0.01"/>
    <quality shadowsize="4096" offsamples="8"/>
  </visual>
  <asset>
    <texture name="sky" type="skybox" builtin="gradient" rgb1="0.93 0.95 0.97" rgb2="0.6 0.68 0.76"\
 width="256" height="1536"/>
    <texture name="floor" type="2d" builtin="checker" rgb1="0.86 0.87 0.88" rgb2="0.80 0.81 0.83"\
 width="256" height="256"/>
    <material name="floor" texture="floor" texrepeat="10 10" texuniform="true" reflectance="0.05"/>
    <material name="aluminium" rgba="0.56 0.58 0.61 1" specular="0.6" shininess="0.4"/>
    <material name="bracket" rgba="0.20 0.22 0.25 1" specular="0.2" shininess="0.2"/>
    <material name="platform" rgba="0.13 0.35 0.62 1" specular="0.4" shininess="0.5"/>
  </asset>
  <default>
    <!-- geoms are looks only: no contact, no mass -->
    <geom contype="0" conaffinity="0" mass="0" group="1"/>
    <default class="exit"><site size="{exit}" rgba="0.85 0.16 0.14 1"/></default>
    <default class="anchor"><site size="{anchor}" rgba="0.98 0.75 0.12 1"/></default>
  </default>""".splitlines()


def _middle(model: Model) -> Vector:
    (x, y, z), (left, front, floor) = model.frame, model.corner
    return (left + 0.5 * x, front + 0.5 * y, floor + 0.5 * z - 0.03)


def _surroundings(model: Model) -> Iterator[str]:
    x, y, _ = _middle(model)
    above = 2.0 * model.frame[2]
    lamp = [round(v, 3) for v in (x - 0.3, y - 0.5, above + 0.8)]
    yield f'    <light name="lamp" pos="{numbers(*lamp)}" dir="0.3 0.5 -1.8" cutoff="60"'
    yield '     diffuse="0.60 0.60 0.60" specular="0.2 0.2 0.2"/>'
    wide = "2 2" if model.looks == 1.0 else numbers(*(round(max(model.frame), 3),) * 2)
    yield f'    <geom name="floor" type="plane" pos="{numbers(x, y, 0.0)}" size="{wide} 0.1"'
    yield '     material="floor"/>'
    yield f'    <camera name="front" {_camera(model, azimuth=90.0, elevation=-8.0)}/>'
    yield f'    <camera name="corner" {_camera(model, azimuth=112.0, elevation=-11.0)}/>'


def _camera(model: Model, *, azimuth: float, elevation: float) -> str:
    """Position and axes of a camera that looks at the middle of the robot; angles [deg]."""
    az, el = math.radians(azimuth), math.radians(elevation)
    ahead = (math.cos(el) * math.cos(az), math.cos(el) * math.sin(az), math.sin(el))
    up = (-math.sin(el) * math.cos(az), -math.sin(el) * math.sin(az), math.cos(el))
    distance = 1.35 * math.hypot(*model.frame)
    place = [round(m - distance * a, 4) for m, a in zip(_middle(model), ahead, strict=True)]
    axes = [round(v, 6) for v in (math.sin(az), -math.cos(az), 0.0, *up)]
    return f'pos="{numbers(*place)}" xyaxes="{numbers(*axes)}"'


def _frame(model: Model) -> Iterator[str]:
    """The frame's bars, inside its outer edges; a planar robot's is a portal behind the plane."""
    (x, y, z), half = model.frame, 0.5 * model.bar
    left, right = model.corner[0] + half, model.corner[0] + x - half
    near, far = model.corner[1] + half, model.corner[1] + y - half
    depths = (0.04,) if model.planar else (near, far)
    for d in depths:
        for side in (left, right):
            yield _bar((side, d, 0.0), (side, d, z), half)
        for height in (z - half,) if model.planar else (half, z - half):
            yield _bar((left + half, d, height), (right - half, d, height), half)
    if model.planar:
        for side in (left, right):
            yield _bar((side, 0.04 - 0.1, half), (side, 0.04 + 0.1, half), half)
        return
    for side in (left, right):
        for height in (half, z - half):
            yield _bar((side, near + half, height), (side, far - half, height), half)


def _bar(start: Vector, end: Vector, half: float) -> str:
    ends = [round(v, 6) for v in (*start, *end)]
    return (
        f'    <geom type="box" fromto="{numbers(*ends)}" size="{numbers(half)}" '
        'material="aluminium"/>'
    )


def _exit_points(model: Model) -> Iterator[str]:
    if model.looks == 1.0:
        yield from _brackets(model)
    for i, (exit_point, _) in enumerate(model.cables, start=1):
        yield f'    <site name="A{i}" class="exit" pos="{numbers(*exit_point)}"/>'


def _brackets(model: Model) -> Iterator[str]:
    """What holds the exit points: a plate per corner, a pin per point, or a pin to the portal."""
    x, y, z = model.frame
    if not model.planar:
        for px in (0.055, x - 0.055):
            for py in (0.055, y - 0.055):
                yield (
                    f'    <geom type="box" pos="{numbers(px, py, z - 0.006)}" '
                    'size="0.045 0.045 0.0015" material="bracket"/>'
                )
    for exit_point in dict.fromkeys(a for a, _ in model.cables):
        ax, ay, az = exit_point
        end = (ax, 0.04, az) if model.planar else (ax, ay, z - 0.006)
        yield (
            f'    <geom type="capsule" fromto="{numbers(ax, ay, az, *end)}" '
            'size="0.0025" material="bracket"/>'
        )


def _platform(model: Model) -> Iterator[str]:
    yield f'    <body name="platform" pos="{numbers(*model.reference)}">'
    if model.planar:
        yield '      <joint name="x" type="slide" axis="1 0 0"/>'
        yield '      <joint name="z" type="slide" axis="0 0 1"/>'
        yield '      <joint name="tilt" type="hinge" axis="0 1 0"/>'
    elif model.translates:
        for name, axis in (("x", "1 0 0"), ("y", "0 1 0"), ("z", "0 0 1")):
            yield f'      <joint name="{name}" type="slide" axis="{axis}"/>'
    else:
        yield "      <freejoint/>"
    kind = "diaginertia" if model.inertia is None else "fullinertia"
    inertia = numbers(*(model.inertia or box_inertia(model.mass, model.box)))
    centre, mass = _bare(*model.centre), numbers(model.mass)
    yield f'      <inertial pos="{centre}" mass="{mass}" {kind}="{inertia}"/>'
    halves = numbers(*(0.5 * edge for edge in model.box))
    place = f'pos="{_bare(*model.middle)}" ' if any(model.middle) else ""
    yield f'      <geom name="platform" type="box" {place}size="{halves}" material="platform"/>'
    yield from _anchor_pins(model)
    for i, (_, anchor) in enumerate(model.cables, start=1):
        yield f'      <site name="B{i}" class="anchor" pos="{numbers(*anchor)}"/>'
    yield "    </body>"


def _anchor_pins(model: Model) -> Iterator[str]:
    """A pin to each anchor point that stands well clear of the platform's box."""
    for _, anchor in model.cables:
        inside = [
            max(m - 0.5 * edge, min(m + 0.5 * edge, b))
            for b, m, edge in zip(anchor, model.middle, model.box, strict=True)
        ]
        if math.dist(anchor, inside) > 0.002:
            yield (
                f'      <geom type="capsule" fromto="{numbers(*inside, *anchor)}" '
                'size="0.002" material="bracket"/>'
            )


def _tendons(model: Model) -> Iterator[str]:
    factors = model.cable_factors or (1.0,) * len(model.cables)
    yield "  <tendon>"
    width = numbers(round(0.0012 * model.looks, 6))
    for i, ((a, b), pull) in enumerate(zip(model.cables, pulls(model), strict=True), start=1):
        on_base = [t + p for t, p in zip(model.reference, b, strict=True)]
        k_c = model.ea * factors[i - 1]
        stiffness, rest = exact_spring(k_c, math.dist(a, on_base) / (1.0 + pull / k_c))
        yield (
            f'    <spatial name="cable{i}" width="{width}" rgba="0.10 0.12 0.14 1" '
            f'springlength="0 {rest!r}" stiffness="{stiffness!r}">'
        )
        yield f'      <site site="A{i}"/><site site="B{i}"/>'
        yield "    </spatial>"
    yield "  </tendon>"


def main(arguments: list[str]) -> int:
    """Write or check every model; the exit status."""
    if arguments not in ([], ["--check"]):
        print(f"expected no argument or --check, got: {' '.join(arguments)}", file=sys.stderr)
        return 2
    differing = 0
    for model in MODELS:
        path, text = HERE / model.name / f"{model.name}.xml", write_mjcf(model)
        if path.is_file() and path.read_text(encoding="utf-8") == text:
            continue
        differing += 1
        if arguments:
            print(f"{path}: is not what make_models.py writes; run it without --check")
        else:
            _write(path, text)
            print(f"{path}: written")
    return 1 if arguments and differing else 0


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(exist_ok=True)
    part = path.with_suffix(".part")
    part.write_text(text, encoding="utf-8", newline="\n")
    os.replace(part, path)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
