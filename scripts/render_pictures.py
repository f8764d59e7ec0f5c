"""Render the README's pictures: recordings drawn by a headless Rerun viewer, a page by a browser.

    python scripts/render_pictures.py [FOLDER]

The viewer needs a graphics driver; without a graphics card Debian's ``mesa-vulkan-drivers`` will
do. The page of the diagnosis needs Chromium, and is left out where there is none. The pictures
are written to ``docs/pictures``, or to the folder given.
"""

from __future__ import annotations

import io
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from PIL import Image
from rerun.experimental import ViewerClient

from crosscheck.diagnosis.verdict import diagnose
from crosscheck.recording import write_diagnosis_recording
from crosscheck.report import write_page
from crosscheck.suite.cases import select, shipped_cases
from crosscheck.suite.run import run_case
from crosscheck.suite.thresholds import load_thresholds
from crosscheck.twin.make import make_twin
from seecr.shipped import model_path

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "pictures"
# The viewer's own bar of buttons and warnings, cut off the top [pixels].
_TOP_BAR = 36
# Messages about the machine fade after this [s]; a recording is drawn completely after this [s].
_MESSAGES_FADE, _DRAWN = 8.0, 1.5


@dataclass(frozen=True)
class Picture:
    """One picture: a recording, and where its cursor stands.

    Attributes:
        name: of the file.
        case: of the suite.
        pose: cursor on the timeline over poses; None for another timeline.
        settling_s: cursor on the timeline of the settling [s].
        step: cursor on the timeline over the models of a diagnosis.
    """

    name: str
    case: str
    pose: int | None = None
    settling_s: float | None = None
    step: int | None = None


PICTURES = (
    Picture("sweep", "parallel-fishing-z0.10", pose=2),
    Picture("settling", "parallel-fishing-z0.10", settling_s=0.1),
    Picture("cogiro", "cogiro-fishing-z0.20", pose=5),
)
# The README's case: crosscheck twin demobot_parallel.xml --hide 13.
_SEED = 13
DIAGNOSIS = Picture("diagnosis-recording", f"twin {_SEED}", step=0)
# The page: as wide as this, and of its height what a README has room for [pixels].
_PAGE, _SCALE = (1130, 1262), 1.5


def main(folder: Path = FOLDER) -> None:
    """Run the cases, record them, and draw each picture."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch, viewer() as client:
        recorded = {p.case: record(p.case, Path(scratch)) for p in PICTURES}
        for picture in PICTURES:
            client.open(str(recorded[picture.case]))
            complaints = draw(client, picture, folder / f"{picture.name}.png")
            print(f"{picture.name}.png: {picture.case}", *complaints, sep="\n  ")
        page = diagnosed(Path(scratch))
        client.open(str(page.with_suffix(".rrd")))
        complaints = draw(client, DIAGNOSIS, folder / f"{DIAGNOSIS.name}.png")
        print(f"{DIAGNOSIS.name}.png: {DIAGNOSIS.case}", *complaints, sep="\n  ")
        print(photograph(page, folder / "diagnosis-report.png"))


def diagnosed(folder: Path) -> Path:
    """Hide effects, diagnose them, and write page and recording; the page's path."""
    twin = make_twin(model_path("demobot_parallel"), _SEED)
    found = diagnose(twin.robot, twin.measured)
    write_diagnosis_recording(found, folder / "diagnosis.rrd")
    write_page(found, folder / "diagnosis.html")
    return folder / "diagnosis.html"


def photograph(page: Path, path: Path) -> str:
    """Let Chromium draw the top of the page; says what it drew."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        return f"{path.name}: left out, as there is no Chromium here"
    width, height = _PAGE
    with tempfile.TemporaryDirectory() as profile:
        subprocess.run(
            [
                browser, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars",
                "--disable-background-networking", f"--user-data-dir={profile}",
                f"--force-device-scale-factor={_SCALE}", f"--window-size={width},{height}",
                f"--screenshot={path}", page.as_uri(),
            ],
            check=True, capture_output=True,
        )  # fmt: skip
    image = Image.open(path).convert("RGB")
    image.quantize(128, dither=Image.Dither.NONE).save(path, optimize=True)
    return f"{path.name}: {DIAGNOSIS.case}"


def record(case: str, folder: Path) -> Path:
    """Run one case of the suite and write its recording."""
    (chosen,) = select(shipped_cases(), [case])
    result = run_case(chosen, load_thresholds(), folder)
    return folder / str(result.recording)


def draw(client: ViewerClient, picture: Picture, path: Path) -> list[str]:
    """Set the cursor, take the picture, and tell what the viewer could not show."""
    if picture.pose is not None:
        client.set_time("pose", sequence=picture.pose, play_state="paused")
    elif picture.step is not None:
        client.set_time("model_step", sequence=picture.step, play_state="paused")
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
