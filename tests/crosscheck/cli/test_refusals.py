"""What a user may get wrong at the crosscheck command, and what of a robot is left out."""

from __future__ import annotations

import json
import shlex
import warnings
from pathlib import Path

import made_diagnoses as made
import pytest
from called import refused, run

import crosscheck
import seecr
from crosscheck.measurements.write import write_measurements
from seecr.description.mjcf import load_robot, model_path
from seecr.errors import SeecrError

pytestmark = pytest.mark.slow


Files = tuple[Path, Path]
IMPORT = "import poses log.csv --robot ROBOT --commands DATA"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        *(
            (
                f"compare ROBOT DATA --sigma position={size}",
                f"--sigma position: expected a size that can be measured, got '{size}'",
            )
            for size in ("1e-300mm", "1e-9mm", "1e300mm")
        ),
        ("compare ROBOT tiny.csv",
         "position_m must be a positive number [m] between 1e-09 and 1e+15"),
        ("compare ROBOT huge.csv", "column meas_x_m: expected a number, or an empty cell"),
        ("compare ROBOT DATA --model NOISE", "is not a model, it has sigma; expected a model as"),
        ("compare ROBOT DATA --limits none.toml",
         "none.toml: is empty; expected a TOML file with lines such as"),
        ("compare ROBOT DATA --sigma position=0.1mm --sigma position=1mm",
         "--sigma position=1mm: expected one for the position, got two; leave one out"),
        (f"{IMPORT} --clock nan", "nan is not a finite number"),
        (f"{IMPORT} --rest-for inf", "inf is not a finite number"),
        (f"{IMPORT} --rest-for -1", "expected a number above 0, got '-1'"),
        # where names have their unit, too
        (f"{IMPORT} --unit parsec", "--unit: expected one of m, cm, mm, um, got 'parsec'"),
        # quaternions of noughts
        (IMPORT, "the body is seen in 0 rows; expected at least 5"),
        ("add stiffness ROBOT DATA --model m.toml --all-from d.json",
         "expected EFFECT or --all-from, not both; got stiffness and"),
        ("add --all-from gone.json ROBOT DATA --model m.toml", "gone.json: no such file"),
        *(
            (
                f"twin --open . {other}",
                "--open shows an existing case; leave out all other options but --json",
            )
            for other in ("ROBOT", "--hide 3", "--tensions", "--poses DATA", "--out there")
        ),
        # an unset variable of a shell would let all effects in, or read what the user left out
        ("plan R D --reads ''", "--reads: expected a value, got an empty one"),
        ("plan R D --reads ' , '", "'--reads': expected KIND,..., got ' , '."),
        ("diagnose R D --only ''", "--only: expected a value, got an empty one"),
        ("diagnose R D --only=", "--only: expected a value, got none; leave it out"),
        ("diagnose R D --only ,", "'--only': expected EFFECT,..., got ','."),
        ("calibrate R D --exclude ,", "'--exclude': expected EFFECT,..., got ','."),
        ("compare R ''", "expected a value, got an empty one; leave it out"),
        *(
            (
                f"{verb} demobot_4 d.csv",
                "demobot_4: neither a file nor a shipped robot; expected an MJCF file or one of de",
            )
            for verb in ("compare", "diagnose", "plan", "add stiffness --model m.toml")
        ),
        *(
            (f"compare ROBOT {column}.csv", f"column {column}_mm: ")
            for column in ("cmd_x", "meas_x", "meas_y")
        ),
    ],
)  # fmt: skip
def test_a_mistake_is_one_sentence(
    stiff: Files, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: str, said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    robot, data = stiff
    Path("log.csv").write_text(
        "t_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n" + "".join(f"{k},1,2,3,0,0,0,0\n" for k in range(9))
    )
    Path("none.toml").write_text("# none yet\n")
    Path("tiny.csv").write_bytes(data.read_bytes())
    Path("tiny.toml").write_text("[sigma]\nposition_m = 1e-300\n")
    header, first, *rows = data.read_text().splitlines()
    cells = dict(zip(header.split(","), first.split(","), strict=True)) | {"meas_x_m": "1e300"}
    Path("huge.csv").write_text("\n".join([header, ",".join(cells.values()), *rows]))
    for column in ("cmd_x", "meas_x", "meas_y"):  # metres under millimetres
        renamed = header.replace(f"{column}_m", f"{column}_mm")
        assert renamed != header
        Path(f"{column}.csv").write_text("\n".join([renamed, first, *rows]))
    given = {"ROBOT": str(robot), "DATA": str(data), "NOISE": str(data.with_suffix(".toml"))}
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    told = refused(*(given.get(word, word) for word in shlex.split(words)))
    assert said in told and "thousands of digits" not in told
    assert "_mm: " not in said or "are these really mm?" in told
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_limit_may_be_smaller_than_any_noise(stiff: Files, tmp_path: Path, unpaged: None) -> None:
    """A model may be as near to another."""
    tight = ("--max-position", "1e-9mm", "--no-recording", "--out", tmp_path / "o")
    assert run("compare", *stiff, *tight).exit_code == 1


def test_of_many_cases_the_nearest_three_are_named() -> None:
    said = refused("run", "--case", "nosuch")
    assert said.count(",") == 3 and "--list has all" in said


def test_where_nothing_can_be_written(stiff: Files, tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("mine")
    out = tmp_path / "out"
    quiet = ("--no-recording", "--out", out)
    assert f"--figures {file}: cannot write there" in refused(
        "compare", *stiff, "--figures", file, *quiet
    )
    only = ("--only", "stiffness", *quiet)
    assert "is a folder; expected the name of a file" in refused(
        "diagnose", *stiff, "--model-out", tmp_path, *only
    )
    assert f"{file} is not a folder that can be written to" in refused(
        "diagnose", *stiff, "--model-out", file / "model.toml", *only
    )
    assert [path.name for path in tmp_path.iterdir()] == ["file"] and file.read_text() == "mine"


@pytest.mark.parametrize("words", [("add", "stiffness"), ("calibrate",)])
def test_what_cannot_be_written_is_told_before_the_fit(
    stiff: Files, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str]
) -> None:
    def fitted(*_given: object, **_options: object) -> None:
        pytest.fail("it was fitted first")

    for name in ("add_effect", "calibrate"):
        monkeypatch.setattr(crosscheck, name, fitted)
    file, model = tmp_path / "file", tmp_path / "model.toml"
    file.write_text("mine")
    assert (
        f"model.toml: cannot be written: {file} is not a folder that can be written to: Not a di"
        in refused(*words, *stiff, "--model", file / "model.toml")
    )
    assert f"--out {file}: cannot write there" in refused(
        *words, *stiff, "--model", model, "--out", file
    )
    assert list(tmp_path.iterdir()) == [file]


def test_one_row_or_rows_all_alike_are_compared(stiff: Files, tmp_path: Path) -> None:
    robot, data = stiff
    header, first, *_ = data.read_text().splitlines()
    for times in (1, 6):
        alike = tmp_path / f"alike{times}.csv"
        alike.write_text("\n".join([header, *times * [first]]))
        out = tmp_path / str(times)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            result = run("compare", robot, alike, "--no-recording", "--out", out)
        assert result.exit_code == 0 and result.stderr == "", result.output
        assert json.loads((out / "comparison.json").read_text())["rows"]["compared"] == times
        assert "Where the model fails" in (out / "comparison.html").read_text()


@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize(
    "words",
    [("diagnose", "--model-out"), ("calibrate", "--model"), ("add", "stiffness", "--model")],
)
def test_what_is_no_model_is_not_replaced_by_one(
    stiff: Files, which: int, words: tuple[str, ...], tmp_path: Path
) -> None:
    """The only robot and the only measurements had been, with status 0."""
    mine = stiff[which]
    before = mine.read_bytes()
    *verb, option = words
    said = refused(*verb, *stiff, option, mine, "--out", tmp_path / "o")
    assert f"{mine}" in said and "model" in said
    if words[0] == "diagnose":
        assert "expected the name of a new file, or a model to be replaced" in said
    assert mine.read_bytes() == before and not (tmp_path / "o").exists()
    with pytest.raises(SeecrError, match="a new file, or a model to be replaced"):
        crosscheck.save_model(mine, seecr.load_model(saved(tmp_path, stiff), stiff[0]))
    assert mine.read_bytes() == before


def saved(folder: Path, stiff: Files) -> Path:
    """A model of the robot with nothing in it."""
    path = folder / "empty.toml"
    crosscheck.save_model(path, seecr.new_model(seecr.load_robot(stiff[0])))
    return path


@pytest.mark.parametrize("folder", [".", "/", ".."])
def test_a_folder_is_no_file_of_measurements(stiff: Files, tmp_path: Path, folder: str) -> None:
    """The current folder ended as a defect of the program: it has no name to put a suffix to."""
    said = refused("compare", stiff[0], folder, "--out", tmp_path / "out")
    assert "is a directory" in said.lower() or "folder" in said


def test_measurements_are_not_replaced_by_those_of_a_twin(stiff: Files, tmp_path: Path) -> None:
    robot, data = stiff
    mine = tmp_path / "measured.csv"
    mine.write_bytes(data.read_bytes())
    said = refused("twin", robot, "--hide", 1, "--out", tmp_path)
    assert f"{mine}: would be overwritten, but no command wrote it" in said
    log = tmp_path / "log.csv"
    log.write_text("t_s,x_mm,y_mm,z_mm\n0,1,2,3\n")
    words = ("import", "poses", log, "--robot", robot, "--commands", data)
    assert "no command wrote it; move it away, or name another folder with --out" in refused(
        *words, "--out", tmp_path
    )
    assert mine.read_bytes() == data.read_bytes()
    poses = tmp_path / "poses.csv"
    poses.write_text("cmd_x_m\n0.4\n")
    said = refused("plan", robot, "--rows", 8, "--out", tmp_path)
    assert f"{poses}: would be overwritten, but no command wrote it" in said
    # nor if an older plan is there, which was made of them
    (tmp_path / "plan.json").write_text('{"files": ["add-payload.csv"]}')
    assert "no command wrote it" in refused("plan", robot, "--rows", 8, "--out", tmp_path)
    assert poses.read_text() == "cmd_x_m\n0.4\n"


FEW = ("--only", "stiffness,platform_mass")


@pytest.fixture(scope="module")
def rough(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A planar robot whose slide has an end, and readings of it."""
    folder = tmp_path_factory.mktemp("rough")
    xml, data = folder / "rough.xml", folder / "measured.csv"
    text = model_path("planar_vertical").read_text(encoding="utf-8")
    old = '<joint name="x" type="slide"'
    assert text.count(old) == 1
    xml.write_text(text.replace(old, f'{old} range="-1 1"'), encoding="utf-8")
    write_measurements(data, made.readings(radius_m=0.01))
    return xml, data


@pytest.mark.usefixtures("unpaged")
@pytest.mark.parametrize(
    ("command", "options"),
    [
        (["compare"], ["--no-recording"]),
        (["diagnose"], ["--no-recording", *FEW]),
        (["add", "pulley_radius"], ["--model", "MODEL"]),
        (["calibrate"], ["--model", "MODEL", *FEW]),
        (["plan"], []),
    ],
    ids=["compare", "diagnose", "add", "calibrate", "plan"],
)
def test_a_command_tells_it_once(
    rough: tuple[Path, Path], tmp_path: Path, command: list[str], options: list[str]
) -> None:
    places = [str(tmp_path / "m.toml") if word == "MODEL" else word for word in options]
    got = run(*command, *rough, *places, "--out", tmp_path / "out")
    assert got.exit_code in (0, 1), got.output
    assert got.stdout.count("left out here") == 0
    (note,) = load_robot(rough[0]).notes
    assert got.stderr.splitlines().count(f"note: {note}") == 1
