"""The poses that a robot can hold: single poses, whole grids, edges and probabilities."""

from __future__ import annotations

from typing import TYPE_CHECKING

from seecr.lazy import lazily

if TYPE_CHECKING:
    from seecr.workspace.bars import (
        BarBalance,
        BarManifold,
        Midlines,
        bar_balances,
        bar_manifold,
        midline_points,
    )
    from seecr.workspace.edges import boundary, held_chance, kept_chance
    from seecr.workspace.grid import Workspace
    from seecr.workspace.maps import default_axes, workspace_map
    from seecr.workspace.margins import Zone, feasible, slack_zones, tension_margin
    from seecr.workspace.spans import SlackSpan, slack_spans
    from seecr.workspace.stored import StoredMap, store_map

__all__ = [
    "BarBalance", "BarManifold", "Midlines", "SlackSpan", "StoredMap", "Workspace", "Zone",
    "bar_balances", "bar_manifold", "boundary", "default_axes", "feasible", "held_chance",
    "kept_chance", "midline_points", "slack_spans", "slack_zones", "store_map", "tension_margin",
    "workspace_map",
]  # fmt: skip

_MODULES = {
    "bars": (
        "BarBalance", "BarManifold", "bar_balances", "bar_manifold", "Midlines", "midline_points",
    ),
    "edges": ("held_chance", "kept_chance", "boundary"),
    "grid": ("Workspace",),
    "maps": ("default_axes", "workspace_map"),
    "spans": ("SlackSpan", "slack_spans"),
    "stored": ("StoredMap", "store_map"),
    "margins": ("Zone", "feasible", "slack_zones", "tension_margin"),
}  # fmt: skip

__getattr__ = lazily(__name__, {name: m for m, names in _MODULES.items() for name in names})
