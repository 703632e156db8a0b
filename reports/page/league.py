"""The page of a league: its document as one self-contained HTML document without a script."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ...engines.engine import REFERENCE
from ..measure import QUANTITIES
from . import words
from .document import list_engine_styles, render_page
from .loglog import draw_loglog

# Wheels whose slip is below this share of h J' q', the law's with one step h for 1 / b, are said to roll without creep.
CREEPS = 0.01
# Wheels creep if the law explains most of the square of their slip; other slip is sliding, sinking or a fall.
EXPLAINED = 0.5


@dataclass(frozen=True)
class LeagueColumn:
    """A column of the tables of a league: the key of its figure, the format of a number, and what it means."""

    title: str
    unit: str
    key: str
    form: str
    meaning: str

    def format_cell(self, ride: Mapping[str, Any]) -> str:
        """Return a ride's figure as text, a dash where there is none."""
        value = ride[self.key]
        if value is None:
            return "–"
        return ("yes" if value else "no") if isinstance(value, bool) else format(value, self.form)


def _column(title: str, key: str, form: str = ".2e") -> LeagueColumn:
    return LeagueColumn(title, QUANTITIES[key].unit, key, form, QUANTITIES[key].meaning)


LEAGUE_COLUMNS = (
    _column("position error", "position_error"),
    _column("rate error", "rate_error"),
    _column("energy drift", "energy_drift"),
    _column("radius drift", "radius_drift_rate"),
    LeagueColumn(
        "mean slip",
        "m/s",
        "mean_slip",
        ".2e",
        "Speed of a wheel's material at its contact point, averaged over both wheels and all samples.",
    ),
    _column("force error", "contact_force_error"),
    LeagueColumn(
        "order",
        "1",
        "observed_order",
        ".2f",
        "Order of convergence that three steps show, without the reference. The page gives below it the least and the "
        "largest order over parts of the ride; a wide range says that the order is not settled.",
    ),
    LeagueColumn("step", "s", "step", ".2e", "Mean step of the figures of this row, that of the engine's settings."),
    LeagueColumn(
        "CPU time",
        "s/s",
        "cpu_per_second",
        ".4f",
        "CPU time of a simulated second, the least of two rides; it says as much of the machine as of the engine.",
    ),
    _column("fell at", "fell_at", ".2f"),
    LeagueColumn(
        "same bits", "", "same_bits_twice", "", "Whether a second ride in the same process is the same to the last bit."
    ),
)


def rank_rides(document: Mapping[str, Any], scenario: str) -> list[tuple[str, Mapping[str, Any]]]:
    """Return the rides of a scenario: the reference, then by error; then those that fell or ended, the latest first.

    Engines without a ride come last. A ride that fell has an error up to there only, which is not compared with errors
    of whole rides.

    Parameters
    ----------
    document : mapping
        As `velodrome league --json` prints it.
    scenario : str

    Returns
    -------
    list of (str, mapping)
        Engines with their rides, as far as they were reached.
    """

    def rank(item: tuple[str, Mapping[str, Any]]) -> tuple[int, float, str]:
        name, ride = item
        if name == REFERENCE:
            return 0, 0.0, name
        if ride["status"] == "rode":
            return 1, ride["position_error"], name
        if ride["status"] in ("fell", "ended"):
            return 2, -(ride["fell_at"] or 0.0), name
        return (3 if ride["status"] == "unsuitable" else 4), 0.0, name

    found = {name: entry["scenarios"].get(scenario) for name, entry in document["engines"].items()}
    return sorted(((name, ride) for name, ride in found.items() if ride is not None), key=rank)


def classify_slip(ride: Mapping[str, Any]) -> str | None:
    """Return ``rolls``, ``creeps`` or ``slides``; None where there is no figure of creep.

    Parameters
    ----------
    ride : mapping
        An engine's part of a scenario in the document of `velodrome league`.
    """
    creep = ride["creep"]
    if creep is None:
        return None
    if creep["slip_time"] < CREEPS * ride["step"]:
        return "rolls"
    return "creeps" if creep["share"] > EXPLAINED and creep["time"] > 0 else "slides"


