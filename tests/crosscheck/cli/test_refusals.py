"""What a user may get wrong at the crosscheck command: one sentence, status 2, nothing written."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import pytest
from made_data import case, refused, run

import crosscheck
import seecr
from seecr.errors import SeecrError

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def stiff(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return case(tmp_path_factory.mktemp("stiff"), {"stiffness": {"factor": 1.4}})


@pytest.mark.usefixtures("unpaged")
def test_sizes_that_nothing_measures(stiff: tuple[Path, Path], tmp_path: Path) -> None:
    """Their squares are nought or without end, and no noise can be made of them."""
    for size in ("1e-300mm", "1e-9mm", "1e300mm"):
        said = refused("compare", *stiff, "--sigma", f"position={size}", "--out", tmp_path / "o")
        assert f"--sigma position: expected a size that can be measured, got '{size}'" in said
    # a limit may be as small: a model may be as near to another
    tight = ("--max-position", "1e-9mm", "--no-recording", "--out", tmp_path / "o")
    assert run("compare", *stiff, *tight).exit_code == 1
    robot, data = stiff
    other = tmp_path / "other.csv"
    other.write_bytes(data.read_bytes())
    other.with_suffix(".toml").write_text("[sigma]\nposition_m = 1e-300\n")
    assert "position_m must be a positive number [m] between 1e-09 and 1e+15" in refused(
        "compare", robot, other
    )
    header, first, *rows = data.read_text().splitlines()
    place = header.split(",").index("meas_x_m")
    cells = first.split(",")
    cells[place] = "1e300"
    other.write_text("\n".join([header, ",".join(cells), *rows]))
    assert "column meas_x_m: expected a number, or an empty cell" in refused(
        "compare", robot, other
    )


def test_where_nothing_can_be_written(stiff: tuple[Path, Path], tmp_path: Path) -> None:
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
    stiff: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str]
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


def test_a_toml_of_another_kind_is_no_model(stiff: tuple[Path, Path]) -> None:
    noise = stiff[1].with_suffix(".toml")
    assert "is not a model, it has sigma; expected a model as" in refused(
        "compare", *stiff, "--model", noise
    )


def test_one_row_or_rows_all_alike_are_compared(stiff: tuple[Path, Path], tmp_path: Path) -> None:
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


@pytest.mark.parametrize(
    ("option", "value", "said"),
    [
        ("--clock", "nan", "nan is not a finite number"),
        ("--rest-for", "inf", "inf is not a finite number"),
        ("--rest-for", "-1", "expected a number above 0, got '-1'"),
    ],
)
def test_times_of_an_import_are_numbers(option: str, value: str, said: str) -> None:
    words = ("import", "poses", "log.csv", "--robot", "r.xml", "--commands", "c.csv")
    assert said in refused(*words, option, value)


def test_a_unit_that_is_none_is_told_where_names_have_theirs_too(
    stiff: tuple[Path, Path], tmp_path: Path
) -> None:
    log = tmp_path / "log.csv"
    log.write_text("t_s,x_mm,y_mm,z_mm\n0,1,2,3\n")
    words = ("import", "poses", log, "--robot", stiff[0], "--commands", stiff[1])
    assert "--unit: expected one of m, cm, mm, um, got 'parsec'" in refused(
        *words, "--unit", "parsec"
    )


def test_quaternions_of_noughts_are_a_body_not_seen(
    stiff: tuple[Path, Path], tmp_path: Path
) -> None:
    log = tmp_path / "log.csv"
    rows = "".join(f"{k},1,2,3,0,0,0,0\n" for k in range(9))
    log.write_text(f"t_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n{rows}")
    words = ("import", "poses", log, "--robot", stiff[0], "--commands", stiff[1])
    assert "the body is seen in 0 rows; expected at least 5" in refused(*words)


def test_of_many_cases_the_nearest_three_are_named() -> None:
    said = refused("run", "--case", "nosuch")
    assert said.count(",") == 3 and "--list has all" in said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("plan", "R", "D", "--reads", ""), "--reads: expected a value, got an empty one"),
        (("plan", "R", "D", "--reads", " , "), "'--reads': expected KIND,..., got ' , '."),
        (("diagnose", "R", "D", "--only", ""), "--only: expected a value, got an empty one"),
        (("diagnose", "R", "D", "--only="), "--only: expected a value, got none; leave it out"),
        (("diagnose", "R", "D", "--only", ","), "'--only': expected EFFECT,..., got ','."),
        (("calibrate", "R", "D", "--exclude", ","), "'--exclude': expected EFFECT,..., got ','."),
        (("compare", "R", ""), "expected a value, got an empty one; leave it out"),
    ],
)
def test_nothing_given_is_not_the_same_as_not_given(words: tuple[str, ...], said: str) -> None:
    """An unset variable of a shell would let all effects in, or read what the user left out."""
    assert said in refused(*words)


@pytest.mark.parametrize("verb", [("compare",), ("diagnose",), ("plan",), ("add", "stiffness")])
def test_an_unknown_robot_lists_the_shipped_ones_nearest_first(verb: tuple[str, ...]) -> None:
    said = refused(*verb, "demobot_4", "d.csv", *(("--model", "m.toml") if "add" in verb else ()))
    assert (
        "demobot_4: neither a file nor a shipped robot; expected an MJCF file or one of de" in said
    )


@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize(
    "words",
    [("diagnose", "--model-out"), ("calibrate", "--model"), ("add", "stiffness", "--model")],
)
def test_what_is_no_model_is_not_replaced_by_one(
    stiff: tuple[Path, Path], which: int, words: tuple[str, ...], tmp_path: Path
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


def saved(folder: Path, stiff: tuple[Path, Path]) -> Path:
    """A model of the robot with nothing in it."""
    path = folder / "empty.toml"
    crosscheck.save_model(path, seecr.new_model(seecr.load_robot(stiff[0])))
    return path


def test_an_effect_beside_all_from(stiff: tuple[Path, Path], tmp_path: Path) -> None:
    words = ("add", "stiffness", *stiff, "--model", tmp_path / "m.toml", "--all-from", "d.json")
    assert "expected EFFECT or --all-from, not both; got stiffness and" in refused(*words)
    gone = tmp_path / "gone.json"
    said = refused("add", "--all-from", gone, *stiff, "--model", tmp_path / "m.toml")
    assert (
        f"{gone}: " in said and "thousands of digits" not in said and "no such file" in said.lower()
    )


def test_what_else_had_no_effect(stiff: tuple[Path, Path], tmp_path: Path) -> None:
    robot, data = stiff
    empty = tmp_path / "limits.toml"
    empty.write_text("# none yet\n")
    assert "limits.toml: is empty; expected a TOML file with lines such as" in refused(
        "compare", *stiff, "--limits", empty
    )
    twice = ("--sigma", "position=0.1mm", "--sigma", "position=1mm")
    assert "--sigma position=1mm: expected one for the position, got two; leave one out" in refused(
        "compare", *stiff, *twice
    )
    folder = ("--out", tmp_path / "there")
    for other in ((robot,), ("--hide", 3), ("--tensions",), ("--poses", data), folder):
        assert "--open shows an existing case; leave out all other options but --json" in refused(
            "twin", "--open", tmp_path, *other
        )


def test_measurements_are_not_replaced_by_those_of_a_twin(
    stiff: tuple[Path, Path], tmp_path: Path
) -> None:
    robot, data = stiff
    mine = tmp_path / "measured.csv"
    mine.write_bytes(data.read_bytes())
    said = refused("twin", robot, "--hide", 1, "--out", tmp_path)
    assert f"{mine}: would be overwritten, but is not part of an older result: there is no" in said
    log = tmp_path / "log.csv"
    log.write_text("t_s,x_mm,y_mm,z_mm\n0,1,2,3\n")
    words = ("import", "poses", log, "--robot", robot, "--commands", data)
    assert "there is no import.json next to it; expected a new folder or that of" in refused(
        *words, "--out", tmp_path
    )
    assert mine.read_bytes() == data.read_bytes()
    poses = tmp_path / "poses.csv"
    poses.write_text("cmd_x_m\n0.4\n")
    said = refused("plan", robot, "--rows", 8, "--out", tmp_path)
    assert f"{poses}: would be overwritten, but is not part of an older result" in said
    # nor if an older plan is there, which was made of them
    (tmp_path / "plan.json").write_text('{"files": ["add-payload.csv"]}')
    assert "says that it wrote it" in refused("plan", robot, "--rows", 8, "--out", tmp_path)
    assert poses.read_text() == "cmd_x_m\n0.4\n"


@pytest.mark.parametrize("column", ["cmd_x", "meas_x", "meas_y"])
def test_metres_under_millimetres_in_one_column(
    stiff: tuple[Path, Path], tmp_path: Path, column: str
) -> None:
    robot, data = stiff
    header, *rows = data.read_text().splitlines()
    other = tmp_path / "other.csv"
    assert f"{column}_m" in header
    other.write_text("\n".join([header.replace(f"{column}_m", f"{column}_mm"), *rows]))
    said = refused("compare", robot, other)
    assert f"column {column}_mm: " in said and "are these really mm?" in said
