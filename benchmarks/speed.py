"""Speed of the reference: `python benchmarks/speed.py`.

One run measures everything, in alternating rounds, as CPU time of this process. On a busy machine only the ratios
(median of the ratios within a round) are meaningful. Integrations are compared at equal accuracy:
each method takes the largest tolerance, on a grid of four a decade, whose error at the end stays below
the target. The error is the distance of the rear contact from that of the reference at tolerance 1e-14.

    reference         the reference as users call it, `velodrome.reference.simulate.simulate`
    same in scipy     the same right-hand side, compiled, in scipy's DOP853: the same method in Python
    C                 the formulas of the right-hand side in C, compiled here with -O3 -march=native (and -ffast-math)
    symbrim in scipy  the equations that symbrim derives, compiled to C, in scipy's DOP853

The first table compares the equations alone; the rest of the difference comes from the integrators.
"""

from __future__ import annotations

import argparse
import importlib.util
import math
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import c_right_hand_side
import numba as nb
import numpy as np
import symbrim_equations
from rich.console import Console
from rich.table import Column, Table
from scipy.integrate import solve_ivp

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state, contact_parameters
from velodrome.reference.families import find_motion
from velodrome.reference.kernels.compilation import jit
from velodrome.reference.kernels.lean import derivative
from velodrome.reference.kernels.pose import aligned
from velodrome.reference.kinematics import constants
from velodrome.reference.simulate import simulate
from velodrome.reference.surface import Paraboloid, Plane, Surface

BICYCLE = Bicycle()
SPEED, LEAN_RATE, DURATION = 4.6, 0.5, 20.0  # iftomm-2
TARGETS = (1e-6, 1e-8, 1e-10)
TOLERANCES = 10.0 ** (-np.arange(16, 53) / 4)
REFERENCE = "reference"

State = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Outcome:
    """Position of the rear contact at the end, and number of evaluations."""

    contact: np.ndarray
    evaluations: int


Method = Callable[[float], Outcome]


@jit
def _repeat(y, function, parameters, bicycle, count, out):
    for _ in range(count):
        derivative(y, function, parameters, bicycle, out)


def riding(surface: Surface, state: State) -> np.ndarray:
    """Return the integration state (24,) of a start."""
    return np.concatenate([*state, contact_parameters(BICYCLE, surface, state[0])])


def upright() -> State:
    """Return the start of iftomm-2."""
    rates = (LEAN_RATE, 0.0, SPEED / BICYCLE.rear_wheel_radius)
    return consistent_state(BICYCLE, Plane(), (0.0, 0.0), 0.0, 0.0, rates)


def in_circles() -> tuple[Paraboloid, State]:
    """Return the surface and the start of q2-plus."""
    bowl = Paraboloid(0.005)
    _, motion = find_motion(BICYCLE, bowl, 18.0, 2)
    q, _ = motion.state()
    guess = (q[2], q[5])
    return bowl, consistent_state(BICYCLE, bowl, (q[0], q[1]), q[4], q[6], (0.1, 0.0, 18.0), guess=guess)


def reference_method(state: State) -> Method:
    """Make a method of the reference's integrator."""

    def run(tolerance: float) -> Outcome:
        motion = simulate(BICYCLE, Plane(), *state, np.array([DURATION]), tolerance=tolerance)
        return Outcome(motion.contact[-1, 0, :2], motion.evaluations)

    return run


def scipy_method(y: np.ndarray) -> Method:
    """Make a method of the reference's right-hand side in scipy's integrator."""
    function, bicycle = Plane().function.real, aligned(constants(BICYCLE))
    options = {"method": "DOP853", "args": (Plane().parameters,)}

    # The constants are compiled in: passing them at each call would take ten times as long as the evaluation.
    @nb.njit
    def rate(_, y, parameters):
        out = np.empty(24)
        derivative(y, function, parameters, bicycle, out)
        return out

    def run(tolerance: float) -> Outcome:
        found = solve_ivp(rate, (0.0, DURATION), y, rtol=tolerance, atol=tolerance, **options)
        return Outcome(found.y[18:20, -1], found.nfev)

    return run


def symbrim_method(equations: symbrim_equations.Equations, x: np.ndarray) -> Method:
    """Make a method of symbrim's equations in scipy's integrator."""
    rate = equations.function()

    def run(tolerance: float) -> Outcome:
        found = solve_ivp(rate, (0.0, DURATION), x, method="DOP853", rtol=tolerance, atol=tolerance)
        return Outcome(found.y[:2, -1] * [1, -1], found.nfev)

    return run


def c_work(y: np.ndarray, count: int) -> dict[str, Callable[[], object]]:
    """Return the right-hand side in C, without and with fast arithmetic; nothing where there is no compiler."""
    compiler = symbrim_equations.compiler()
    if compiler is None:
        return {}
    bicycle, out = aligned(constants(BICYCLE)), np.empty(24)
    derivative(y, Plane().function.real, Plane().parameters, bicycle, out)
    work: dict[str, Callable[[], object]] = {}
    with tempfile.TemporaryDirectory() as folder:  # the libraries stay loaded
        for name, flags in (("C", c_right_hand_side.FLAGS), ("C, fast arithmetic", c_right_hand_side.FAST_FLAGS)):
            same = c_right_hand_side.RightHandSide(bicycle, Path(folder), compiler, flags)
            # A few hundred roundings of terms of order 100 or less, the accelerations' own size.
            np.testing.assert_allclose(same.repeat(y, 1), out, rtol=1e-12, atol=1e-12)
            work[name] = partial(same.repeat, y, count)
    return work