def find_creeping(document: Mapping[str, Any], scenario: str) -> dict[str, list[tuple[float, float]]]:
    """Return step and time 1 / b of every level of the engines whose slip follows the law of creep.

    Parameters
    ----------
    document : mapping
        As `velodrome league --json` prints it.
    scenario : str

    Returns
    -------
    dict
        Pairs of step and 1 / b [s] by engine.
    """
    found = {}
    for name, entry in document["engines"].items():
        ride = entry["scenarios"].get(scenario)
        if ride is not None and classify_slip(ride) == "creeps":
            points = [(point["step"], point["creep"]["time"]) for point in ride["points"] if point["creep"] is not None]
            found[name] = points or [(ride["step"], ride["creep"]["time"])]
    return found


def make_league_page(document: Mapping[str, Any]) -> str:
    """Write the page of a league.

    Parameters
    ----------
    document : mapping
        As `velodrome league --json` prints it.

    Returns
    -------
    str
        A self-contained HTML document. All text from the league is escaped.
    """
    names = list(document["engines"])
    return render_page(
        "league.html",
        document=document,
        facts=_list_facts(document),
        engines=list_engine_styles(names),
        columns=LEAGUE_COLUMNS,
        overview=_make_overview(document),
        sections=[_make_section(document, name, names) for name in document["scenarios"]],
        share=CREEPS,
        explained=EXPLAINED,
    )


def _list_facts(document: Mapping[str, Any]) -> list[tuple[str, str]]:
    file = document["settings_file"]
    return [
        ("Engines", f"{sum(name != REFERENCE for name in document['engines'])} beside the reference"),
        ("Scenarios", ", ".join(document["scenarios"])),
        ("Steps", f"that of the settings, halved {document['levels'] - 1} times"),
        ("Settings", "the engines' defaults" if file is None else f"the engines' defaults, replaced by {file}"),
        ("Run on", words.describe_date(document["created"])),
        ("State", "complete" if document["complete"] else "interrupted: the finished rides are shown"),
    ]


def _make_overview(document: Mapping[str, Any]) -> list[tuple[str, list[str]]]:
    """Return the position errors of every engine in all scenarios, in the order of the first scenario."""
    scenarios = list(document["scenarios"])
    ranked = [name for scenario in scenarios for name, _ in rank_rides(document, scenario) if name != REFERENCE]
    rides = {name: document["engines"][name]["scenarios"] for name in dict.fromkeys(ranked)}
    return [(name, [_describe_error(found.get(scenario)) for scenario in scenarios]) for name, found in rides.items()]


def _describe_error(ride: Mapping[str, Any] | None) -> str:
    """Return a whole ride's largest position error, or why there is none."""
    if ride is None:
        return "not reached"
    if ride["status"] == "unsuitable":
        return "not made for it"
    if ride["status"] == "failed":
        return "did not ride"
    if ride["fell_at"] is not None:
        return f"✕ fell at {ride['fell_at']:.2f} s"
    if ride["status"] == "ended":
        return "✕ ended early"
    return "–" if ride["position_error"] is None else f"{ride['position_error']:.1e}"


def _make_section(document: Mapping[str, Any], scenario: str, names: list[str]) -> dict[str, Any]:
    """Return what the page shows of a scenario."""
    table, rides = document["scenarios"][scenario], rank_rides(document, scenario)
    creeping = find_creeping(document, scenario)
    steps = [step for points in creeping.values() for step, _ in points]
    law = [(step, step) for step in (min(steps), max(steps))] if steps else []
    return {
        "name": scenario,
        "title": table["title"],
        "duration": table["duration"],
        "growth_rate": table["growth_rate"],
        "facts": [
            ("Ground", words.describe_ground(table["surface"])),
            ("Motion", words.describe_motion(table["motion"])),
            ("Disturbed by", words.describe_disturbance(table["perturbation"])),
            ("Growth rate", f"{table['growth_rate']:.4g} 1/s"),
            ("Compared over", f"{table['duration']:g} s"),
        ],
        "rows": [(name, ride, [column.format_cell(ride) for column in LEAGUE_COLUMNS]) for name, ride in rides],
        "precision": draw_loglog(
            {
                name: [(p["cpu_per_second"], p["position_error"]) for p in ride["points"] if p["cpu_per_second"]]
                for name, ride in rides
            },
            names,
        ),
        "creep": draw_loglog(creeping, names, law, "1 / b = step"),
        "slip": {
            kind: [name for name, ride in rides if name != REFERENCE and classify_slip(ride) == kind]
            for kind in ("rolls", "slides")
        },
    }
