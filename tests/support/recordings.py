"""Recordings read back, and a viewer to show them to."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rerun.chunk import RrdReader
from rerun.experimental import ViewerClient


class Readback:
    """Everything in a recording, by entity and timeline."""

    def __init__(self, path: Path) -> None:
        self.reader = RrdReader(path)
        self.chunks = [
            (chunk.entity_path, tuple(chunk.timeline_names), chunk.to_record_batch())
            for chunk in self.reader.stream()
        ]

    @property
    def timelines(self) -> set[str]:
        return {name for _, names, _ in self.chunks for name in names}

    def entities(self, timeline: str) -> set[str]:
        return {entity for entity, names, _ in self.chunks if timeline in names}

    def column(self, entity: str, component: str, timeline: str | None = "pose") -> list[Any]:
        rows: list[Any] = []
        for path, names, batch in self.chunks:
            wanted = timeline in names if timeline else not names
            if path == entity and wanted and component in batch.schema.names:
                rows += batch.column(batch.schema.names.index(component)).to_pylist()
        assert rows, f"{entity} has no {component} over {timeline}"
        return rows

    def scalars(self, entity: str, timeline: str = "pose") -> np.ndarray:
        """Numbers (n,) of a line, be it cut into two by runs."""
        lines = np.array(self.column(entity, "Scalars:scalars", timeline), dtype=float)
        return np.where(np.isnan(lines[:, 0]), lines[:, -1], lines[:, 0])

    def seconds(self, entity: str) -> np.ndarray:
        """Times of an entity's rows on the timeline of the settling [s]."""
        for path, names, batch in self.chunks:
            if path == entity and names == ("settling_time",):
                column = batch.column(batch.schema.names.index("settling_time"))
                return column.cast("int64").to_numpy() / 1e9
        raise AssertionError(f"{entity} has no rows over settling_time")

    @property
    def views(self) -> set[str]:
        """Names of the views of the layout."""
        (store,) = self.reader.blueprints()
        name, names = "ViewBlueprint:display_name", set()
        for chunk in self.reader.stream(store=store):
            batch = chunk.to_record_batch()
            if name in batch.schema.names:
                names.add(batch.column(batch.schema.names.index(name)).to_pylist()[0][0])
        return names

    def static(self, entity: str, component: str) -> Any:
        return self.column(entity, component, None)[0]


@contextmanager
def headless_viewer() -> Iterator[Any]:
    """A headless viewer, where the machine can draw at all."""
    program = Path(sys.executable).with_name("rerun")
    if not program.is_file():
        pytest.skip(f"no Rerun viewer beside {sys.executable}")
    try:
        client = ViewerClient.spawn(
            headless=True, port=20000 + os.getpid() % 20000, executable_path=str(program)
        )
        client.take_screenshot()  # of nothing yet: whether it can draw shows only now
    except Exception as error:
        pytest.skip(f"no headless viewer here (mesa-vulkan-drivers?): {error}")
    with client:
        yield client
