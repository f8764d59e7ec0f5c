"""Figures of results: of a sweep, of a map, and axes for others."""

from seecr.report.drawing import COLOURS, figure
from seecr.report.map_slices import map_figure
from seecr.report.sweep_panels import sweep_figure

__all__ = ["COLOURS", "figure", "map_figure", "sweep_figure"]
