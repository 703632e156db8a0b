"""The run in words: what a reader must know is said, with the right numbers."""

from __future__ import annotations

from typing import Any

import pytest

from velodrome.reports.drawing.remarks import group_remarks, make_remarks
from velodrome.reports.drawing.summary import (
    COLUMNS,
    format_table,
    format_verdict,
    rank_engines,
)
from velodrome.reports.recording.summary import make_summary, make_verdict

MEASURED: dict[str, Any] = {
    "position_error": {"max": 9.397e-6, "end": 8.83e-6},
    "orientation_error": {"max": 5.1e-6, "end": 2e-6},
    "contact_force_error": 1.7e-4,
    "contact_force_error_at": 0.5,
    "settled_force_error": 1.2e-5,
    "not_finite": [],
    "radius_drift_rate": -1.23e-5,
    "energy_drift": 6.2e-8,
    "energy_drift_rate": 3e-9,
    "max_slip": 3.1e-12,
    "cpu_time": 0.24,
    "required_friction": 0.7,
    "friction": None,
    "friction_left_at": None,
    "min_normal_force": 300.0,
    "steps": 20000,
    "unconverged_steps": 0,
    "largest_residual": 1e-9,
    "fell_at": None,
    "ended": None,
    "horizon": None,
}
ALONE = dict.fromkeys(MEASURED) | {"energy_drift": 8e-14, "energy_drift_rate": 1e-14, "cpu_time": 0.01}


def text(growth_rate: float = -0.4, **changes: Any) -> str:
    measured = {"reference": ALONE, "exudyn": MEASURED | changes}
    return make_summary("A ride", measured, {"mujoco-native": "no such thing"}, [], growth_rate, 20.0)


def test_the_tables_have_every_quantity_of_every_engine() -> None:
    lines = text().splitlines()
    table = [[part.strip() for part in line.strip("|").split("|")] for line in lines if line.startswith("|")]
    found: dict[str, dict[str, str]] = {"reference": {}, "exudyn": {}}
    for header, rule, *rows in (table[:4], table[4:]):
        assert (header[0], rule) == ("engine", ["---", *["---:"] * 4])
        for row in rows:
            found[row[0]] |= dict(zip(header[1:], row[1:], strict=True))
    assert all(len(cells) == len(COLUMNS) for cells in found.values())
    assert (found["reference"]["position [m]"], found["exudyn"]["position [m]"]) == ("–", "9.4e-06")
    assert (found["reference"]["energy [1]"], found["exudyn"]["energy [1]"]) == ("8.0e-14", "6.2e-08")
    assert found["exudyn"]["radius [m/s]"] == "-1.2e-05"


def test_the_tables_fit_the_view_of_a_recording() -> None:
    """Whatever the number of engines: 62 letters of the viewer's font are 440 points, two fifths of a laptop's."""
    many = dict.fromkeys(("reference", *(f"mujoco-exact-contact{k}" for k in range(12))), MEASURED)
    for line in make_summary("A ride", many, {}, [], -0.4, 20.0).splitlines():
        if line.startswith("| "):
            assert len("".join(cell.strip() for cell in line.split("|"))) <= 62


def test_the_verdict_says_who_rides_on_and_how_near_in_three_lines() -> None:
    near, far = (MEASURED | {"position_error": {"max": error, "end": error}} for error in (2e-9, 0.61))
    measured = {
        "reference": ALONE,
        "near": near,
        "far": far,
        "fallen": MEASURED | {"fell_at": 0.4816, "position_error": {"max": 5.0, "end": 5.0}},
        "stuck": MEASURED | {"ended": "Newton failed"},
    }
    limits = {"quantity": "energy_variation", "value": 0.5, "limit": 1e-3}
    verdicts = [limits | {"engine": name, "holds": name != "far"} for name in ("near", "far")]
    assert make_verdict(measured, {"missing": "no such thing"}, verdicts, 20.0).split("\n\n") == [
        "**1 of 2 engines meet the criterion: energy variation below 0.001.** Not: far.",
        "**3 of 6 engines ride to the end, 20 s.** fallen fell at 0.48 s; stuck ended early; missing did not run.",
        "Nearest to the reference: near 2.0e-09 m, farthest far 0.61 m (largest distance).\n",
    ]
    assert make_verdict({"reference": ALONE, "near": near}, {}, [], 5.0).startswith(
        "**All 2 engines ride to the end, 5 s.**\n"
    )
    assert make_verdict({}, {"missing": "no such thing"}, [], 5.0).startswith("**0 of 1 engine rides to the end")


def test_a_column_has_one_notation() -> None:
    small = MEASURED | {"position_error": {"max": 9.397e-6, "end": 1e-6}, "cpu_time": 0.00224}
    large = MEASURED | {"position_error": {"max": 1.25, "end": 1.0}, "cpu_time": 0.5412}
    none = MEASURED | {"position_error": {"max": None}, "max_slip": 0.0, "fell_at": 3.0}
    table = format_table({"large": large, "none": none, "small": small})
    titles = [title for title, *_ in COLUMNS]
    position, slip, cpu = (titles.index(title) for title in ("position error", "largest slip", "CPU time"))
    assert [cells[position] for cells in table.values()] == ["9.4e-06", "1.2e+00", "–"]
    assert [cells[slip] for cells in table.values()] == ["3.1e-12", "3.1e-12", "0"]
    assert [cells[cpu] for cells in table.values()] == ["0.0022", "0.5412", "0.2400"]


