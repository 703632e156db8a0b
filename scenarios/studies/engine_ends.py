"""Where engines' own stable sections end, next to the Hopf points of the reference, over their step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from math import ceil, pi
from typing import Any

from ...engines.engine import REFERENCE, Engine, Settings, why_failed
from ...engines.guard import call_engine
from ...reference.bifurcations.hopf import HopfPoint
from ...reports.measure import (
    StabilityBoundary,
    locate_boundary,
    measure_at_start,
    measure_own_circle,
    predict_shift,
)
from ..error import ScenarioError
from ..run import RunWatch, Trace
from ..scenario import choose_engines, configure_engine, join_complaints

# Time in which an engine settles, and length of the window over which its flow is taken, of which a weave turns by less
# than this share in half a turn [s].
_SETTLING, _WINDOW, _SHARE = 1.0, 0.2, 0.9
# Settings other than the step: the method with a fixed step, and iterations whose remainder is below the shifts.
_SETTINGS: dict[str, dict[str, Any]] = {
    REFERENCE: {"integrator": "modified-euler"},
    "exudyn": {"newton_relative_tolerance": 1e-12},
    "exudyn-plane-normal": {"newton_relative_tolerance": 1e-12},
    "mujoco-native": {"tolerance": 1e-14},
}


@dataclass(frozen=True, kw_only=True)
class EngineEnd:
    """The end of an engine's stable section next to a Hopf point of the reference.

    Attributes
    ----------
    engine : str
    hopf : int
        Index of the Hopf point.
    step : float
        [s].
    rear_rate : float or None
        At which the engine's own weave neither grows nor dies out [rad/s].
    frequency : float or None
        Of the weave there [rad/s].
    shift : float or None
        Of the rear rate from the reference's [rad/s].
    error : float or None
        Estimate of the error of the search for it [rad/s].
    law : float or None
        The shift that follows from the method and the equations of motion; None where no law is known [rad/s].
    order : int or None
        Power of the step with which it begins.
    failed_because : str or None
        Why there is no end.
    """

    engine: str
    hopf: int
    step: float
    rear_rate: float | None = None
    frequency: float | None = None
    shift: float | None = None
    error: float | None = None
    law: float | None = None
    order: int | None = None
    failed_because: str | None = None

    def as_json(self) -> dict[str, Any]:
        """Return the fields as JSON values."""
        return asdict(self)


Riders = Mapping[str, Sequence[tuple[Engine, Settings]]]


def configure_steps(wanted: Sequence[str], steps: Sequence[float]) -> Riders:
    """Return engines with their settings at several steps.

    Parameters
    ----------
    wanted : sequence of str
        Engines beside the reference: names, patterns, or ``all``.
    steps : sequence of float
        [s].

    Raises
    ------
    ScenarioError
        If an entry chooses no engine, or an engine refuses a step.
    """
    choice, faults = choose_engines(wanted)
    if faults:
        raise ScenarioError(join_complaints(faults.values()))
    return {
        name: [configure_engine(name, _SETTINGS.get(name, {}) | {"step": step}) for step in steps]
        for name in choice.names
    }


def measure_engine_ends(
    points: Sequence[HopfPoint], riders: Riders, watch: RunWatch, trace: Trace | None = None
) -> list[EngineEnd]:
    """Measure where engines' own stable sections end.

    Parameters
    ----------
    points : sequence of HopfPoint
        Those that end no stable section are left out.
    riders : mapping
        As `configure_steps` returns it.
    watch : callable
        Called with an engine's name, the number of its ends that are done, their number, and what is counted.
    trace : callable, optional
        Called with the name of an engine that failed and its exception.

    Returns
    -------
    list of EngineEnd
        Engine by engine, point by point, in the order of the steps.
    """
    places = [place for place, point in enumerate(points) if point.ends_section]
    ends = []
    for name, steps in riders.items():
        rides = [(place, engine, settings) for place in places for engine, settings in steps]
        for done, (place, engine, settings) in enumerate(rides):
            watch(name, done, len(rides), "ends")
            ends.append(_measure_end(engine, settings, points[place], place, trace))
        watch(name, len(rides), len(rides), "ends")
    return ends


def _measure_end(engine: Engine, settings: Any, point: HopfPoint, place: int, trace: Trace | None) -> EngineEnd:
    end = EngineEnd(engine=engine.name, hopf=place, step=settings.step)
    if point.form is None:
        return replace(end, failed_because=f"the reference has no end to compare with: {point.why_undefined}")
    try:
        found = call_engine(_locate, engine, settings, point, end.step)
        law = predict_shift(point, settings)
    except (ArithmeticError, ValueError) as error:  # the circle or a disturbed state may not exist
        return replace(end, failed_because=" ".join(str(error).split()))
    except Exception as error:
        if trace is not None:
            trace(engine.name, error)
        return replace(end, failed_because=why_failed(error))
    return replace(
        end,
        rear_rate=found.rear_rate,
        frequency=found.frequency,
        shift=found.rear_rate - point.motion.rear_rate,
        error=found.error,
        law=None if law is None else law.rear_rate,
        order=None if law is None else law.order,
    )


def _locate(engine: Engine, settings: Settings, point: HopfPoint, step: float) -> StabilityBoundary:
    weave = 1j * point.frequency
    if engine.name == REFERENCE:  # its constraints drift from the start on
        return locate_boundary(point, lambda start: measure_at_start(engine, settings, start, weave, step))
    window = max(1, int(min(_WINDOW, _SHARE * pi / point.frequency) / step + 1e-9)) * step
    begin = ceil(_SETTLING / window - 1e-9) * window
    return locate_boundary(point, lambda start: measure_own_circle(engine, settings, start, weave, (begin, window)))
