"""Whether an engine's ``check`` refuses the problems that it cannot simulate, and no others."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from ...engines.admission import ride_engine
from ...engines.engine import Problem, UnsuitableProblem, why_failed
from ...engines.guard import GuardedEngine
from .motions import SAMPLES, TransientMotion, awkward_interval, make_motion
from .report import ConformanceCheck, make_check
from .rides import Ride

_ROOM = 4.0  # factor between two errors of one computation
_LONGEST = 400  # characters that fit on a line of a table


def suits(engine: GuardedEngine, problem: Problem, settings: Any) -> tuple[bool, list[str]]:
    """Return whether an engine accepts a problem, and the faults of its answer."""
    try:
        engine.check(problem, settings)
    except UnsuitableProblem as error:
        return False, list(_list_message_faults(error, "the refusal of a ground"))
    except Exception as error:  # another package's code may break in any way
        return False, [
            f"its check raises {why_failed(error)} for a rideable {type(problem.surface).__name__}; a ground that it "
            "does not know is an UnsuitableProblem"
        ]
    return True, []


def check_refusals(
    engine: GuardedEngine, settings: Any, ride: Ride, wrong: list[str], suitable: dict[str, bool]
) -> ConformanceCheck:
    """Check the refusals of grounds, given in ``wrong`` and ``suitable``, and of output times between steps."""
    observations = [f"it rides on the {name}" if good else f"it refuses the {name}" for name, good in suitable.items()]
    faults = list(wrong)
    own = ride.motion.problem
    interval = awkward_interval(float(own.times[1]))
    awkward = make_motion(ride.motion.ground, own.bicycle, interval, SAMPLES // 2)
    try:
        engine.check(awkward.problem, settings)
    except UnsuitableProblem:
        faults.append(
            "output times beside its steps are no UnsuitableProblem, which stands for grounds; raise ValueError"
        )
    except ValueError as error:
        faults += _list_message_faults(error, "the refusal of output times")
        observations.append(f"it refuses an output interval of {interval:.6g} s")
    except Exception as error:  # another package's code may break in any way
        faults.append(f"its check raises {why_failed(error)} for output times beside its steps; raise ValueError")
    else:
        faults += _list_ride_faults(engine, settings, ride, awkward)
        observations.append(f"it rides with an output interval of {interval:.6g} s")
    return make_check(
        "refusals",
        "check refuses what the engine cannot run, a ground by UnsuitableProblem and times by ValueError, in one "
        "line; the engine runs everything else",
        faults,
        observations,
        "samples between steps may be off by the noise and four times the error of samples at steps",
    )


def _list_message_faults(error: Exception, what: str) -> Iterator[str]:
    words = str(error)
    if not (words.strip() and words.isprintable() and len(words) <= _LONGEST):
        yield f"{what} says {words[:80]!r}; it must say in one line what is wrong and what would be right"


def _list_ride_faults(engine: GuardedEngine, settings: Any, ride: Ride, awkward: TransientMotion) -> Iterator[str]:
    """List the faults of a ride whose output times lie between steps."""
    accepted = f"check accepts an output interval of {awkward.problem.times[1]:.6g} s, and"
    try:
        trajectory = ride_engine(engine, awkward.problem, settings, lambda _: None)
    except Exception as error:  # another package's code may break in any way
        yield f"{accepted} the ride fails: {why_failed(error)}"
        return
    found = Ride(awkward, trajectory, ride.step_noise)
    allowed = ride.noise + _ROOM * ride.error
    if not found.error <= allowed:
        yield (f"{accepted} samples between its steps are off by {found.error:.2g}, limit {allowed:.2g}")
