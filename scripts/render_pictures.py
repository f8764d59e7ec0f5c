"""Render the README's pictures: recordings drawn by a headless Rerun viewer, a page by a browser.

    python scripts/render_pictures.py [FOLDER]

The viewer needs a graphics driver; without a graphics card Debian's ``mesa-vulkan-drivers`` will
do. The page of the diagnosis needs Chromium, and is left out where there is none. The pictures
are written to ``docs/pictures``, or to the folder given. Each keeps the numbers that it shows
(``numbers`` in the PNG), by which tests tell when it is due again.
"""

from __future__ import annotations

import argparse
import io
import json
import socket
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import browser
import numpy as np
from PIL import Image
from PIL.PngImagePlugin import PngInfo
from rerun.experimental import ViewerClient

from crosscheck.diagnosis.diagnose import diagnose
from crosscheck.diagnosis.result import Diagnosis
from crosscheck.show.case_recording import write_case_recording
from crosscheck.show.error_recordings import write_diagnosis_recording
from crosscheck.show.pictures import write_page
from crosscheck.suite.agreement import load_thresholds
from crosscheck.suite.cases import Case, select, shipped_cases
from crosscheck.suite.run import run_case
from crosscheck.twin.make import make_twin
from seecr.description.mjcf import load_robot, model_path
from seecr.equilibrium.solving import solve
from seecr.show.map_figure import map_figure
from seecr.workspace.grid import Workspace
from seecr.workspace.maps import workspace_map

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "pictures"
# The viewer's own bar of buttons and warnings, cut off the top [pixels].
_TOP_BAR = 36
# Messages about the machine fade after this [s]; a recording is drawn completely after this [s].
_MESSAGES_FADE, _DRAWN = 8.0, 1.5


Numbers = dict[str, float]


@dataclass(frozen=True)
class Picture:
    """One picture: a recording, and where its cursor stands.

    Attributes:
        name: of the file.
        case: of the suite.
        x_mm: cursor on the timeline over places [mm]; None for another timeline.
        settling_s: cursor on the timeline of the settling [s].
        step: cursor on the timeline over the models of a diagnosis.
    """

    name: str
    case: str
    x_mm: int | None = None
    settling_s: float | None = None
    step: int | None = None


PICTURES = (
    Picture("sweep", "parallel-fishing-z0.10", x_mm=190),
    Picture("settling", "parallel-fishing-z0.10", settling_s=0.1),
    Picture("cogiro", "cogiro-fishing-z0.20", x_mm=250),
)
# The README's case: crosscheck twin demobot_parallel.xml --hide 13.
_SEED = 13
DIAGNOSIS = Picture("diagnosis-recording", f"twin {_SEED}", step=0)
REPORT, MAP = "diagnosis-report", "map"
# The page: as wide as this, and of its height what a README has room for [pixels].
_PAGE, _SCALE = (1130, 1262), 1.5
# seecr map demobot_cogiro --grid 0.04:0.76:73 0.04:0.46:43 0.05:0.40:6
_GRID = ((0.04, 0.76, 73), (0.04, 0.46, 43), (0.05, 0.40, 6))
_COLOURS = 256


def main(folder: Path) -> None:
    """Run the cases, record them, and draw each picture."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name, viewer() as client:
        scratch = Path(name)
        for picture in PICTURES:
            (case,) = select(shipped_cases(), [picture.case])
            write_case_recording(run_case(case, load_thresholds()), scratch / "case.rrd")
            draw(client, scratch / "case.rrd", picture, folder, numbers_of_case(case))
        twin = make_twin(model_path("demobot_parallel"), _SEED)
        found = diagnose(twin.robot, twin.measured)
        write_diagnosis_recording(found, scratch / "diagnosis.rrd")
        draw(client, scratch / "diagnosis.rrd", DIAGNOSIS, folder, numbers_of_diagnosis(found))
        photograph(found, scratch, folder)
        whole = workspace(elastic=True)
        map_figure(scratch / "map.png", whole)
        keep(scratch / "map.png", folder / f"{MAP}.png", numbers_of_map(whole), few=True)


def numbers_of_case(case: Case) -> Numbers:
    """What a recording of the suite shows: SEECR's answers, the largest of each kind."""
    robot = load_robot(case.model)
    if case.ea is not None:
        robot = replace(robot, ea=np.full(robot.n_cables, case.ea))
    found = solve(robot, case.poses)
    away = found.deviation
    return {
        "deviation_mm": 1e3 * float(np.linalg.norm(away[:, :3], axis=1).max()),
        "rotation_deg": float(np.degrees(np.linalg.norm(away[:, 3:], axis=1).max())),
        "tension_N": float(found.tensions.max()),
    }


