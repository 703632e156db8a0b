"""The examination of an engine: which rides are made of it, and which checks look at them."""

from __future__ import annotations

import os
import random
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pydantic import ValidationError

from ...engines.admission import ride_engine
from ...engines.engine import Engine, Settings, why_failed
from ...engines.guard import GuardedEngine, call_engine
from ...reference.bicycle import Bicycle
from .forces import check_forces
from .maps import check_maps
from .motions import GROUNDS, OTHER_BICYCLE, SAMPLES, TransientMotion, make_motion, make_problem, output_interval
from .order import check_order
from .protocol import check_settings, guard_engine, step_noise_of
from .refusals import check_refusals, suits
from .repeats import check_bits, check_own_work
from .report import ConformanceCheck, ConformanceError, ConformanceReport, make_check, skip_check
from .reports import check_bodies, check_reports
from .rides import Ride
from .start import check_start
from .timing import check_clock, check_rates

_MAPPED = "a map of its coordinates is wrong: put that right first"
_FEWEST = 5  # samples of a ride along which anything can be fitted
_RIDE = "it rides to the end, and what it gives is a trajectory of the problem"


def check_engine(engine: Engine | str, settings: Mapping[str, Any] | None = None) -> ConformanceReport:
    """Examine an engine as `examine_engine` does, and raise an error if a check fails.

    Parameters
    ----------
    engine : Engine or str
    settings : mapping, optional

    Returns
    -------
    ConformanceReport
        In which no check failed.

    Raises
    ------
    ConformanceError
        An `AssertionError` that lists all failed checks with their diagnoses.
    ValueError
        If the engine refuses the settings.
    """
    report = examine_engine(engine, settings)
    if not report.passed:
        raise ConformanceError(report)
    return report


def examine_engine(engine: Engine | str, settings: Mapping[str, Any] | None = None) -> ConformanceReport:
    """Examine an engine: let it ride short transients, and hold it against what every engine must keep to.

    Parameters
    ----------
    engine : Engine or str
        The object itself, installed or not, or the name of an installed one.
    settings : mapping, optional
        Values of its settings that differ from the defaults.

    Returns
    -------
    ConformanceReport
        Whatever the engine does: an engine that breaks, exits or prints fails checks.

    Raises
    ------
    ValueError
        If the engine refuses the settings.
    """
    guarded, protocol = guard_engine(engine)
    if guarded is None:
        name = engine if isinstance(engine, str) else str(getattr(engine, "name", type(engine).__name__))
        return ConformanceReport(name, "", {}, (protocol,))
    checks = [protocol, check_settings(guarded)]
    try:
        chosen = guarded.settings.model_validate(dict(settings or {}))
    except ValidationError as error:
        if settings:
            raise ValueError(f"{guarded.name} refuses the settings: {error.errors()[0]['msg']}") from error
        return ConformanceReport(str(guarded.name), str(guarded.version), {}, tuple(checks))
    before = _surroundings()
    checks += _Examination(guarded, chosen).checks()
    checks.append(_check_surroundings(before))
    shown = chosen.model_dump(mode="json")
    return ConformanceReport(guarded.name, guarded.version, shown, tuple(checks))


