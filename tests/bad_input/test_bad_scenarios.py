"""Scenario files that somebody's hand, disk or program has spoilt: a scenario, or one line that says what is wrong."""

from __future__ import annotations

import os
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest
from complaints import refusing
from hypothesis import given, settings
from hypothesis import strategies as st

from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.run.runner import plan_run
from velodrome.scenarios.scenario.schema import LIBRARY, load_scenario

TEXTS = [(LIBRARY / f"{name}.toml").read_text(encoding="utf-8") for name in ("q2-plus", "sphere", "iftomm-1")]
DEEP = 3000  # beyond Python's limit of recursion
NASTY = [
    *("nan", "inf", "-inf", "-0.0", "0", "0.0", "-1.0", "1e-300", "5e-324", "1e308", "1e6", "9" * 400, "9" * 5000),
    *("0x" + "f" * 5000, "true", '""', '"x"', '"18"', '"a\\nb"', '"\\u001b[31m"', '"\\u202e"', "'<b>'", '"../../x"'),
    *(
        "[]",
        "[1, [2]]",
        "{}",
        "{ a = 1 }",
        "2020-01-01",
        "07:32:00",
        "[" * DEEP + "]" * DEEP,
        "{a=" * DEEP + "1" + "}" * DEEP,
    ),
    *('"' + "k" * 100_000 + '"', str(list(range(2000))), '"é漢😀"', "\x00", "'''", "#", "=", ""),
]
KEYS = ["", "x", "kind", "title", "surface.alpha", '"a\\nb"', '"\\u001b"', "'<i>'", "a" * 5000, ".".join("a" * 2000)]


def with_line(change: Callable[[str, str], str]) -> Callable[[str, int, str], str]:
    """A change of one line of a file."""

    def changed(text: str, where: int, what: str) -> str:
        lines = text.split("\n")
        k = where % len(lines)
        return "\n".join([*lines[:k], change(lines[k], what), *lines[k + 1 :]])

    return changed


def swapped(text: str, where: int, what: str) -> str:
    lines = text.split("\n")
    a, b = where % len(lines), len(what) % len(lines)
    lines[a], lines[b] = lines[b], lines[a]
    return "\n".join(lines)


CHANGES: dict[str, Callable[[str, int, str], str]] = {
    "drop": with_line(lambda line, what: ""),
    "double": with_line(lambda line, what: f"{line}\n{line}"),
    "value": with_line(lambda line, what: f"{line.partition('=')[0]}= {what}"),
    "key": with_line(lambda line, what: f"{KEYS[len(what) % len(KEYS)]} ={line.partition('=')[2]}"),
    "table": with_line(lambda line, what: f"[{KEYS[len(what) % len(KEYS)]}]\n{line}"),
    "cut": lambda text, where, what: text[: where % (len(text) + 1)],
    "into": lambda text, where, what: text[: where % len(text)] + what[:50] + text[where % len(text) :],
    "swap": swapped,
}
SPOILT = st.tuples(
    st.sampled_from(TEXTS),
    st.lists(
        st.tuples(
            st.sampled_from(sorted(CHANGES)), st.integers(0, 10_000), st.sampled_from(NASTY) | st.text(max_size=20)
        ),
        min_size=1,
        max_size=3,
    ),
).map(lambda spoilt: _spoilt(*spoilt))


def _spoilt(text: str, changes: list[tuple[str, int, str]]) -> str:
    for change, where, what in changes:
        text = CHANGES[change](text, where, what)
    return text


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("scenarios") / "spoilt.toml"


def answered(path: Path, content: bytes, planned: bool) -> None:
    path.write_bytes(content)
    with refusing() as said:
        name, scenario = load_scenario(str(path))
        assert name == "spoilt"
        assert scenario.title.isprintable()
    assert all(line.startswith(f"{path}: ") for line in said)
    if said or not planned:
        return
    with refusing() as said:
        plan = plan_run(name, scenario, ["reference"])
        assert len(plan.start.problem.times) >= 2
    assert all(line.startswith(("motion: ", "engine", "bicycle")) for line in said)


@settings(max_examples=200)
@given(SPOILT)
def test_a_spoilt_file_is_a_scenario_or_one_line(path: Path, text: str) -> None:
    answered(path, text.encode("utf-8", "surrogatepass"), planned=False)


@settings(max_examples=25)
@given(SPOILT)
def test_a_scenario_that_could_be_read_can_be_planned_or_is_refused(path: Path, text: str) -> None:
    answered(path, text.encode("utf-8", "surrogatepass"), planned=True)


@pytest.mark.slow
@settings(max_examples=1500)
@given(SPOILT)
def test_many_spoilt_files_are_planned_or_refused(path: Path, text: str) -> None:
    answered(path, text.encode("utf-8", "surrogatepass"), planned=True)


@settings(max_examples=100)
@given(st.binary(max_size=200) | st.text(max_size=200).map(lambda text: text.encode("utf-16")))
def test_bytes_are_refused(path: Path, content: bytes) -> None:
    answered(path, content, planned=False)


def test_a_file_from_windows_is_read(path: Path) -> None:
    text = TEXTS[0].replace("\n", "\r\n")
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert load_scenario(str(path))[1] == load_scenario("q2-plus")[1]


@pytest.mark.parametrize("value", NASTY, ids=range(len(NASTY)))
def test_every_nasty_value_is_refused_where_it_stands(value: str, path: Path) -> None:
    path.write_text(TEXTS[0].replace("rear_rate = 18.0", f"rear_rate = {value}"))
    with refusing() as said:
        load_scenario(str(path))
    # A rate may be small; whether there is such a motion is another question.
    assert (not said) == (value in ("1e-300", "5e-324"))


@pytest.mark.parametrize("name", ["a\nb.toml", "a\x1b[31mb.toml", "a\x00b.toml", "\udcff.toml", "\u202egnp.toml"])
def test_a_file_whose_name_is_no_text_is_refused(name: str, tmp_path: Path) -> None:
    with refusing() as said:
        load_scenario(str(tmp_path / name))
    assert said


def test_a_pipe_keeps_nobody_waiting(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.toml")
    with pytest.raises(ScenarioError, match="it is no file"):
        load_scenario(str(tmp_path / "pipe.toml"))


@pytest.mark.parametrize("tag", ["", "a\nb", "\x1b", "\udcff"])
def test_a_tag_is_one_line_of_text(tag: str) -> None:
    with pytest.raises(ScenarioError, match="tags: must be one line of text"):
        load_scenario("q2", {"tags": ["good", tag]})


@pytest.mark.parametrize(
    ("duration", "rate", "words"),
    [
        (1e5, 1e4, "at most 5e6"),
        (1.0, 1e9, "less than or equal to 100000"),
        (1e9, 1.0, "less than or equal to 100000"),
        (1e-3, 100.0, "no whole number of output intervals of 0.01 s"),
        (5e-324, 5e-324, "no whole number of output intervals"),
    ],
)
def test_too_many_samples_are_refused_before_any_is_made(duration: float, rate: float, words: str) -> None:
    tracemalloc.start()
    try:
        with pytest.raises(ScenarioError, match=words):
            load_scenario("q2", {"simulation.duration": duration, "simulation.output_rate": rate})
        # 5e6 samples of 8 bytes would be 40 MB.
        assert tracemalloc.get_traced_memory()[1] < 1e6
    finally:
        tracemalloc.stop()
