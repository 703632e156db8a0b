"""Command lines that nobody should type: done, a verdict, or one line; never a traceback."""

from __future__ import annotations

import io
import sys
import time
from contextlib import redirect_stderr, redirect_stdout
from itertools import chain
from pathlib import Path

import pytest
from complaints import LONGEST, PATIENCE, is_one_line
from hypothesis import given, settings
from hypothesis import strategies as st

from velodrome.scenarios import cli

NUMBERS = [
    "nan",
    "inf",
    "-inf",
    "-1",
    "-0.0",
    "0",
    "1e-320",
    "1e-300",
    "1e-12",
    "1e-9",
    "5",
    "10",
    "1e6",
    "1e400",
    "x",
    "",
]
TEXTS = ["", " ", "x", "\n", "a\nb", "\u202e", "é漢😀", "..", "/", "-", "--", "%s", "[red]", "<b>", "$x^{", "a" * 5000]
SOURCES = ["q3", "none.toml", "empty.toml", "bytes.toml", "file", "folder.toml", "..", ".toml", "", *TEXTS]
SETTINGS = [
    *(
        "x",
        "=",
        "=5",
        "a=",
        "..=1",
        "title=",
        "title=a\nb",
        "title=3",
        'tags=["\\u001b"]',
        "tags=3",
        "surface=3",
        "surface.x=1",
    ),
    *("motion=[]", "motion.near.lean=x", "motion.near=3", "motion.kind=x", "motion.family=2.0", "bicycle.wheels=3"),
    *("bicycle.trail=nan", "bicycle.wheelbase=0", "engines.reference=3", "engines.reference.x=1", "engines.none.x=1"),
    *("engines.reference.tolerance=-1", "engines.reference.tolerance=1e300", "simulation.output_rate=1e9", "title.x=1"),
    *(
        "simulation.duration=1e9",
        "surface.alpha=-0.1",
        "surface.alpha=1e-300",
        "perturbation.lean=1e5",
        "=".join("abcde"),
    ),
]
# What TOML cannot be read of at all.
SETTINGS += [
    "title=" + "[" * 3000 + "]" * 3000,
    "motion.rear_rate=" + "9" * 5000,
    "simulation.duration=5\ntitle=x",
    "=" + "k" * 5000,
]
GROUNDS = [
    *(
        "",
        ":",
        "x",
        "plane:x=1",
        "plane:",
        "paraboloid",
        "paraboloid:alpha=-1",
        "sphere:radius=0",
        "sphere:radius=1e-300",
    ),
    *("sphere:radius=nan", "sphere:radius=", "sphere:radius=1,radius=2", "sphere:radius=1}\nx={", "sphere:kind='x'"),
    *(
        "cone:slope=1e-300,rounding=1",
        "torus:ring=-1,tube=1",
        "profile:coefficients=[]",
        "profile:radii=[0,1e-300],heights=[0,1]",
    ),
    *("profile:coefficients=[" + ",".join(["1e6"] * 1000) + "]", "height-field:heights=[[1.0]],spacing=1.0"),
    *("sphere:radius=" + "[" * 3000, "sphere:radius=" + "9" * 5000),
]
TOO_TIGHT = ("sphere:radius=1e-300", GROUNDS[18])
NEAR = ["", ",", "1", "1,2,3", "a,b", "nan,1", "1e400,0", "1,2\n", "1e300,1e300"]

number, text = st.sampled_from(NUMBERS), st.sampled_from(TEXTS)


def option(name: str, values: st.SearchStrategy[str]) -> st.SearchStrategy[list[str]]:
    return values.map(lambda value: [name, value])


def line(command: str, *options: st.SearchStrategy[list[str]], most: int = 4) -> st.SearchStrategy[list[str]]:
    """A command with some of its options; nothing that takes seconds unless the options are to blame."""
    return st.lists(st.one_of(*options), max_size=most).map(lambda parts: [command, *chain.from_iterable(parts)])


