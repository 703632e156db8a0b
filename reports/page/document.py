"""The page as a whole: from a run's data to one HTML document."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup

from ...engines.engine import Trajectory
from ...reference.inputs import Inputs
from ...reference.surface import Surface
from ..drawing import (
    COLUMNS,
    RideData,
    assign_colours,
    describe_stability,
    find_unsteadiness,
    format_numbers,
    format_table,
    format_verdict,
    make_remarks,
    rank_engines,
)
from . import curves, plan, trust, words
from .documentation import find_documentation
from .findings import describe_stop, list_findings, write_headline
from .ink import choose_mark_shapes, line_dashes, make_css, paper_colour

_PARTS = Path(__file__).parent


def make_page(
    manifest: Mapping[str, Any],
    scenario: Mapping[str, Any],
    measured: Mapping[str, Mapping[str, Any]],
    verdicts: Sequence[Mapping[str, Any]],
    trajectories: Mapping[str, Trajectory],
    surface: Surface,
    docs: str | None = None,
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
        As returned by `velodrome.scenarios.run.runner.judge_run`.
    trajectories : mapping of str to Trajectory
        By engine name, in the order of display; may be empty.
    surface : Surface
    docs : str, optional
        Address of the documentation, for links; without it that of the package's metadata, if there is one.

    Returns
    -------
    str
        A self-contained HTML document with style, script and data. All text from the run is escaped.
    """
    names, script = list(trajectories), _read_part("page.js")
    inputs = Inputs(**scenario.get("inputs") or {})
    ride = RideData(surface, trajectories, inputs=inputs)
    circular = scenario["motion"].get("kind") != "upright"
    groups = curves.draw_curves(ride, circular) if names else []
    ends = {name: float(run.time[-1]) for name, run in trajectories.items()}
    stops = {name: stop for name, values in measured.items() if (stop := describe_stop(values, ends.get(name)))}
    upright = [name for name in names if name not in stops]
    trails = plan.draw_plan(ride, names, upright) if names else None
    unsteady = find_unsteadiness(surface, inputs, circular)
    duration, rate = scenario["simulation"]["duration"], manifest["start"]["growth_rate"]
    panels = [curves.panel_data(drawn, names, measured) for _, group in groups for drawn in group]
    return render_page(
        "page.html",
        **_result_values(measured, rate, duration, ends),
        headline=words.keep_whole(write_headline(measured, ride, rate, duration), measured),
        findings=list_findings(measured, ride, duration),
        stops=stops,
        error_key=curves.ERROR_PANEL.key,
        docs=docs or find_documentation(),
        own_steps=words.describe_own_steps(manifest["engines"], duration),
        manifest=manifest,
        facts=words.list_facts(manifest, scenario),
        stability=describe_stability(rate, unsteady),
        engines=list_engine_styles(names),
        failures={name: entry["failed"] for name, entry in manifest["engines"].items() if "failed" in entry},
        left_out=manifest.get("left_out", {}),
        verdicts=[{"holds": verdict["holds"], "line": format_verdict(verdict)} for verdict in verdicts],
        criterion=scenario.get("criterion") is not None,
        duration=duration,
        groups=groups,
        has_plan=trails is not None,
        most=curves.MOST_CURVE_POINTS,
        data={
            "duration": max(ends.values(), default=duration),
            "engines": names,
            "stops": {str(names.index(name)): stop for name, stop in stops.items() if name in names},
            "panels": panels,
            "plan": trails,
        },
        script=Markup(script),
        script_hash=_script_hash(script),
    )


def _result_values(
    measured: Mapping[str, Mapping[str, Any]], growth_rate: float, duration: float, ends: Mapping[str, float]
) -> dict[str, Any]:
    """Return what the template shows of the metrics; ``ends`` are the times of the engines' last samples [s]."""
    horizons_shown = any(
        values.get("horizon") is not None and values["horizon"] < ends.get(name, duration)
        for name, values in measured.items()
    )
    return {
        "columns": COLUMNS,
        "meanings": trust.list_meanings(horizons_shown),
        "horizons_shown": horizons_shown,
        "rows": _format_rows(measured, horizons_shown),
        "trust": {
            name: trust.explain_columns(name, values, growth_rate, duration, ends.get(name))
            for name, values in measured.items()
        },
        "remarks": [line for name in rank_engines(measured) for line in make_remarks(name, measured[name], duration)],
    }


def render_page(template: str, *styles: str, **parts: Any) -> str:
    """Fill a template of this folder.

    Parameters
    ----------
    template : str
    *styles : str
        Style sheets of this folder beside that of all pages.
    **parts
        What the template shows.

    Returns
    -------
    str
        A self-contained HTML document.
    """
    # Strict: a misspelt name in the template is an error instead of a gap.
    environment = Environment(
        autoescape=True,
        loader=FunctionLoader(_read_part),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.policies["json.dumps_kwargs"] = {"allow_nan": False, "separators": (",", ":")}
    environment.filters["setting"] = words.describe_setting
    style = "".join(map(_read_part, ("page.css", *styles)))
    return environment.get_template(template).render(parts, style=Markup(style))


def _read_part(name: str) -> str:
    """Return the text of a file of this folder."""
    return (_PARTS / name).read_text(encoding="utf-8")


def _script_hash(script: str) -> str:
    """Return the source expression of a script for a content security policy, which allows this script only."""
    return "sha256-" + base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()


def list_engine_styles(names: list[str]) -> list[dict[str, str]]:
    """Return the colours, the dashes and the shape of the marks of each engine."""
    paint, dash, shape = assign_colours(names), line_dashes(names), choose_mark_shapes(names)
    return [
        {
            "name": name,
            "screen": make_css(paint[name]),
            "paper": make_css(paper_colour(name, paint[name])),
            "dash": dash[name],
            "shape": shape[name],
        }
        for name in names
    ]


def _format_rows(measured: Mapping[str, Mapping[str, Any]], horizons_shown: bool) -> dict[str, list[str]]:
    """Format the table of a run, with the horizon as its last column where it is shown."""
    table = format_table(measured)
    if not horizons_shown:
        return table
    horizons = format_numbers([measured[name].get("horizon") for name in table], 3)
    return {name: [*cells, horizon] for (name, cells), horizon in zip(table.items(), horizons, strict=True)}
