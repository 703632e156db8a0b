"""The examination of an engine: its rides and the checks of each ride."""

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
from .motions import (
    EXAMINED_INPUTS,
    GROUNDS,
    OTHER_BICYCLE,
    SAMPLES,
    TransientMotion,
    make_motion,
    make_problem,
    output_interval,
)
from .order import CLAIM, check_order
from .protocol import check_settings, guard_engine, step_noise_of
from .refusals import check_refusals, suits
from .repeats import check_bits, check_own_work
from .report import ConformanceCheck, ConformanceError, ConformanceReport, make_check, skip_check
from .reports import check_bodies, check_reports
from .rides import Ride
from .start import check_start
from .timing import check_clock, check_rates

_MAP_IS_WRONG = "a map of its coordinates is wrong: correct it first"
_VARIABLES = "the environment variables"
_FEWEST = 5  # samples that a ride needs for fits along it
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
        The report; no check failed.

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
    """Simulate short transients with an engine and check the results against the rules for all engines.

    Parameters
    ----------
    engine : Engine or str
        The engine object, installed or not, or the name of an installed engine.
    settings : mapping, optional
        Values of its settings that differ from the defaults.

    Returns
    -------
    ConformanceReport
        A report is returned whatever the engine does: if it raises, exits or prints, checks fail.

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
    before = _read_process_state()
    checks += _Examination(guarded, chosen).run_checks()
    checks.append(_check_process_state(before))
    values = chosen.model_dump(mode="json")
    return ConformanceReport(guarded.name, guarded.version, values, tuple(checks))


@dataclass(frozen=True)
class _Examination:
    """An engine with its settings, and the progress times that it reported in each ride."""

    engine: GuardedEngine
    settings: Settings
    reported: list[list[float]] = field(default_factory=list)

    def ride(self, motion: TransientMotion, settings: Settings | None = None) -> Ride:
        """Simulate a motion, with the examined settings unless others are given; raises as `ride_engine` does."""
        chosen = self.settings if settings is None else settings
        self.reported.append([])
        trajectory = ride_engine(self.engine, motion.problem, chosen, self.reported[-1].append)
        # The noise is that of the examined settings: at longer steps the method's error grows, not its noise.
        return Ride(motion, trajectory, step_noise_of(self.engine, self.settings))

    def refine(self, motion: TransientMotion, factor: float) -> Settings:
        """Return settings with the step multiplied by a factor.

        Raises
        ------
        ValueError
            If the settings have no step, or the engine refuses the new one.
        """
        settings = self.settings if factor == 1.0 else call_engine(self.settings.refined, factor)
        self.engine.check(motion.problem, settings)
        return settings

    def run_checks(self) -> Iterator[ConformanceCheck]:
        """Run all checks that need rides."""
        wrong, suitable = self.find_grounds()
        accepted = [name for name, good in suitable.items() if good]
        if not accepted:
            refused = f"it refuses all: {', '.join(suitable)}"
            yield make_check("grounds", "it rides on one ground at least", [*wrong, refused])
            return
        motion = make_motion(accepted[0], Bicycle(), self.interval)
        first, faults = self.try_ride(motion)
        yield make_check(f"ride on {motion.name}", _RIDE, faults)
        if first is None:
            return
        yield check_refusals(self.engine, self.settings, first, wrong, suitable)
        checks = tuple(_check_ride(self, first))
        yield from checks
        # An engine that has the benchmark bicycle or the plane hard-coded passes the checks so far.
        second_motion = make_motion(accepted[-1], OTHER_BICYCLE, self.interval)
        second, faults = self.try_ride(second_motion)
        yield make_check(f"ride on {second_motion.name}", _RIDE, faults)
        more = () if second is None else tuple(_check_ride(self, second))
        yield from more
        yield from self.check_repeats(first)
        yield self.check_order(first, _has_wrong_map(checks))
        # Every ground is compared with the reference, so that none can be ridden as another.
        for ground in accepted[1:-1]:
            between = make_motion(ground, Bicycle(), self.interval)
            ride, faults = self.try_ride(between)
            yield make_check(f"ride on {between.name}", _RIDE, faults)
            if ride is not None:
                yield self.check_order(ride, _has_wrong_map(checks))
        if second is not None:
            yield self.check_order(second, _has_wrong_map((*checks, *more)))
        for ground in suitable:
            if ground not in accepted:
                yield skip_check(f"order on {ground}", CLAIM, "it refuses this ground")
        yield from self.check_inputs(motion, _has_wrong_map(checks))
        if len(accepted) > 1:
            yield from self.check_inputs(second_motion, _has_wrong_map((*checks, *more)))

    @property
    def interval(self) -> float:
        """Output interval of the rides [s]."""
        step = getattr(self.settings, "step", None)
        return output_interval(step if isinstance(step, float) and 0 < step < np.inf else None)

    def find_grounds(self) -> tuple[list[str], dict[str, bool]]:
        """Return faults of the engine's refusals of grounds, and whether it accepts each ground."""
        wrong: list[str] = []
        suitable: dict[str, bool] = {}
        for name in GROUNDS:
            problem = make_problem(name, Bicycle(), self.interval, SAMPLES)
            suitable[name], more = suits(self.engine, problem, self.settings)
            wrong += more
        return wrong, suitable

    def try_ride(self, motion: TransientMotion) -> tuple[Ride | None, list[str]]:
        """Simulate a motion; return the ride, or None if it fails, and its faults."""
        try:
            ride = self.ride(motion)
        except Exception as error:  # another package's code may break in any way
            return None, [why_failed(error)]
        return ride, list(_list_ride_faults(ride, self.engine.gives, self.reported[-1]))

    def ride_coarser(self, motion: TransientMotion) -> Ride | None:
        """Simulate a motion with twice the step; return None if the engine cannot."""
        try:
            return self.ride(motion, self.refine(motion, 2.0))
        except Exception:  # no such step; `check_order` reports a failure
            return None

    def ride_every_step(self, motion: TransientMotion) -> Ride | None:
        """Simulate a motion with output at every step; return None if the engine cannot, or has no step."""
        step, problem = getattr(self.settings, "step", None), motion.problem
        if not (isinstance(step, float) and 0 < step < np.inf):
            return None
        samples = round(float(problem.times[-1]) / step)
        try:
            return self.ride(make_motion(motion.ground, problem.bicycle, step, samples))
        except Exception:  # the engine refuses these times, or breaks
            return None

    def check_repeats(self, first: Ride) -> Iterator[ConformanceCheck]:
        """Check that the first ride, repeated after another one, is the same and is the engine's own."""
        try:
            again = self.ride(first.motion)
        except Exception as error:  # another package's code may break in any way
            yield make_check("same bits", "a ride can be repeated", [why_failed(error)])
        else:
            yield check_bits(first, again.trajectory)
        yield check_own_work(first, self.engine.name)

    def check_inputs(self, like: TransientMotion, map_is_wrong: bool) -> Iterator[ConformanceCheck]:
        """Check a ride with torques and steer damping on a motion's ground, if the engine declares to apply them."""
        if not self.engine.takes_inputs:
            return
        motion = make_motion(like.ground, like.problem.bicycle, self.interval, inputs=EXAMINED_INPUTS)
        ride, faults = self.try_ride(motion)
        yield make_check(f"ride on {motion.name}", _RIDE, faults)
        if ride is not None:
            yield self.check_order(ride, map_is_wrong)

    def check_order(self, ride: Ride, map_is_wrong: bool) -> ConformanceCheck:
        """Check the order of convergence of a ride, and what it converges to, on rides with other steps."""
        motion = ride.motion
        name, claim = f"order on {motion.name}", "it is checked along a ride in the right coordinates"
        if map_is_wrong:
            return skip_check(name, claim, _MAP_IS_WRONG)
        if ride.trajectory.ended is not None:
            return skip_check(name, claim, "it does not ride to the end")
        return check_order(
            motion.name, lambda factor: self.refine(motion, factor), lambda settings: self.ride(motion, settings)
        )


