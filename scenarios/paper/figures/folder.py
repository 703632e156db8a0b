"""The folder of the paper's figures and tables (Xiong, Wang and Liu 2020)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from ....reference.bicycle import Bicycle
from ....reference.circular import CircularMotion
from ....reference.contact import observe
from ....reference.families import trace
from ....reference.simulate import simulate, simulate_modified_euler
from ....reference.stability import independent, linearise
from ....reference.surface import Paraboloid
from ....reports.figures import family_figure, write_formats
from ...files import FigureOutput, make_folder, write_json, write_text
from ...motions import families_document
from ...scenario import Start, load_scenario, make_start
from ..energy import motion_of_energy
from ..ledger import LedgerLine, ledger_document
from ..printed import known_discrepancies
from ..table import ledger_markdown
from .captions import captions_text, configurations_caption, departure_caption, disturbed_caption, families_caption
from .configurations import Configuration, configurations_figure
from .tables import LinearisedPoint, linearisation_document, linearisation_tables
from .trajectories import FigureRide, departure_figure, disturbed_figure, while_pushed

ALPHAS = {"figure-2": 0.0, "figure-3": 1 / 200, "figure-4": 1 / 20, "figure-5": 1 / 5, "figure-7": 1.0}
MARKS = {"figure-3": ("q1", "q2"), "figure-5": ("p1", "p2", "p3", "p4")}  # motions that the paper marks
DISTURBED_SCENARIO = {"+0.1 rad/s": "q2-plus", "−0.1 rad/s": "q2-minus"}
DEPARTURE, SETTLING = 100.0, 60.0  # durations simulated from Q1 and about Q2 [s]

# A function that draws the figure for a number of columns, and the caption.
DrawnFigure = tuple[Callable[[int], Figure], str]
# (what is drawn, how far it is, how far it goes)
FigureWatch = Callable[[str, float, float], None]


def write_figures(out: Path, progress: FigureWatch, output: FigureOutput) -> list[Path]:
    """Compute and write Figures 2 to 9, their captions, and the tables at Q1 and Q2.

    Parameters
    ----------
    out : Path
        Folder, made if it does not exist.
    progress : callable
        Called with the next figure, the number of figures done and the number of steps in all.
    output : FigureOutput
        Formats and width of the figures.

    Returns
    -------
    list of Path
        Files written, each one completely or not at all.
    """
    out.mkdir(parents=True, exist_ok=True)
    written: list[Path] = []
    captions: dict[str, str] = {}
    jobs = _drawing_functions()
    for done, (name, compute) in enumerate(jobs.items()):
        progress(name, done, len(jobs) + 1)
        draw, captions[name] = compute()
        written += write_formats(out / name, draw, output.formats, output.columns)
    progress("tables", len(jobs), len(jobs) + 1)
    points = [linearised_point("Q1", "q1"), linearised_point("Q2", "q2")]
    write_text(out / "captions.md", captions_text(captions))
    write_text(out / "tables.md", linearisation_tables(points))
    write_json(out / "linearisation.json", linearisation_document(points))
    return [*written, *(out / name for name in ("captions.md", "tables.md", "linearisation.json"))]


def write_paper(out: Path, lines: Sequence[LedgerLine], progress: FigureWatch, output: FigureOutput) -> list[Path]:
    """Write the ledger, as JSON and as a page of Markdown, and all figures and tables into a folder.

    Raises
    ------
    ScenarioError
        If the folder cannot be made.
    """
    make_folder(out)
    write_json(out / "ledger.json", ledger_document(lines, known_discrepancies()))
    write_text(out / "ledger.md", ledger_markdown(lines))
    return [out / "ledger.json", out / "ledger.md", *write_figures(out, progress, output)]


def _drawing_functions() -> dict[str, Callable[[], DrawnFigure]]:
    """Return the functions that compute what the figures show, by the figures' names, in the paper's order."""
    jobs: dict[str, Callable[[], DrawnFigure]] = {name: partial(_draw_families, name) for name in ALPHAS}
    jobs |= {"figure-6": _draw_configurations, "figure-8": _draw_departure, "figure-9": _draw_disturbed}
    return dict(sorted(jobs.items()))


def _draw_families(name: str) -> DrawnFigure:
    alpha, marked = ALPHAS[name], {key.upper(): start_named(key) for key in MARKS.get(name, ())}
    marks = {key: _marked_values(_require_motion(start)) for key, start in marked.items()}
    document = families_document(alpha)
    radius = Bicycle().front_wheel_radius
    return partial(family_figure, document, radius, marks), families_caption(document, radius)


def _draw_configurations() -> DrawnFigure:
    starts = {name: start_named(name) for name in MARKS["figure-5"]}
    shown = [Configuration(name.upper(), start.family or 0, _require_motion(start)) for name, start in starts.items()]
    problem = starts["p1"].problem
    draw = partial(configurations_figure, problem.bicycle, problem.surface, shown)
    return draw, configurations_caption(ALPHAS["figure-5"])


def _draw_departure() -> DrawnFigure:
    start = start_named("q1", DEPARTURE)
    ride, motion = ride_from("Q1", start), _require_motion(start)
    draw = partial(departure_figure, ride, motion, start.growth_rate)
    return draw, departure_caption(ride, motion, start.growth_rate)


def _draw_disturbed() -> DrawnFigure:
    circle = _require_motion(start_named("q2"))
    starts = {words: start_named(name, SETTLING) for words, name in DISTURBED_SCENARIO.items()}
    rides = [ride_from(words, start) for words, start in starts.items()]
    neighbours = {words: circle_of_equal_energy(start, circle) for words, start in starts.items()}
    draw = partial(disturbed_figure, rides, circle, neighbours)
    return draw, disturbed_caption(rides, circle, neighbours)


def ride_from(name: str, start: Start) -> FigureRide:
    """Integrate a start precisely and by the paper's method, until the ground would have to pull a wheel."""
    problem = start.problem
    motions = [
        integrate(problem.bicycle, problem.surface, problem.q, problem.qd, problem.times)
        for integrate in (simulate, simulate_modified_euler)
    ]
    return FigureRide(name, *(while_pushed(motion, problem.bicycle, problem.surface) for motion in motions))


