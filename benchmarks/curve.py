"""Speed of circular motions along a curve and of the atlas.

python benchmarks/curve.py              # microseconds a point, on one core
python benchmarks/curve.py --atlas      # and the whole atlas, half a minute
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
from rich.console import Console
from rich.table import Table

from velodrome.reference.anchors import ANCHORS, anchor
from velodrome.reference.atlas import ATLAS_SIZE, compute_atlas, spacing
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.circular import Steady
from velodrome.reference.continuation import follow_curve
from velodrome.reference.curve import sample_curve
from velodrome.reference.stability import linearise
from velodrome.reference.surface import Paraboloid, SurfaceOfRevolution

BICYCLE = Bicycle()
LONGEST = 0.02


def fastest(work: Callable[[], object], rounds: int) -> float:
    """Return the least CPU time of a piece of work [s], after one run that compiles."""
    work()
    taken = []
    for _ in range(rounds):
        begin = time.process_time()
        work()
        taken.append(time.process_time() - begin)
    return min(taken)


def curve_table(alpha: float, family: int, rounds: int) -> Table:
    """Time the points of one family from its anchor to one end."""
    surface: SurfaceOfRevolution = Paraboloid(alpha)
    start = anchor(BICYCLE, surface, family, ANCHORS[family][-1])
    equations = start.equations

    def followed() -> np.ndarray:
        return np.array(
            [point.unknowns for point in follow_curve(equations, start.unknowns, start.directions[0], LONGEST)]
        )

    points = followed()
    title = f"family {family}, alpha = {alpha:g}: {len(points)} points"
    table = Table(title, "us a point", box=None, pad_edge=False)
    steps, sampling = fastest(followed, rounds), fastest(lambda: sample_curve(equations, points), rounds)
    alone = fastest(lambda: single(equations, points[::10]), rounds) * 10
    table.add_row("predictor, Newton's method, tangent", f"{1e6 * steps / len(points):.1f}")
    table.add_row("7 x 7 Jacobian, eigenvalues, forces, energy", f"{1e6 * sampling / len(points):.1f}")
    table.add_row("together", f"{1e6 * (steps + sampling) / len(points):.1f}")
    table.add_row("(Jacobian and eigenvalues one by one, from Python)", f"{1e6 * alone / len(points):.1f}")
    return table


def single(equations: Steady, points: np.ndarray) -> None:
    """Linearise motions one at a time."""
    for unknowns in points:
        linearise(equations.bicycle, equations.surface, *equations.motion(unknowns).state())


def atlas_table(size: int) -> Table:
    """Time the atlas: curves, stable sections and critical points, without files."""
    alphas, longest = spacing(size)
    compute_atlas(BICYCLE, alphas[:2], longest)  # compiles
    begin = time.process_time()
    found = compute_atlas(BICYCLE, alphas, longest)
    seconds = time.process_time() - begin
    table = Table("atlas", "motions", "CPU s", "us a motion", box=None, pad_edge=False)
    table.add_row(f"{len(alphas)} shapes", str(found.size), f"{seconds:.1f}", f"{1e6 * seconds / found.size:.1f}")
    return table


def main() -> None:
    """Measure and print the tables."""
    parser = argparse.ArgumentParser(description="Speed of circular motions along a curve and of the atlas.")
    parser.add_argument("--rounds", type=int, default=7, help="repetitions of each measurement")
    parser.add_argument("--atlas", action="store_true", help="time the whole atlas too")
    parser.add_argument("--size", type=int, default=ATLAS_SIZE, help="number of motions of the atlas")
    options, console = parser.parse_args(), Console()
    for alpha, family in ((0.005, 2), (0.2, 3)):
        console.print(curve_table(alpha, family, options.rounds))
        console.print()
    if options.atlas:
        console.print(atlas_table(options.size))


if __name__ == "__main__":
    main()