@dataclass(frozen=True)
class _Examination:
    """An engine with its settings, and the times at which it reported progress in its rides."""

    engine: GuardedEngine
    settings: Settings
    reported: list[list[float]] = field(default_factory=list)

    def ride(self, motion: TransientMotion, settings: Settings | None = None) -> Ride:
        """Ride a motion with the settings, or with others; errors as of `ride_engine`."""
        chosen = self.settings if settings is None else settings
        self.reported.append([])
        trajectory = ride_engine(self.engine, motion.problem, chosen, self.reported[-1].append)
        # Of the settings themselves: what a method leaves at longer steps is its error, not its noise.
        return Ride(motion, trajectory, step_noise_of(self.engine, self.settings))

    def refine(self, motion: TransientMotion, factor: float) -> Settings:
        """Settings with a factor on the step; ValueError where there are none or the engine refuses them."""
        settings = self.settings if factor == 1.0 else call_engine(self.settings.refined, factor)
        self.engine.check(motion.problem, settings)
        return settings

    def checks(self) -> Iterator[ConformanceCheck]:
        """All checks that take rides."""
        wrong, suitable = self.grounds()
        ridden = [name for name, good in suitable.items() if good]
        if not ridden:
            refused = f"it refuses all: {', '.join(suitable)}"
            yield make_check("grounds", "it rides on one ground at least", [*wrong, refused])
            return
        motion = make_motion(ridden[0], Bicycle(), self.interval)
        try:
            first = self.ride(motion)
        except Exception as error:  # another package's code may break in any way
            yield make_check(f"ride on {motion.name}", _RIDE, [why_failed(error)])
            return
        yield make_check(f"ride on {motion.name}", _RIDE, _wrong_facts(first, self.engine.gives, self.reported[-1]))
        yield check_refusals(self.engine, self.settings, first, wrong, suitable)
        judged = tuple(_judged(first))
        yield from judged
        # An engine that knows but the benchmark's bicycle, or but the plane, would pass on these.
        yield from self.checks_of_another(make_motion(ridden[-1], OTHER_BICYCLE, self.interval))
        yield from self.checks_of_repeats(first)
        yield self.check_order(first, mapped=any(check.outcome == "failed" for check in judged if _is_of_maps(check)))

    @property
    def interval(self) -> float:
        """Interval of the samples [s]."""
        step = getattr(self.settings, "step", None)
        return output_interval(step if isinstance(step, float) and 0 < step < np.inf else None)

    def grounds(self) -> tuple[list[str], dict[str, bool]]:
        """What is wrong with the refusals of grounds, and which ones the engine is made for."""
        wrong: list[str] = []
        suitable: dict[str, bool] = {}
        for name in GROUNDS:
            problem = make_problem(name, Bicycle(), self.interval, SAMPLES)
            suitable[name], more = suits(self.engine, problem, self.settings)
            wrong += more
        return wrong, suitable

    def checks_of_another(self, motion: TransientMotion) -> Iterator[ConformanceCheck]:
        """The checks of a ride of a second motion."""
        try:
            second = self.ride(motion)
        except Exception as error:  # another package's code may break in any way
            yield make_check(f"ride on {motion.name}", _RIDE, [why_failed(error)])
            return
        yield make_check(f"ride on {motion.name}", _RIDE, _wrong_facts(second, self.engine.gives, self.reported[-1]))
        yield from _judged(second)

    def checks_of_repeats(self, first: Ride) -> Iterator[ConformanceCheck]:
        """The checks of a ride that is repeated after another one."""
        try:
            again = self.ride(first.motion)
        except Exception as error:  # another package's code may break in any way
            yield make_check("same bits", "a ride can be repeated", [why_failed(error)])
        else:
            yield check_bits(first, again.trajectory)
        yield check_own_work(first, self.engine.name)

    def check_order(self, first: Ride, mapped: bool) -> ConformanceCheck:
        """The check of rides with other steps."""
        motion = first.motion
        name, claim = f"order on {motion.name}", "it is judged along a ride in the right coordinates"
        if mapped:
            return skip_check(name, claim, _MAPPED)
        if first.trajectory.ended is not None:
            return skip_check(name, claim, "it does not ride to the end")
        return check_order(
            motion.name, lambda factor: self.refine(motion, factor), lambda settings: self.ride(motion, settings)
        )


def _is_of_maps(check: ConformanceCheck) -> bool:
    return check.name.startswith("maps on ")


def _judged(ride: Ride) -> Iterator[ConformanceCheck]:
    """The checks of one ride, of a short one those that a few samples can tell."""
    maps = check_maps(ride)
    mapped = maps.outcome == "failed"
    yield check_start(ride, mapped)
    yield maps
    yield check_bodies(ride)
    if mapped:
        rest = f"reports, rates, clock and forces on {ride.motion.name}"
        yield skip_check(rest, "they are judged in the right coordinates", _MAPPED)
        return
    yield check_reports(ride)
    if len(ride.trajectory.time) < _FEWEST:
        rest = f"rates, clock and forces on {ride.motion.name}"
        yield skip_check(rest, "they are judged along a ride", f"it has fewer than {_FEWEST} samples")
        return
    yield check_rates(ride)
    yield check_clock(ride)
    yield check_forces(ride)


def _wrong_facts(ride: Ride, gives: Iterable[str], reported: list[float]) -> Iterator[str]:
    """What is wrong with a ride before any number of it is looked at, in words."""
    trajectory, end = ride.trajectory, float(ride.motion.problem.times[-1])
    missing = [name for name in gives if getattr(trajectory, name) is None]
    if missing:
        yield f"it lists {', '.join(missing)} in gives, and gives None"
    if trajectory.ended is not None:
        yield f"it ended after {trajectory.time[-1]:.6g} s: {trajectory.ended}"
    if trajectory.not_finite():
        yield f"not finite in some samples: {', '.join(trajectory.not_finite())}"
    if trajectory.unconverged_steps:
        yield f"its iterations did not converge in {trajectory.unconverged_steps} of {trajectory.steps} steps"
    if not trajectory.steps > 0:
        yield "it says that it took no steps"
    if reported != sorted(reported) or not all(0 <= time <= end * (1 + 1e-9) for time in reported):
        yield f"the times of its progress must rise from 0 to {end:g} s; it reported {reported[:3]}"


def _surroundings() -> dict[str, Any]:
    """What an engine may not change in the process that it runs in."""
    return {
        "numpy's handling of errors": np.geterr(),
        "numpy's random numbers": repr(np.random.get_state()),  # noqa: NPY002
        "Python's random numbers": random.getstate(),
        "the environment's variables": dict(os.environ),
    }


def _check_surroundings(before: Mapping[str, Any]) -> ConformanceCheck:
    after = _surroundings()
    changed = [f"it changed {what}" for what, value in before.items() if after[what] != value]
    return make_check("surroundings", "it leaves the process as it found it", changed)
