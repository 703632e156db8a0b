"""Advice on settings follows from numbers alone, and the figure shows what it is given."""

from pathlib import Path
from typing import Any

import pytest

from benchmarks.mujoco_settings.advice import advice, beats, cost, label, markdown_table
from benchmarks.mujoco_settings.creep_figure import creep_figure


def choice(slip: float, energy: float, cpu: float, **others: Any) -> dict[str, Any]:
    """A choice that rode its two seconds; ``cpu`` a simulated second."""
    step = others.pop("step", 0.001)
    rate = {"value": energy, "half_width": 0.1}
    return {
        "engine": "soft",
        "changed": {"step": step},
        "slip": slip,
        "energy_rate": rate,
        "radius_rate": None,
        "step": step,
        "step_cost": cpu * step,
        "ridden": 2.0,
        "asked": 2.0,
        "needs": 0,
    } | others


CHEAP = choice(0.02, -10.0, 0.005, step=0.002)
FINE = choice(0.01, -5.0, 0.01)
WASTEFUL = choice(0.01, -10.0, 0.03, changed={"step": 0.001, "integrator": "RK4"})
FALLS = choice(1.0, -900.0, 0.004, changed={}, ridden=0.38)
EXACT = choice(1e-8, -1e-7, 0.03, engine="exact", changed={}, needs=1)
ROWS = [FALLS, CHEAP, WASTEFUL, FINE, EXACT]


def test_advice_says_why() -> None:
    assert advice(ROWS) == [
        "do not: off its circle after 0.38 s",
        "take it if CPU time is all that counts",
        "rather step 1 ms: 2.0 times less energy drift, 3.0 times less CPU time",
        "take it for the least slip of the engine alone",
        "take it for the least slip",
    ]


def test_nothing_is_beaten_by_what_falls_or_needs_more() -> None:
    assert not any(beats(FALLS, row) for row in ROWS)
    assert not beats(EXACT, WASTEFUL)
    assert beats({**EXACT, "needs": 0}, WASTEFUL)


def test_differences_that_nobody_notices_are_none() -> None:
    nearly = {**FINE, "slip": FINE["slip"] / 1.2, "step_cost": FINE["step_cost"] / 1.2}
    assert not beats(nearly, FINE)
    assert beats({**FINE, "slip": FINE["slip"] / 1.3, "step_cost": FINE["step_cost"] * 1.2}, FINE)


def test_advice_follows_the_numbers() -> None:
    """The wasteful choice with the least slip of all is one to take."""
    assert advice([CHEAP, {**WASTEFUL, "slip": 0.001}])[1] == "take it for the least slip of the engine alone"


def test_cost_is_that_of_a_simulated_second() -> None:
    assert cost(FINE) == pytest.approx(0.01)
    assert label({"changed": {"time_constant": 0.005, "friction": 2.0, "impedance": [0.9, 0.99, 2]}}) == (
        "time constant 5 ms, friction 2, impedance 0.9 0.99 2"
    )


def test_the_table_has_a_line_a_choice() -> None:
    lines = markdown_table(ROWS).splitlines()
    assert len(lines) == 2 + len(ROWS)
    assert {line.count("|") for line in lines} == {9}
    assert lines[3] == "| soft | step 2 ms | 20 | -10 | – | 10 | 5 | take it if CPU time is all that counts |"


def creep(damping: float, impratio: float) -> dict[str, Any]:
    law = (12 / damping, 11 / damping)
    slip = tuple(size * (1 + 0.2 / impratio) for size in law)
    shared = {"damping": damping, "time_constant": 2.1 / damping, "impratio": impratio}
    return shared | {"slip": slip, "law": law, "whole_law": slip}


@pytest.mark.parametrize("ending", [".png", ".svg"])
def test_the_figure_is_written_whole(tmp_path: Path, ending: str) -> None:
    rows = [creep(damping, impratio) for damping in (100.0, 1e3, 1e4) for impratio in (1.0, 100.0)]
    energy = [{"integrator": "Euler", "step": step, "gain": 5e3 * step} for step in (0.001, 0.002)]
    document = {"creep": {"plane": rows, "bowl": rows}, "energy": energy, "settings": {"plane": ROWS}}
    creep_figure(tmp_path / f"settings{ending}", document)
    assert [path.name for path in tmp_path.iterdir()] == [f"settings{ending}"]
    assert (tmp_path / f"settings{ending}").stat().st_size > 1e4
