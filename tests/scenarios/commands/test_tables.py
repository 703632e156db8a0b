"""What commands print at any width: names and figures stay whole, and are the same."""

from __future__ import annotations

import io
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from stored_documents import show_stored_run, stored

from velodrome.reference.bicycle import Bicycle
from velodrome.scenarios.cli import app
from velodrome.scenarios.commands.present_bicycle import show_bicycle
from velodrome.scenarios.commands.present_diff import show_diff
from velodrome.scenarios.commands.present_float32 import show_float32
from velodrome.scenarios.commands.present_gate import show_verdicts
from velodrome.scenarios.commands.present_motions import show_atlas, show_circular, show_critical, show_families
from velodrome.scenarios.commands.present_precision import show_precision
from velodrome.scenarios.commands.present_sweep import show_summary
from velodrome.scenarios.commands.tables import Column, print_table
from velodrome.scenarios.gate import Verdict
from velodrome.scenarios.scenario import BicycleFile, name_bicycle
from velodrome.scenarios.studies import BicycleStudy, study_bicycle

# The longest names of the suite's own engines, and one that rich would read as markup.
LONG_NAMES = ("mujoco-exact-contact", "exudyn-plane-normal", "made[bold]up")
NUMBERS = (-0.0033912345678e-7, 26.436362407, 1234.5678901234567, -2.2250738585072014e-308)
Show = Callable[[Console], None]


def show_run(console: Console) -> None:
    run = stored("run")
    run["metrics"] |= dict.fromkeys(LONG_NAMES, run["metrics"]["mujoco-native"])
    show_stored_run(console, run)


def show_difference(console: Console) -> None:
    document = stored("diff")
    document["engines"] |= dict.fromkeys(LONG_NAMES, document["engines"]["mujoco-native"])
    show_diff(console, document)


def show_gate(console: Console) -> None:
    verdicts = []
    for name in LONG_NAMES:
        for quantity, status in (("rear_rate_drift_rate", "holds"), ("required_friction", "shown"), ("x", "worse")):
            verdicts.append(("q2-plus", Verdict(name, quantity, -3.21e-14, 1e-14, 1e-13, status, "moved by 4e-14")))
    show_verdicts(console, verdicts)


def show_study(console: Console) -> None:
    keys = ("step", "position_error", "energy_drift", "max_slip", "cpu_time")
    points = [{key: number * factor for factor, key in enumerate(keys, 1)} for number in NUMBERS]
    entry = {
        "points": points,
        "orders": [1.98765, None],
        "richardson_error": None,
        "eigenvalues": None,
        "failures": [],
        "window": 1.5,
    }
    engines = dict.fromkeys(LONG_NAMES, entry)
    show_precision(console, {"scenario": "q1", "warnings": [], "horizon": None, "duration": 1.5, "engines": engines})


def show_single_precision(console: Console) -> None:
    keys = ("distance", "step_errors", "unexplained", "rms_distance", "start", "unrelated_digits", "repeated_digits")
    ratios = {"measured_to_predicted": 12.3456}, {"measured_to_predicted": None}
    points = [{"time": 19.5, **dict.fromkeys(keys, 1.2345e-10), **ratio} for ratio in ratios]
    entry = {
        "reason": None,
        "counterpart": "mujoco-native",
        "variants": {"positions rounded": {"points": points, "ended": None}},
        "failures": [],
    }
    far = [{"time": 20.0, "distance": 0.123}]
    document = {"scenario": "q1", "warnings": [], "engines": dict.fromkeys(LONG_NAMES, entry)}
    show_float32(console, document | {"reference_distance": far})


def show_sweep(console: Console) -> None:
    entry = {
        "rows": {"done": 1234567, "refused": 12, "fell": 345, "failed": 6, "timeout": 78},
        "position_error": {"median": 1.23e-10, "worst": 4.56e-05},
        "rows_per_second": 1.234e-05,
        "reasons": ["failed: something broke"],
    }
    document = {"engines": dict.fromkeys(LONG_NAMES, entry), "folder": "sweeps/x", "stopped": None}
    show_summary(console, document, "")


def show_all_families(console: Console) -> None:
    show_families(console, stored("families"))


def show_critical_shapes(console: Console) -> None:
    keys = ("alpha", "rear_rate", "lean", "steer")
    shape: dict[str, Any] = dict(zip(keys, NUMBERS, strict=True))
    shape |= {"physical": False, "unphysical_because": ["the ground would have to pull the rear wheel: -1 N"]}
    show_critical(
        console,
        {
            **name_bicycle(Bicycle()),
            "not_found": {},
            "cusp_collision": shape,
            "last_stable": {"1": None, "2": shape},
            "merging": [shape | {"families": [1, 3]}, shape | {"families": [1]}],
        },
    )


