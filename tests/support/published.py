"""Published robots, their numbers written as files of the programs that they are from."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

PLACE = Path(__file__).parents[1] / "seecr" / "importing" / "published.toml"
ROBOTS: dict[str, dict[str, Any]] = tomllib.loads(PLACE.read_text(encoding="utf-8"))
CASPR, WIREX = ROBOTS["caspr"], ROBOTS["wirex"]
_INERTIA = ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")


def _words(values: Any) -> str:
    return " ".join(str(value) for value in values)


def caspr_files(folder: Path, name: str, **changes: Any) -> tuple[Path, Path]:
    """``*_bodies.xml`` and ``*_cables.xml`` of a robot, one element a line, with some changes."""
    one = {**CASPR[name], **changes}
    bodies, cables = folder / f"{name}_bodies.xml", folder / f"{name}_cables.xml"
    moments = zip(_INERTIA, one["inertia"], strict=True)
    bodies.write_text(
        f"""<?xml version="1.0" encoding="utf-8"?>
<!DOCTYPE bodies_system SYSTEM "../../templates/bodies.dtd">
<bodies_system>
<links display_range="-1 1 -1 1 -1 1" view_angle="0 90">
<link_rigid num="1" name="platform">
<joint type="{one["joint"]}" q_initial="{_words(one["start"])}"/>
<physical>
<mass>{one["mass"]}</mass>
<com_location>{_words(one["centre"])}</com_location>
<end_location>0 0 0</end_location>
<inertia ref="{one["inertia_about"]}">
{"".join(f"<{key}>{value}</{key}>" for key, value in moments)}
</inertia>
</physical>
<parent><num>0</num>
<location>{_words(one["place"])}</location>
</parent>
</link_rigid>
</links>
</bodies_system>
"""
    )
    kind, spring = ("cable_ideal", "")
    if "K" in one:
        kind, spring = "cable_linear_spring", f"<K>{one['K']}</K>"
    rows = []
    for k, points in enumerate(one["cables"], start=1):
        base = f"<attachment><link>0</link><location>{_words(points[:3])}</location></attachment>"
        if "pulley" in one:
            base = (
                f"<base_rotating_pulley><fixed_location>{_words(points[:3])}</fixed_location>"
                f"<pulley_radius>{one['pulley']}</pulley_radius></base_rotating_pulley>"
            )
        rows.append(
            f'<{kind} name="cable {k}" attachment_reference="{one["about"]}">\n<properties>{spring}'
            f"<force_min>{one['limits'][0]}</force_min><force_max>{one['limits'][1]}</force_max>"
            f"</properties>\n<attachments>\n{base}\n<attachment><link>1</link>"
            f"<location>{_words(points[3:])}</location></attachment>\n</attachments>\n</{kind}>"
        )
    cables.write_text(
        f'<?xml version="1.0" encoding="utf-8"?>\n<cables default_cable_set="{one["set"]}">\n'
        f'<cable_set id="{one["set"]}">\n'
        + "\n".join(rows)
        + '\n</cable_set>\n<cable_set id="bare">'
        "\n</cable_set>\n</cables>\n"
    )
    return bodies, cables


def wirex_file(folder: Path, name: str, **changes: Any) -> Path:
    """The ``.wcrfx`` of a robot, one element a line, with some changes."""
    one = {**WIREX[name], **changes}
    path: Path = folder / one["file"]

    def point(values: Any) -> str:
        return " ".join(f'{axis}="{value}"' for axis, value in zip("xyz", values, strict=True))

    chains = "\n".join(
        f'<chain id="{k}">\n<base {point(row[:3])} radius="{one["pulley"]}" a33="1"/>\n'
        f"<platform {point(row[3:])}/>\n</chain>"
        for k, row in enumerate(one["cables"], start=1)
    )
    moments = " ".join(f'{key}="{value}"' for key, value in one["inertia"].items())
    cable = ""
    if "modulus" in one:
        cable = (
            f'<cable elasticity="{one["modulus"]}" radius="{one["radius"]}" '
            f'weight="{one["weight"]}"/>\n'
        )
    path.write_text(
        f'<models version="0.32">\n<robot name="{one["name"]}" motionpattern="3R3T">\n<geometry>\n'
        f'{chains}\n</geometry>\n<platform mass="{one["mass"]}">\n<inertiatensor {moments}/>\n'
        f"<centerofgravity {point(one['centre'])}/>\n</platform>\n</robot>\n{cable}</models>\n"
    )
    return path
