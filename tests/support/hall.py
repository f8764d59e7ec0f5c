"""A platform on four slanted cables as MJCF text, into which parts of other kinds are put."""

from __future__ import annotations

from pathlib import Path

CORNERS = ((1, 1), (-1, 1), (-1, -1), (1, -1))
EXITS = "".join(
    f'<site name="a{i}" pos="{1.1 * x} {0.8 * y} {1.7 + 0.05 * i}"/>'
    for i, (x, y) in enumerate(CORNERS)
)
SITES = "".join(
    f'<site name="p{i}" pos="{0.12 * x} {0.09 * y} 0.02"/>' for i, (x, y) in enumerate(CORNERS)
)
GEOM = '<geom type="box" size="0.12 0.09 0.02" pos="0.01 0 0" mass="0.7"/>'
SPRING = 'springlength="0 1.52" stiffness="900"'


def tendon(i: int, spring: str = SPRING, path: str | None = None) -> str:
    """Cable i, by default straight."""
    way = path or f'<site site="a{i}"/><site site="p{i}"/>'
    return f'<spatial name="rope{i}" {spring}>{way}</spatial>'


def hall(
    path: Path, *, world: str = EXITS, joint: str = "<freejoint/>", inside: str = SITES,
    tendons: str = "".join(tendon(i) for i in range(4)), rest: str = "", head: str = "",
    place: str = 'pos="0.05 0.02 0.7"',
) -> Path:  # fmt: skip
    """Write the file; each part may be replaced."""
    path.write_text(
        f'<mujoco model="hall">{head}<worldbody>{world}<body name="ee" {place}>{joint}{GEOM}'
        f"{inside}</body></worldbody><tendon>{tendons}</tendon>{rest}</mujoco>"
    )
    return path