def symbrim_obstacle() -> str | None:
    """Return why symbrim's equations cannot be compiled here, None if they can."""
    if importlib.util.find_spec("symbrim") is None:
        return "symbrim is not installed: pip install -e '.[benchmark]'"
    if symbrim_equations.compiler() is None:
        return "there is no C compiler (cc, gcc or clang) on the path"
    return None


def interleaved(work: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, np.ndarray]:
    """Return CPU seconds (rounds,) of each piece of work; each round runs all of them, each for at least 20 ms."""

    def timed(run: Callable[[], object], count: int) -> float:
        begin = time.process_time()
        for _ in range(count):
            run()
        return (time.process_time() - begin) / count

    for run in work.values():
        run()  # compiles
    counts = {name: math.ceil(0.02 / max(timed(run, 1), 1e-6)) for name, run in work.items()}
    measured = [{name: timed(run, counts[name]) for name, run in work.items()} for _ in range(rounds)]
    return {name: np.array([seconds[name] for seconds in measured]) for name in work}


def spread(seconds: np.ndarray, unit: float) -> list[str]:
    """Format minimum, median and maximum in a unit of time."""
    return [f"{value / unit:.3g}" for value in (seconds.min(), np.median(seconds), seconds.max())]


def coarsest(method: Method, target: float, exact: np.ndarray) -> tuple[float, Outcome, float] | None:
    """Return the largest tolerance that meets the target, its outcome and error; None if none does."""
    for tolerance in TOLERANCES:
        outcome = method(tolerance)
        error = float(np.linalg.norm(outcome.contact - exact))
        if error <= target:
            return tolerance, outcome, error
    return None


def evaluation_table(y: np.ndarray, extra: Mapping[str, Callable[[], object]], count: int, rounds: int) -> Table:
    """Time one evaluation of the right-hand side in compiled code."""
    where = (Plane().function.real, Plane().parameters, aligned(constants(BICYCLE)), count, np.empty(24))
    work = {REFERENCE: lambda: _repeat(y, *where), **extra}
    table = Table("right-hand side", "min ns", "median ns", "max ns", "ratio", box=None, pad_edge=False)
    seconds = interleaved(work, rounds)
    for name, values in seconds.items():
        ratio = np.median(values / seconds[REFERENCE])
        table.add_row(name, *spread(values / count, 1e-9), f"{ratio:.2f}")
    return table


def integration_table(methods: dict[str, Method], exact: np.ndarray, rounds: int) -> Table:
    """Time the methods at equal accuracy."""
    columns = ("error", "tolerance", "calls", "min ms", "median", "max", "ratio")
    table = Table(Column("iftomm-2, 20 s", no_wrap=True), *columns, box=None, pad_edge=False)
    for target in TARGETS:
        chosen = {name: coarsest(method, target, exact) for name, method in methods.items()}
        work = {name: partial(methods[name], found[0]) for name, found in chosen.items() if found is not None}
        seconds = interleaved(work, rounds)
        for name, found in chosen.items():
            if found is None:
                table.add_row(name, f"above {target:.0e} m at any tolerance")
                continue
            tolerance, outcome, error = found
            ratio = np.median(seconds[name] / seconds[REFERENCE])
            cells = (f"{error:.1e} m", f"{tolerance:.1e}", str(outcome.evaluations))
            table.add_row(name, *cells, *spread(seconds[name], 1e-3), f"{ratio:.1f}")
        table.add_section()
    return table


def outputs_table(rounds: int) -> Table:
    """Time q2-plus with and without its outputs."""
    surface, state = in_circles()
    table = Table("q2-plus, 20 s, reference", "tolerance", "min ms", "median ms", "max ms", box=None, pad_edge=False)
    for tolerance in (1e-9, 1e-13):
        grids = {"the end only": np.array([DURATION]), "2001 outputs with forces": np.linspace(0.0, DURATION, 2001)}
        work = {name: partial(simulate, BICYCLE, surface, *state, times, tolerance) for name, times in grids.items()}
        for name, values in interleaved(work, rounds).items():
            table.add_row(name, f"{tolerance:.0e}", *spread(values, 1e-3))
    return table


def main() -> None:
    """Measure and print the tables."""
    parser = argparse.ArgumentParser(description="Speed of the reference, compared with scipy and symbrim.")
    parser.add_argument("--rounds", type=int, default=15, help="repetitions of each measurement")
    rounds, console = parser.parse_args().rounds, Console()
    state = upright()
    y, count = riding(Plane(), state), 10_000
    methods = {REFERENCE: reference_method(state), "same in scipy": scipy_method(y)}
    alone = c_work(y, count)
    obstacle = symbrim_obstacle()
    if obstacle is None:
        with console.status("deriving symbrim's equations"), tempfile.TemporaryDirectory() as folder:
            equations = symbrim_equations.Equations(BICYCLE, Path(folder), symbrim_equations.compiler() or "cc")
        x = symbrim_equations.start(BICYCLE, SPEED, LEAN_RATE, y[18:20])
        methods["symbrim in scipy"] = symbrim_method(equations, x)
        alone["symbrim C"] = lambda: equations.repeat(x, count)
    exact = methods[REFERENCE](1e-14).contact
    for table in (
        evaluation_table(y, alone, count, rounds),
        integration_table(methods, exact, rounds),
        outputs_table(rounds),
    ):
        console.print(table)
        console.print()
    if obstacle is not None:
        console.print(f"symbrim's equations are left out: {obstacle}", soft_wrap=True, markup=False)


if __name__ == "__main__":
    main()