def show_regions(console: Console) -> None:
    hopf = {"criticality": ["subcritical", "supercritical"], "cause": ["hopf", "hopf"]}
    other = {"criticality": [None, None], "cause": ["energy", "hopf"]}
    turn = {"side": "start", "alpha": 0.0310557504719, "rear_rate": 13.180289}
    bounds = [{"stable_within": [0.0123456, None]}, {"stable_within": [0.0354]}]
    vanishing = {"alpha": 0.0333487046243, "rear_rate": 13.8896236}
    regions = [
        {"family": 2, "alpha": [0.000123456, 1], "vanishing": vanishing}
        | {"start": hopf, "end": other, "bautin": [turn], "within": bounds},
        {"family": 12, "alpha": [0.0001, 1], "vanishing": None}
        | {"start": other, "end": hopf, "bautin": [], "within": None},
    ]
    document = {**name_bicycle(Bicycle()), "alphas": [0.0, 1.0], "absent": [], "stable": regions, "motions": 400000}
    show_atlas(console, document, Path("atlas"))


def show_motion(console: Console) -> None:
    show_circular(console, stored("circular"))


@cache
def studied(deviation: float | None) -> BicycleStudy:
    """The benchmark bicycle, with deviations of two parameters."""
    names = () if deviation is None else ("rear_frame_Ixz", "front_wheel_mass")
    source = BicycleFile("benchmark", Bicycle(), {name: deviation for name in names if deviation is not None})
    return study_bicycle(source, np.linspace(0.0, 10.0, 201))


def show_eigenvalues(console: Console) -> None:
    show_bicycle(console, studied(0.0123))


SHOWN = (
    *(show_run, show_difference, show_gate, show_study, show_sweep, show_single_precision),
    *(show_all_families, show_critical_shapes, show_regions, show_motion, show_eigenvalues),
)
# Those with a row or a title for each engine.
BY_ENGINE = (show_run, show_difference, show_gate, show_study, show_sweep)


def printed(show: Show, width: int) -> str:
    console = Console(file=io.StringIO(), width=width)
    show(console)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


@pytest.mark.parametrize("width", [60, 80])
@pytest.mark.parametrize("show", SHOWN)
def test_words_and_figures_are_those_of_a_wide_terminal(show: Show, width: int) -> None:
    narrow, wide = printed(show, width), printed(show, 200)
    assert "…" not in narrow + wide
    assert set(narrow.split()) == set(wide.split())
    if show in BY_ENGINE:
        assert set(LONG_NAMES) <= set(narrow.split())


@pytest.mark.parametrize(
    "show", [show_difference, show_gate, show_study, show_sweep, show_single_precision, show_critical_shapes]
)
def test_tables_fit_sixty_columns(show: Show) -> None:
    # Lines of words below a table are left to the terminal; those of these documents are short.
    lines = printed(show, 60).splitlines()
    tables = [line for line in lines if ": " not in line and not line.startswith("  ")]
    assert len(tables) > len(LONG_NAMES)
    assert all(len(line.rstrip()) <= 60 for line in tables)


def test_the_table_of_float32_is_one_in_eighty_columns() -> None:
    titles = [line for line in printed(show_single_precision, 80).splitlines() if line.startswith("time")]
    assert len(titles) == len(LONG_NAMES)
    assert {tuple(line.split()[:3]) for line in titles} == {("time", "start", "of")}
    assert all(line.endswith("all /") for line in map(str.rstrip, titles))


def test_a_table_is_one_where_it_fits_and_whole_where_nothing_does() -> None:
    columns = [
        Column("name", ["a", "b" * 64], right=False),
        Column("first", ["1", "2"], "m"),
        Column("next", ["3", "4"]),
    ]

    def show(console: Console) -> None:
        print_table(console, columns)

    wide = [line.split() for line in printed(show, 200).splitlines()]
    assert wide == [["first"], ["name", "m", "next"], ["a", "1", "3"], ["b" * 64, "2", "4"]]
    narrow = [line.split() for line in printed(show, 20).splitlines()]
    assert narrow == [
        ["first"],
        ["name", "m"],
        ["a", "1"],
        ["b" * 64, "2"],
        ["name", "next"],
        ["a", "3"],
        ["b" * 64, "4"],
    ]


def test_zero_has_no_sign() -> None:
    text = printed(show_all_families, 200)
    assert " 0.000000000" in text
    assert "-0.000000000" not in text


def test_no_deviation_of_zero_is_shown() -> None:
    none, zero, some = (
        printed(lambda console, d=d: show_bicycle(console, studied(d)), 200) for d in (None, 0.0, 0.0123)
    )
    assert "± 0.012" in some
    assert zero.split() == none.split()


@pytest.mark.parametrize("width", ["60", "80", "200"])
def test_help_names_what_every_command_does(width: str, velodrome, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", width)
    text = velodrome("--help").stdout
    assert "..." not in text.partition("Commands:")[2]
    rows = [" ".join(line.split()) for line in text.partition("Commands:")[2].splitlines()]
    for command in app.registered_commands:
        assert f"{command.name} {command.short_help}" in rows