def circle_of_equal_energy(start: Start, circle: CircularMotion) -> CircularMotion:
    """Return the circular motion of a start's energy, which the ride conserves, in the family of a circle."""
    problem, number = start.problem, start.family
    if number is None:
        raise ValueError("a ride that does not start on a circle has no family of circles")
    seen = observe(problem.bicycle, problem.surface, problem.q[None], problem.qd[None])
    energy = float(seen.kinetic_energy[0] + seen.potential_energy[0])
    return motion_of_energy(trace(problem.bicycle, Paraboloid(ALPHAS["figure-3"]), number), energy, circle)


def linearised_point(words: str, name: str) -> LinearisedPoint:
    """Return the reduced linear system at a scenario's circular motion."""
    start = start_named(name)
    problem, motion = start.problem, _require_motion(start)
    state = motion.state()
    return LinearisedPoint(words, independent(*state), linearise(problem.bicycle, problem.surface, *state))


def start_named(name: str, duration: float | None = None) -> Start:
    """Return the start of a scenario of the library, with another duration [s] if one is given."""
    changes = {} if duration is None else {"simulation.duration": duration}
    return make_start(load_scenario(name, changes)[1])


def _require_motion(start: Start) -> CircularMotion:
    if start.motion is None:
        raise ValueError("the paper's points are circular motions")
    return start.motion


def _marked_values(motion: CircularMotion) -> dict[str, float]:
    return {"lean": motion.lean, "steer": motion.steer, "front_rate": motion.front_rate}
