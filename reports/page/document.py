"""The page as a whole: data in, one HTML document out."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined, Template
from markupsafe import Markup

from ...engines.engine import Trajectory
from ...reference.surface import Surface, SurfaceOfRevolution
from ..drawing import COLUMNS, RideData, assign_colours, describe_stability, format_cell, format_verdict, make_remarks
from . import curves, plan, trust, words
from .ink import line_dashes, make_css, paper_colour

_PARTS = Path(__file__).parent


def make_page(
    manifest: Mapping[str, Any],
    scenario: Mapping[str, Any],
    measured: Mapping[str, Mapping[str, Any]],
    verdicts: Sequence[Mapping[str, Any]],
    trajectories: Mapping[str, Trajectory],
    surface: Surface,
) -> str:
    """Write the report of a run.

    Parameters
    ----------
    manifest : mapping
        As in ``manifest.json``.
    scenario : mapping
        As in ``scenario.toml``.
    measured : mapping
        Metrics by engine name, as in ``metrics.json``.
    verdicts : sequence of mapping
        As `velodrome.scenarios.run.runner.judge_run` gives them.
    trajectories : mapping of str to Trajectory
        By engine name, in the order of display; may be empty.
    surface : Surface

    Returns
    -------
    str
        An HTML document with everything in it: style, script, data. Whatever comes from the run is escaped.
    """
    names, script = list(trajectories), _text("page.js")
    ride = RideData(surface, trajectories)
    groups = curves.draw_curves(ride, scenario["motion"].get("kind") != "upright") if names else []
    seen = plan.draw_plan(ride, names) if names else None
    steady = isinstance(surface, SurfaceOfRevolution)
    duration, rate = scenario["simulation"]["duration"], manifest["start"]["growth_rate"]
    ends = {name: float(run.time[-1]) for name, run in trajectories.items()}
    return _template().render(
        _results(measured, rate, duration, ends),
        manifest=manifest,
        facts=words.list_facts(manifest, scenario),
        stability=describe_stability(rate, steady),
        engines=_inks(names),
        failures={name: entry["failed"] for name, entry in manifest["engines"].items() if "failed" in entry},
        left_out=manifest.get("left_out", {}),
        verdicts=[{"holds": verdict["holds"], "line": format_verdict(verdict)} for verdict in verdicts],
        criterion=scenario.get("criterion") is not None,
        steady=steady,
        duration=duration,
        groups=groups,
        has_plan=seen is not None,
        most=curves.MOST_CURVE_POINTS,
        data={
            "duration": max(ends.values(), default=duration),
            "engines": names,
            "panels": [curves.panel_data(shown, names, measured) for _, group in groups for shown in group],
            "plan": seen,
        },
        style=Markup(_text("page.css")),
        script=Markup(script),
        script_hash=_hash(script),
    )


def _results(
    measured: Mapping[str, Mapping[str, Any]], growth_rate: float, duration: float, ends: Mapping[str, float]
) -> dict[str, Any]:
    """What the template says of the metrics; ``ends`` are the times of the engines' last samples [s]."""
    return {
        "columns": COLUMNS,
        "meanings": trust.COLUMN_MEANINGS,
        "horizon_meaning": trust.HORIZON,
        "rows": {name: _row(values) for name, values in measured.items()},
        "trust": {
            name: trust.explain_columns(name, values, growth_rate, duration, ends.get(name))
            for name, values in measured.items()
        },
        "fallen": [name for name, values in measured.items() if values.get("fell_at") is not None],
        "remarks": [line for name, values in measured.items() for line in make_remarks(name, values, duration)],
    }


def _template() -> Template:
    # Strict: a name that the template misspells is an error, not a gap.
    environment = Environment(
        autoescape=True, loader=FunctionLoader(_text), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.policies["json.dumps_kwargs"] = {"allow_nan": False, "separators": (",", ":")}
    environment.filters["setting"] = words.describe_setting
    return environment.get_template("page.html")


def _text(name: str) -> str:
    return (_PARTS / name).read_text(encoding="utf-8")


def _hash(script: str) -> str:
    """Name of a script in a content security policy: with it a browser runs this one and no other."""
    return "sha256-" + base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()


def _inks(names: list[str]) -> list[dict[str, str]]:
    """How each engine is drawn."""
    paint, dash = assign_colours(names), line_dashes(names)
    return [
        {
            "name": name,
            "screen": make_css(paint[name]),
            "paper": make_css(paper_colour(name, paint[name])),
            "dash": dash[name],
        }
        for name in names
    ]


def _row(values: Mapping[str, Any]) -> list[str]:
    horizon = values.get("horizon")
    return [format_cell(values, metric, part) for _, _, metric, part in COLUMNS] + [
        "–" if horizon is None else f"{horizon:.3g}"
    ]