plain = st.just(["--json"])
source = st.sampled_from(SOURCES).map(lambda source: [source])
change, duration = option("--set", st.sampled_from(SETTINGS)), option("--duration", number)
engine = option("--engine", st.sampled_from(["", "warp", "../x", "reference\n"]))
out = option("--out", st.sampled_from(["file", "file/x", "/dev/null", "/proc/x", "a" * 300]))
ground = option("--alpha", number) | option("--surface", st.sampled_from(GROUNDS))
family = option("--family", st.sampled_from(["0", "5", "-1", "x", "1", "2", "9" * 30]))
LINES = st.one_of(
    line("list", plain, text.map(lambda word: [word])),
    line("run", plain, source, change, duration, engine, out, option("--tag", st.sampled_from(["", "x", "\x1b"]))),
    st.tuples(change | duration | engine, st.sampled_from([[], ["--json"]])).map(
        lambda parts: ["run", "q2", *parts[0], *parts[1], "--engine", "warp", "--out", "file"]
    ),
    line("circular", plain, ground, option("--rear-rate", number), family, option("--near", st.sampled_from(NEAR))),
    st.tuples(ground, option("--rear-rate", number), family).map(
        lambda parts: ["circular", *chain.from_iterable(parts)]
    ),
    line("families", plain, option("--alpha", st.sampled_from(["nan", "-1", "1e-300", "x"])), option("--out", text)),
    st.tuples(option("--alpha", st.sampled_from(["nan", "-1", "x"])), family).map(
        lambda parts: ["bifurcations", *chain.from_iterable(parts)]
    ),
    st.tuples(
        option("--along", text) | option("--map", st.sampled_from(NEAR)) | option("--reach", st.sampled_from(NEAR)),
        st.sampled_from(["q2", "q1", "iftomm-1"]),
    ).map(lambda parts: ["basin", parts[1], *parts[0]]),
    line("precision", plain, source, change, duration, engine, option("--levels", number)),
    line("atlas", plain, option("--largest", number), option("--out", text)).map(lambda line: [*line, "--size", "1"]),
    line("check", plain, engine, option("--reason", text)).map(lambda line: [*line, "none.toml"]),
    line("view", source, option("--port", number), st.just(["--web"])),
    line("paper", option("--x", text)).map(lambda line: [*line, "--y"]),
    line("critical", text.map(lambda word: [word])).map(lambda line: [*line, "x"]),
    st.lists(text, min_size=1, max_size=3),
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the command is called: with things in the way."""
    found = tmp_path_factory.mktemp("here")
    (found / "file").write_text("in the way")
    (found / "empty.toml").write_text("")
    (found / "bytes.toml").write_bytes(bytes(range(256)))
    (found / "folder.toml").mkdir()
    return found


def called(arguments: list[str], folder: Path) -> tuple[int, str, str]:
    """Exit status, stdout and stderr of the command in this process, in a folder."""
    stdout, stderr = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(stdout), redirect_stderr(stderr):
        patch.chdir(folder)
        patch.setattr(sys, "argv", ["velodrome", *arguments])
        with pytest.raises(SystemExit) as ended:
            cli.main()
    assert isinstance(ended.value.code, int)
    return ended.value.code, stdout.getvalue(), stderr.getvalue()


def answered(arguments: list[str], folder: Path) -> None:
    before = sorted(folder.rglob("*"))
    start = time.process_time()
    status, stdout, stderr = called(arguments, folder)
    assert time.process_time() - start < PATIENCE
    assert status in (0, 1, 2)
    assert "Traceback" not in stderr
    if status == 2:
        assert stdout == ""
        assert stderr.startswith("velodrome: ")
        assert stderr.count("\n") == 1
        assert stderr.endswith("\n")
        assert len(stderr) < LONGEST + 5 * sum(map(len, arguments))  # what was typed may be repeated, escaped
        assert sorted(folder.rglob("*")) == before


@settings(max_examples=60)
@given(LINES)
def test_any_command_line_is_answered(folder: Path, arguments: list[str]) -> None:
    answered(arguments, folder)


@pytest.mark.slow
@settings(max_examples=2000)
@given(LINES)
def test_many_command_lines_are_answered(folder: Path, arguments: list[str]) -> None:
    answered(arguments, folder)


@pytest.mark.parametrize("value", SETTINGS)
def test_every_bad_setting_is_refused(value: str, folder: Path) -> None:
    status, stdout, stderr = called(["run", "q2", "--set", value, "--engine", "reference", "--out", "file"], folder)
    assert (status, stdout) == (2, "")
    assert is_one_line(stderr.removesuffix("\n"))


@pytest.mark.parametrize("value", GROUNDS, ids=range(len(GROUNDS)))
def test_every_bad_ground_is_refused(value: str, folder: Path) -> None:
    where = ["--surface", value, "--rear-rate", "18", "--family", "2"]
    status, stdout, stderr = called(["circular", *where], folder)
    # The plane may be written with nothing after the colon; two of the bowls are possible, but nothing rides in them.
    expected = 0 if value == "plane:" else 1 if value in TOO_TIGHT else 2
    assert (status, stdout == "") == (expected, status != 0)
    assert status == 0 or is_one_line(stderr.removesuffix("\n"))


def test_a_folder_that_no_file_system_takes_is_one_line(folder: Path) -> None:
    status, _, stderr = called(["run", "q2", "--duration", "0.02", "--engine", "reference", "--out", "\udcff"], folder)
    assert status == 2
    assert stderr.startswith("velodrome: cannot write: ")
    assert is_one_line(stderr.removesuffix("\n"))


@pytest.mark.parametrize("command", [["paper"], ["precision", "q2"], ["float32", "q2"]])
def test_a_folder_that_cannot_be_made_is_said_before_the_work(command: list[str], folder: Path) -> None:
    start = time.process_time()
    assert called([*command, "--out", "file"], folder)[0] == 2
    # The work takes 15 s and more.
    assert time.process_time() - start < PATIENCE


@pytest.mark.parametrize("size", ["999", "20000001", "9" * 30])
def test_an_atlas_of_any_size_is_refused_before_it_is_made(size: str, folder: Path) -> None:
    status, _, stderr = called(["atlas", "--size", size], folder)
    assert status == 2
    assert "from 1000 to 20000000 motions" in stderr