def test_the_best_engine_comes_first_and_the_fallen_last() -> None:
    measured = {
        "fell soon": MEASURED | {"fell_at": 0.5, "position_error": {"max": 1e-9, "end": 1e-9}},
        "ended": MEASURED | {"ended": "Newton failed", "position_error": {"max": 1e-9, "end": 1e-9}},
        "fell late": MEASURED | {"fell_at": 5.0},
        "far": MEASURED | {"position_error": {"max": 1.0, "end": 1.0}},
        "near": MEASURED,
        "as near": MEASURED,
        "reference": ALONE,
    }
    assert rank_engines(measured) == ["reference", "near", "as near", "far", "fell late", "fell soon", "ended"]


def test_no_news_is_no_remark() -> None:
    assert make_remarks("exudyn", MEASURED, 20.0) == []
    assert make_remarks("exudyn", MEASURED | {"horizon": 20.0}, 20.0) == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"fell_at": 2.5}, ["fell, figures are those up to there: exudyn at 2.50 s"]),
        (
            {"min_normal_force": -12.34},
            ["contact would be lost, since the ground would have to pull a wheel: exudyn by up to 12.3 N"],
        ),
        (
            {"friction": 0.5, "friction_left_at": 1.234},
            ["contacts with too little friction to roll: exudyn from 1.23 s on (needs up to 0.7, has 0.5)"],
        ),
        ({"fell_at": 0.0}, ["fell, figures are those up to there: exudyn at 0.00 s"]),
        ({"ended": "Newton failed"}, ["ended early: exudyn (Newton failed)"]),
        ({"unconverged_steps": 3}, ["did not converge", "exudyn in 3 of 20000 steps, relative residual up to 1e-09"]),
        (
            {"unconverged_steps": 1, "largest_residual": None},
            ["so that figures are not those of the engine's equations: exudyn in 1 of 20000 steps"],
        ),
        (
            {"position_error": {"max": 0.0}, "orientation_error": {"max": 0.0}, "rear_rate_error": 0.0},
            ["rides equal to the reference's to the last bit, so that nothing was compared: exudyn"],
        ),
        ({"horizon": 7.25}, ["exudyn", "7.25 s", "instability"]),
        ({"energy_drift_rate": None}, ["energy drift below the error of the damping's work", "exudyn 6.2e-08"]),
        ({"contact_force_error_at": 0.0}, ["exudyn", "first sample"]),
        (
            {"adaptations": ["it keeps no forces of the start"]},
            ["for this release, it keeps no forces of the start: exudyn"],
        ),
    ],
)
def test_what_spoils_a_row_is_said(change: dict[str, Any], words: list[str]) -> None:
    (line,) = make_remarks("exudyn", MEASURED | change, 20.0)
    assert all(word in line for word in words)
    assert f"- {line}" in text(**change)


def test_the_same_remark_on_several_engines_is_one_line_and_falls_come_first() -> None:
    late = {"contact_force_error_at": 0.0, "settled_force_error": 0.5}
    measured = {
        "near": MEASURED | {"contact_force_error_at": 0.0},
        "far": MEASURED | late,
        "late": MEASURED | {"fell_at": 5.0} | late,
        "soon": MEASURED | {"fell_at": 0.5},
    }
    assert group_remarks(measured, 20.0) == [
        "fell, figures are those up to there: late at 5.00 s, soon at 0.50 s",
        "force error largest in the first sample; once settled: near 1.2e-05, far 5.0e-01, late 5.0e-01",
    ]


def test_a_fallen_engine_decides_no_notation() -> None:
    near = MEASURED | {"position_error": {"max": 0.012}, "cpu_time": 0.5}
    far = MEASURED | {"position_error": {"max": 0.25}, "cpu_time": 0.25}
    fell = MEASURED | {"position_error": {"max": 123.0}, "fell_at": 1.0, "cpu_time": 1e-7}
    table = format_table({"near": near, "far": far, "fell": fell})
    titles = [title for title, *_ in COLUMNS]
    position, cpu = titles.index("position error"), titles.index("CPU time")
    assert [cells[position] for cells in table.values()] == ["0.012", "0.250", "123.000"]
    # It has no digit in the others' notation.
    assert [cells[cpu] for cells in table.values()] == ["0.50", "0.25", "1.0e-07"]


def test_the_friction_that_rolling_needs_is_said_once() -> None:
    """By the reference's forces, for engines without a limit of friction too."""
    assert "coefficient of friction" not in text()
    measured = {"reference": ALONE | {"required_friction": 0.95923}, "exudyn": MEASURED}
    lines = make_summary("A ride", measured, {}, [], -0.4, 20.0).splitlines()
    assert lines.count("- Rolling without slip needs a coefficient of friction of up to 0.959.") == 1


def test_a_failure_and_the_stability_are_said() -> None:
    assert text().startswith("# A ride\n")
    assert "- mujoco-native did not run: no such thing" in text()
    assert "Lyapunov stable" in text()
    assert "0.4 1/s" in text()
    assert "unstable" in text(growth_rate=0.38445)
    assert "exp(0.3845 t / s)" in text(growth_rate=0.38445)


@pytest.mark.parametrize(
    ("value", "holds", "line"),
    [
        (5e-4, True, "exudyn: energy_variation 0.0005, limit 0.001: holds"),
        (0.5, False, "exudyn: energy_variation 0.5, limit 0.001: falls short"),
        (None, False, "exudyn: energy_variation not done, limit 0.001: falls short"),
    ],
)
def test_a_verdict_is_one_line(value: float | None, holds: bool, line: str) -> None:
    verdict = {"engine": "exudyn", "quantity": "energy_variation", "value": value, "limit": 1e-3, "holds": holds}
    assert format_verdict(verdict) == line
    # The verdict comes first.
    assert make_summary("A ride", {}, {}, [verdict], -1.0, 1.0).startswith(f"# A ride\n\n- {line}\n")
