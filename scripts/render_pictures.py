"""Render the README's pictures: recordings of the suite, drawn by a headless Rerun viewer.

    python scripts/render_pictures.py [FOLDER]

The viewer needs a graphics driver; without a graphics card Debian's ``mesa-vulkan-drivers`` will
do. The pictures are written to ``docs/pictures``, or to the folder given.
"""

from __future__ import annotations

import io
import socket
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from PIL import Image
from rerun.experimental import ViewerClient

from crosscheck.cases import select, shipped_cases
from crosscheck.suite import run_case
from crosscheck.thresholds import load_thresholds

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "pictures"
# The viewer's own bar of buttons and warnings, cut off the top [pixels].
_TOP_BAR = 36
# Messages about the machine fade after this [s]; a recording is drawn completely after this [s].
_MESSAGES_FADE, _DRAWN = 8.0, 1.5


@dataclass(frozen=True)
class Picture:
    """One picture: a case of the suite, and where its cursor stands.

    Attributes:
        name: of the file.
        case: of the suite.
        pose: cursor on the timeline over poses; None for the settling.
        settling_s: cursor on the timeline of the settling [s].
    """

    name: str
    case: str
    pose: int | None = None
    settling_s: float | None = None


PICTURES = (
    Picture("sweep", "parallel-fishing-z0.10", pose=2),
    Picture("settling", "parallel-fishing-z0.10", settling_s=0.1),
    Picture("cogiro", "cogiro-fishing-z0.20", pose=5),
)


def main(folder: Path = FOLDER) -> None:
    """Run the cases, record them, and draw each picture."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch, viewer() as client:
        recorded = {p.case: record(p.case, Path(scratch)) for p in PICTURES}
        for picture in PICTURES:
            client.open(str(recorded[picture.case]))
            complaints = draw(client, picture, folder / f"{picture.name}.png")
            print(f"{picture.name}.png: {picture.case}", *complaints, sep="\n  ")


def record(case: str, folder: Path) -> Path:
    """Run one case of the suite and write its recording."""
    (chosen,) = select(shipped_cases(), [case])
    result = run_case(chosen, load_thresholds(), folder)
    return folder / str(result.recording)


def draw(client: ViewerClient, picture: Picture, path: Path) -> list[str]:
    """Set the cursor, take the picture, and tell what the viewer could not show."""
    if picture.pose is not None:
        client.set_time("pose", sequence=picture.pose, play_state="paused")
    else:
        client.set_time("settling_time", duration=picture.settling_s, play_state="paused")
    time.sleep(_DRAWN)
    image = Image.open(io.BytesIO(client.take_screenshot())).convert("RGB")
    image = image.crop((0, _TOP_BAR, image.width, image.height))
    image.save(path, optimize=True)
    views = client.get_state().views
    return [f"{view.name}: {report.summary}" for view in views for report in view.reports]


@contextmanager
def viewer() -> Iterator[ViewerClient]:
    """A headless viewer with nothing on it."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    program = Path(sys.executable).with_name("rerun")
    with ViewerClient.spawn(headless=True, port=port, executable_path=str(program)) as client:
        time.sleep(_MESSAGES_FADE)
        yield client


if __name__ == "__main__":
    main(*(Path(argument) for argument in sys.argv[1:2]))
