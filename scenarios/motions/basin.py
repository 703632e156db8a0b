"""The basin of a scenario's stable circle, with its document."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...reference.basins.disturbance import disturb, disturb_on_level
from ...reference.basins.edge import EdgeBracket, Shot, find_edge, make_shoot
from ...reference.basins.edge_state import EdgeState, PassedCircle, follow_edge
from ...reference.basins.neighbours import StableNeighbours, find_stable_neighbours
from ...reference.basins.outcome import KINDS, RideOutcome
from ...reference.basins.riding import Patience, choose_patience
from ...reference.basins.survey import OutcomeMap, count_share, draw_box, map_outcomes, ride_disturbances
from ...reference.bicycle import Bicycle
from ...reference.bifurcations.orbit_search import find_bounding_orbit
from ...reference.bifurcations.orbits import PeriodicOrbit
from ...reference.inputs import NO_INPUTS
from ...reference.kinematics import LEAN
from ...reference.rideability import explain_motion
from ...reference.simulate import RideStart, simulate_many
from ...reference.stability import VARIABLES
from ...reference.surface import is_of_revolution
from ..error import ScenarioError
from ..files import DEFAULT_FIGURES, FigureOutput, make_folder, write_json
from ..scenario import CircularTable, Perturbation, Scenario, make_start, name_bicycle, name_surface

# Directions whose edges are searched for where a scenario has no perturbation of its own, in both signs.
ALONG = ("lean_rate", "steer_rate", "lean")
# Largest sizes of the scans: beyond them a bicycle of a usual size lies down or lifts a wheel at once, or has left the
# bowl's middle.
LARGEST = {"x": 2.0, "y": 2.0, "lean": 0.6, "steer": 1.0, "lean_rate": 3.0, "steer_rate": 6.0, "rear_rate": 6.0}
_LARGEST_MULTIPLE = 300.0  # of a scenario's own perturbation
_SCAN, _SPAN = 48, 1e-3  # sizes of a scan, and the smallest relative to the largest: each is 16 % above the one before
_EDGE, _MAP = 1e-6, 1e-2  # distance from the edge, relative to it, to which rides are decided
_FOLLOWED = 1000.0  # longest time for which an edge is followed [s]
_SAME_ORBIT = 1e-6  # relative difference of two solutions of one orbit, whose residuals are 1e-12 times the size of 1
_BEYOND = 1.6  # size of a map over that of the largest edge along its axes
_WINDOWS = 300  # parts of a ride whose least and greatest leans are recorded
_BINS = 8  # of energy
# The set that is drawn from: that of examples/sweeps/million-bowl.toml.
REACH = {"lean_rate": 0.3, "steer_rate": 0.3, "rear_rate": 0.3}

Watch = Callable[[str, int, int, str], None]


@dataclass(frozen=True, kw_only=True)
class BasinRequest:
    """What is asked of a basin.

    Attributes
    ----------
    along : tuple of str
        Variables along which edges are searched for; those of `ALONG` if there are none, or the scenario's own
        perturbation.
    map : tuple of str or None
        Two variables over which outcomes are mapped.
    rides : int
        Number of rides of the map, roughly.
    sample : int
        Number of disturbances that are drawn; 0 for none.
    reach : dict
        Largest changes by variable: of the map, and of those that are drawn.
    fixed_energy : bool
        Whether the rear rate is solved for so that disturbances leave the energy as it is.
    follow : bool
        Whether the edges are followed to what they lead to.
    """

    along: tuple[str, ...] = ()
    map: tuple[str, str] | None = None
    rides: int = 2500
    sample: int = 0
    reach: Mapping[str, float] | None = None
    fixed_energy: bool = False
    follow: bool = True


@dataclass(frozen=True, kw_only=True, eq=False)
class SideOfEdge:
    """A ride next to the edge, with the least and the greatest lean in windows of equal length."""

    shot: Shot
    window: float
    least: tuple[float, ...]
    greatest: tuple[float, ...]

    def as_json(self) -> dict[str, Any]:
        """Return this ride's part of the document."""
        return {
            "size": self.shot.size,
            **_describe_outcome(self.shot.outcome),
            "lean_window": self.window,
            "least_lean": list(self.least),
            "greatest_lean": list(self.greatest),
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class BasinEdge:
    """The edge along a direction, the rides on both sides of it, and what it leads to.

    Attributes
    ----------
    along : dict
        Changes of the variables for a size of 1.
    edge : EdgeBracket
    inside, outside : SideOfEdge or None
    state : EdgeState or None
        What rides on the edge tend to, where it was followed.
    known : PeriodicOrbit or None
        The unstable orbit of the edge's energy on the branches born at the ends of the stable section.
    """

    along: dict[str, float]
    edge: EdgeBracket
    inside: SideOfEdge | None
    outside: SideOfEdge | None
    state: EdgeState | None = None
    known: PeriodicOrbit | None = None

    def as_json(self) -> dict[str, Any]:
        """Return this edge's part of the document."""
        return {
            "along": self.along,
            "size": self.edge.size,
            "error": self.edge.error,
            "inside": None if self.inside is None else self.inside.as_json(),
            "outside": None if self.outside is None else self.outside.as_json(),
            "survivors_beyond": self.edge.survivors_beyond,
            "scan": {
                "size": [shot.size for shot in self.edge.scan],
                "outcome": [shot.outcome.kind for shot in self.edge.scan],
            },
            "leads_to": None if self.state is None else _describe_state(self.state, self.known),
        }


def _describe_state(state: EdgeState, known: PeriodicOrbit | None) -> dict[str, Any]:
    orbit = state.orbit
    return {
        "followed": state.time,
        "settled": state.settled,
        "lean_amplitude": state.lean_amplitude,
        "period": state.period,
        "lean_range": None if orbit is None else _find_leans(orbit),
        "orbit": None if orbit is None else _describe_orbit(orbit),
        "passed_circle": None if state.passed is None else _describe_passed(state.passed),
        "known_orbit": None if known is None else _describe_orbit(known),
        "is_known": None if orbit is None or known is None else _are_same(orbit, known),
    }


def _describe_passed(passed: PassedCircle) -> dict[str, Any]:
    values = {name: float(passed.variables[VARIABLES.index(name)]) for name in ("rear_rate", "lean", "steer")}
    return {**values, "growth": [passed.growth.real, passed.growth.imag]}


def _find_leans(orbit: PeriodicOrbit) -> list[float]:
    """Return the least and the greatest lean of an orbit."""
    greatest = float(orbit.state[VARIABLES.index("lean")])
    return [greatest - 2 * orbit.lean_amplitude, greatest]


def _are_same(one: PeriodicOrbit, other: PeriodicOrbit) -> bool:
    pairs = ((one.lean_amplitude, other.lean_amplitude), (one.period, other.period))
    return all(abs(a - b) <= _SAME_ORBIT * abs(b) for a, b in pairs)


def _describe_orbit(orbit: PeriodicOrbit) -> dict[str, Any]:
    return {
        "lean_amplitude": orbit.lean_amplitude,
        "period": orbit.period,
        "multipliers": [[value.real, value.imag] for value in orbit.multipliers.tolist()],
    }


def _describe_outcome(outcome: RideOutcome) -> dict[str, Any]:
    energy = outcome.energy if np.isfinite(outcome.energy) else None
    return {"outcome": outcome.kind, "time": outcome.time, "energy": energy, "detail": outcome.detail or None}


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnSample:
    """Outcomes of disturbances that were drawn at random from a box."""

    reach: dict[str, float]
    outcomes: list[RideOutcome]
    energy: float

    def as_json(self) -> dict[str, Any]:
        """Return the sample's part of the document."""
        found = count_share(self.outcomes)
        return {
            "reach": self.reach,
            "rides": found.rides,
            "survived": found.survived,
            "undecided": found.undecided,
            "share": found.share,
            "error": found.error,
            "outcomes": found.kinds,
            "by_energy": self._divide_by_energy(),
        }

    def _divide_by_energy(self) -> list[dict[str, Any]]:
        """Return the numbers of rides and of survived ones in ranges of the change of energy with equal numbers."""
        changes = np.array([outcome.energy - self.energy for outcome in self.outcomes])
        survived = np.array([outcome.survived for outcome in self.outcomes])
        order = np.argsort(changes)
        order = order[np.isfinite(changes[order])]
        return [
            {
                "energy_change": [float(changes[part[0]]), float(changes[part[-1]])],
                "rides": len(part),
                "survived": int(survived[part].sum()),
            }
            for part in np.array_split(order, _BINS)
            if len(part)
        ]


@dataclass(frozen=True, kw_only=True, eq=False)
class Basin:
    """The basin of a scenario's circle.

    Attributes
    ----------
    scenario, title : str
    bicycle : Bicycle
    neighbours : StableNeighbours
    family : int or None
    patience : Patience
        Of the rides next to edges.
    fixed_energy : bool
    edges : tuple of BasinEdge
    map : OutcomeMap or None
    sample : DrawnSample or None
    """

    scenario: str
    title: str
    bicycle: Bicycle
    neighbours: StableNeighbours
    family: int | None
    patience: Patience
    fixed_energy: bool
    edges: tuple[BasinEdge, ...]
    map: OutcomeMap | None = None
    sample: DrawnSample | None = None

    def as_json(self, bicycle_name: str | None = None) -> dict[str, Any]:
        """Return the JSON document of `velodrome basin`; see `name_bicycle` for the name."""
        found, motion = self.neighbours, self.neighbours.motion
        slowest = found.own_modes.slowest
        return {
            "scenario": self.scenario,
            "title": self.title,
            **name_surface(found.equations.surface),
            **name_bicycle(self.bicycle, bicycle_name),
            "fixed_energy": self.fixed_energy,
            "circle": {
                "family": self.family,
                **{name: getattr(motion, name) for name in ("rear_rate", "lean", "steer")},
                "energy": found.energy,
                "slowest_eigenvalue": [slowest.real, slowest.imag],
                "stable_within": None if found.orbit is None else found.orbit.lean_amplitude,
                "orbit": None if found.orbit is None else _describe_orbit(found.orbit),
            },
            "stable_energies": list(found.limits),
            "watched": {
                "stretch": self.patience.stretch,
                "interval": self.patience.interval,
                "longest": self.patience.longest,
                "tolerance": self.patience.tolerance,
            },
            "edges": [edge.as_json() for edge in self.edges],
            "map": None if self.map is None else _describe_map(self.map),
            "sample": None if self.sample is None else self.sample.as_json(),
        }


# A letter for each outcome in the rows of a map.
LETTERS = dict(zip(KINDS, "roeltfbun", strict=True))


def _describe_map(found: OutcomeMap) -> dict[str, Any]:
    letters = np.array([LETTERS[kind] for kind in KINDS])
    return {
        "x": {"key": found.names[0], "values": found.x.tolist()},
        "y": {"key": found.names[1], "values": found.y.tolist()},
        "letters": {letter: kind for kind, letter in LETTERS.items()},
        "rows": ["".join(row) for row in letters[found.kinds].tolist()],
        "outcomes": {kind: int((found.kinds == k).sum()) for k, kind in enumerate(KINDS) if (found.kinds == k).any()},
    }


def find_basin(
    name: str,
    scenario: Scenario,
    request: BasinRequest,
    threads: int = 1,
    watch: Watch = lambda *_: None,
) -> Basin:
    """Find which disturbances the circle of a scenario survives.

    Parameters
    ----------
    name : str
    scenario : Scenario
        With a stable circle to start from. Its perturbation, if it has one, is the direction of the edges, with sizes
        in multiples of it.
    request : BasinRequest
    threads : int
        Number of threads that share the rides.
    watch : callable
        Called with a part of the work, how much of it is done, of how much, and the unit.

    Returns
    -------
    Basin

    Raises
    ------
    ScenarioError
        If the scenario does not start from a stable, rideable circle, hands-free, on a surface of revolution.
    """
    neighbours, family = _find_neighbours(scenario)
    start = disturb_on_level if request.fixed_energy else disturb
    patience = choose_patience(neighbours, _EDGE)
    directions = _choose_directions(scenario, request)
    edges = []
    for k, (along, largest) in enumerate(directions):
        watch("edges", k, len(directions), "directions")
        edges.append(_find_edge(neighbours, along, largest, patience, request.follow, threads, start))
    rough = choose_patience(neighbours, _MAP)
    seen = sample = None
    if request.map is not None:
        values = _choose_grid(request, request.map, edges)
        count = len(values[0]) * len(values[1])
        seen = map_outcomes(
            neighbours,
            request.map,
            values,
            rough,
            threads,
            lambda done: watch("map", done, count, "rides"),
            start,
        )
    if request.sample:
        reach = dict(request.reach or REACH)
        changes = draw_box(np.array([reach.get(variable, 0.0) for variable in VARIABLES]), request.sample)
        outcomes = ride_disturbances(
            neighbours,
            changes,
            rough,
            threads,
            lambda done: watch("sample", done, request.sample, "rides"),
            start,
        )
        sample = DrawnSample(reach=reach, outcomes=outcomes, energy=neighbours.energy)
    return Basin(
        scenario=name,
        title=scenario.title,
        bicycle=scenario.make_bicycle(),
        neighbours=neighbours,
        family=family,
        patience=patience,
        fixed_energy=request.fixed_energy,
        edges=tuple(edges),
        map=seen,
        sample=sample,
    )


def _find_neighbours(scenario: Scenario) -> tuple[StableNeighbours, int | None]:
    """Return the stable circles next to a scenario's, and its family; refuse a scenario without a stable circle."""
    if not isinstance(scenario.motion, CircularTable):
        raise ScenarioError("motion: it is straight; name a scenario that starts from a stable circle, such as q2")
    bicycle, surface, inputs = scenario.make_bicycle(), scenario.surface.make(), scenario.make_inputs()
    if inputs != NO_INPUTS:
        raise ScenarioError(
            f"inputs: with {inputs.describe()} the energy is not kept, by which a ride's circle is told; leave them out"
        )
    start = make_start(scenario.model_copy(update={"perturbation": Perturbation()}))
    if start.motion is None:
        raise ScenarioError("motion: it is straight; name a scenario that starts from a stable circle, such as q2")
    if not start.growth_rate < 0:
        raise ScenarioError(
            f"motion: the circle at lean {start.motion.lean:.6g}, steer {start.motion.steer:.6g} is not stable "
            f"(disturbances grow with {start.growth_rate:.3g} 1/s); `velodrome families` lists the stable sections"
        )
    assert is_of_revolution(surface)  # or there would be no circular motion
    obstacles = explain_motion(bicycle, surface, start.motion)
    if obstacles:
        raise ScenarioError(f"motion: the circle cannot be ridden: {'; '.join(obstacles)}")
    try:
        return find_stable_neighbours(bicycle, surface, start.motion), start.family
    except ValueError as error:
        raise ScenarioError(f"motion: {error}") from error


def _choose_directions(scenario: Scenario, request: BasinRequest) -> list[tuple[dict[str, float], float]]:
    """Return the directions of the edges, in pairs of opposite ones, with the largest size of each."""
    own = {key: value for key, value in scenario.perturbation.model_dump().items() if value}
    if own and not request.along:
        both = [(own, _LARGEST_MULTIPLE)]
    else:
        both = [({key: 1.0}, LARGEST[key]) for key in request.along or ALONG]
    return [({key: sign * value for key, value in along.items()}, size) for along, size in both for sign in (1, -1)]


def _find_edge(
    neighbours: StableNeighbours,
    along: dict[str, float],
    largest: float,
    patience: Patience,
    follow: bool,
    threads: int,
    start: Callable[..., list[RideStart | None]],
) -> BasinEdge:
    """Find the edge along a direction, and follow it."""
    direction = np.array([along.get(variable, 0.0) for variable in VARIABLES])
    shoot = make_shoot(neighbours, direction, patience, threads, start)
    edge = find_edge(shoot, direction, np.geomspace(_SPAN * largest, largest, _SCAN), _EDGE)
    found = BasinEdge(
        along=along,
        edge=edge,
        inside=_record_side(edge.inside, patience),
        outside=_record_side(edge.outside, patience),
    )
    if not follow or edge.inside is None or edge.outside is None:
        return found
    state = follow_edge(neighbours, edge.inside, edge.outside, patience, _FOLLOWED, threads)
    if state is None:
        return found
    known = [find_bounding_orbit(branch, state.energy) for branch in neighbours.branches]
    smallest = min((orbit for orbit in known if orbit is not None), key=lambda one: one.lean_amplitude, default=None)
    return replace(found, state=state, known=smallest)


def _record_side(shot: Shot | None, patience: Patience) -> SideOfEdge | None:
    """Ride once more from a start next to the edge, and record the lean."""
    if shot is None:
        return None
    if shot.start is None or shot.outcome.time <= 0:
        return SideOfEdge(shot=shot, window=0.0, least=(), greatest=())
    interval = min(patience.interval, shot.outcome.time / _WINDOWS)
    times = np.arange(int(shot.outcome.time / interval) + 1) * interval
    (motion,) = simulate_many([shot.start], times, patience.tolerance)
    if isinstance(motion, ValueError):
        return SideOfEdge(shot=shot, window=0.0, least=(), greatest=())
    size = -(-len(times) // _WINDOWS)
    leans = motion.q[: len(motion.q) // size * size, LEAN].reshape(-1, size)
    return SideOfEdge(
        shot=shot,
        window=size * interval,
        least=tuple(leans.min(axis=1).tolist()),
        greatest=tuple(leans.max(axis=1).tolist()),
    )


def _choose_grid(
    request: BasinRequest, names: tuple[str, str], edges: Sequence[BasinEdge]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the values along both axes of a map, up to the reach, or somewhat beyond the edges, both ways."""
    count, values = max(2, round(request.rides**0.5)), []
    for name in names:
        reach = (request.reach or {}).get(name)
        if reach is None:
            sizes = [
                abs(e.along[name]) * e.edge.size for e in edges if set(e.along) == {name} and e.edge.size is not None
            ]
            reach = _BEYOND * max(sizes) if sizes else LARGEST[name]
        values.append(np.linspace(-reach, reach, count))
    return values[0], values[1]


def write_basin(document: Mapping[str, Any], out: Path, output: FigureOutput = DEFAULT_FIGURES) -> list[Path]:
    """Write the document and its figures into a folder, which is made if it does not exist.

    Parameters
    ----------
    document : mapping
        As `Basin.as_json` returns it.
    out : Path
    output : FigureOutput
        How figures are written.

    Returns
    -------
    list of Path
        What is written: the figure of the edges where there are some, that of the map where there is one.

    Raises
    ------
    ScenarioError
        If the folder cannot be made.
    """
    from ...reports.figures import basin_map_figure, drawn_edges, edge_rides_figure, write_formats

    make_folder(out)
    written = [out / "basin.json"]
    write_json(written[0], document)
    if drawn_edges(document):
        written += write_formats(out / "edges", partial(edge_rides_figure, document), output.formats, output.columns)
    if document["map"] is not None:
        written += write_formats(out / "map", partial(basin_map_figure, document), output.formats, output.columns)
    return written