def numbers_of_diagnosis(found: Diagnosis) -> Numbers:
    """What its page and recording show: errors step by step, and the values found."""
    out = {"before_mm": 1e3 * (found.before["position_rms_m"] or 0.0)}
    for one in found.missing:
        out[f"{one.effect} left_mm"] = 1e3 * (one.held_out_rms["position_rms_m"] or 0.0)
        values = zip(one.layout.names, one.values.tolist(), strict=True)
        out |= {f"{one.effect} {name}": value for name, value in values}
    return out


def workspace(*, elastic: bool) -> Workspace:
    """DemoBot's, in the Cogiro configuration."""
    axes = [np.linspace(*axis) for axis in _GRID]
    return workspace_map(load_robot(model_path("demobot_cogiro")), *axes, elastic=elastic)


def numbers_of_map(found: Workspace) -> Numbers:
    """What the map of a workspace shows of what can be held."""
    margins = found.margin[found.feasible]
    return {"held": float(found.feasible.sum()), "largest_margin_N": float(margins.max())}


def numbers_in(path: Path) -> Numbers:
    """The numbers that a picture was made with."""
    with Image.open(path) as picture:
        numbers: Numbers = json.loads(picture.info["numbers"])
    return numbers


def keep(made: Path | Image.Image, path: Path, numbers: Numbers, *, few: bool = False) -> None:
    """Write a picture with its numbers; one of few colours takes a third of the room."""
    image = made if isinstance(made, Image.Image) else Image.open(made)
    image = image.convert("RGB")
    if few:
        # refined by nearest means: else rare colours of a scale are one
        image = image.quantize(_COLOURS, kmeans=2, dither=Image.Dither.NONE)
    info = PngInfo()
    info.add_text("numbers", json.dumps({name: float(f"{v:.6g}") for name, v in numbers.items()}))
    image.save(path, optimize=True, pnginfo=info)
    print(f"{path.name}: {path.stat().st_size // 1000} kB")


def photograph(found: Diagnosis, scratch: Path, folder: Path) -> None:
    """Let a browser draw the top of the page, if there is one."""
    page, taken = scratch / "diagnosis.html", scratch / "diagnosis.png"
    write_page(found, page)
    if browser.browser() is None:
        print(f"{REPORT}.png: left out, as there is no Chromium or Chrome on the path")
        return
    width, height = _PAGE
    browser.shoot(page, taken, width, height=height, scale=_SCALE)
    keep(taken, folder / f"{REPORT}.png", numbers_of_diagnosis(found))


def draw(
    client: ViewerClient, recorded: Path, picture: Picture, folder: Path, numbers: Numbers
) -> None:
    """Set the cursor, take the picture, and tell what the viewer could not show."""
    client.open(str(recorded))
    if picture.x_mm is not None:
        client.set_time("x_mm", sequence=picture.x_mm, play_state="paused")
    elif picture.step is not None:
        client.set_time("model_step", sequence=picture.step, play_state="paused")
    else:
        assert picture.settling_s is not None
        client.set_time("settling_time", duration=picture.settling_s, play_state="paused")
    time.sleep(_DRAWN)
    image = Image.open(io.BytesIO(client.take_screenshot())).convert("RGB")
    image = image.crop((0, _TOP_BAR, image.width, image.height))
    keep(image, folder / f"{picture.name}.png", numbers)
    views = client.get_state().views
    print(*(f"  {view.name}: {report.summary}" for view in views for report in view.reports))


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
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", default=FOLDER)
    main(parser.parse_args().folder)