def _has_wrong_map(checks: Iterable[ConformanceCheck]) -> bool:
    return any(check.outcome == "failed" and check.name.startswith("maps on ") for check in checks)


def _check_ride(examination: _Examination, ride: Ride) -> Iterator[ConformanceCheck]:
    """Check one ride; skip the checks for which it has too few samples."""
    maps = check_maps(ride)
    map_is_wrong = maps.outcome == "failed"
    yield check_start(ride, map_is_wrong)
    yield maps
    yield check_bodies(ride)
    if map_is_wrong:
        rest = f"reports, rates, clock and forces on {ride.motion.name}"
        yield skip_check(rest, "they are checked in the right coordinates", _MAP_IS_WRONG)
        return
    yield check_reports(ride)
    if len(ride.trajectory.time) < _FEWEST:
        rest = f"rates, clock and forces on {ride.motion.name}"
        yield skip_check(rest, "they are checked along a ride", f"it has fewer than {_FEWEST} samples")
        return
    yield check_rates(ride)
    yield check_clock(ride)
    yield check_forces(ride, examination.ride_coarser(ride.motion), lambda: examination.ride_every_step(ride.motion))


def _list_ride_faults(ride: Ride, gives: Iterable[str], reported: list[float]) -> Iterator[str]:
    """List the faults of a ride that show without comparing its numbers with anything."""
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
        yield "it reports that it took no steps"
    if reported != sorted(reported) or not all(0 <= time <= end * (1 + 1e-9) for time in reported):
        yield f"the times of its progress must rise from 0 to {end:g} s; it reported {reported[:3]}"


def _read_process_state() -> dict[str, Any]:
    """Return the state of the process that an engine must not change."""
    return {
        "numpy's handling of errors": np.geterr(),
        "numpy's random numbers": repr(np.random.get_state()),  # noqa: NPY002
        "Python's random numbers": random.getstate(),
        _VARIABLES: dict(os.environ),
    }


def _check_process_state(before: Mapping[str, Any]) -> ConformanceCheck:
    after = _read_process_state()
    changed = [f"it changed {what}" for what, value in before.items() if after[what] != value]
    names = _list_changed_variables(before[_VARIABLES], after[_VARIABLES])
    changed = [f"{line}: {', '.join(names)}" if line.endswith(_VARIABLES) else line for line in changed]
    if changed:
        changed.append("if a library does so when it is imported, keep the state from before and restore it afterwards")
    return make_check("surroundings", "it leaves the process as it found it", changed)


def _list_changed_variables(before: Mapping[str, str], after: Mapping[str, str]) -> list[str]:
    """Return the names of environment variables that were set, changed or removed; values may be secret."""
    return sorted(name for name in before.keys() | after.keys() if before.get(name) != after.get(name))
