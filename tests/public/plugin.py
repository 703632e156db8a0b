"""An engine as another package would write it, and a script that uses the suite; type checkers must pass it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import assert_type

from pydantic import Field

import velodrome
from velodrome import Engine, Problem, Settings, Trajectory, UnsuitableProblem
from velodrome.engines.coordinates import body_positions, body_quaternions
from velodrome.engines.problems import is_level, steps_per_output
from velodrome.reference.simulate import simulate_modified_euler


class OwnSettings(Settings):
    """Settings of the engine."""

    step: float = Field(default=1e-3, ge=1e-5, le=0.01, description="step [s]", json_schema_extra={"unit": "s"})


class OwnEngine:
    """The smallest engine that can be compared."""

    name = "own"
    version = "0.1"
    gives: tuple[str, ...] = ()
    settings: type[Settings] = OwnSettings

    def check(self, problem: Problem, settings: OwnSettings) -> None:
        """Refuse what it cannot run."""
        if not is_level(problem.surface):
            raise UnsuitableProblem("it rides on the level plane only")
        steps_per_output(problem.times, settings.step)

    def step_noise(self, settings: OwnSettings) -> float:
        """Round-off."""
        return 2.0**-52

    def simulate(self, problem: Problem, settings: OwnSettings, progress: Callable[[float], None]) -> Trajectory:
        """Run a problem."""
        begin = time.process_time()
        ride = simulate_modified_euler(
            problem.bicycle, problem.surface, problem.q, problem.qd, problem.times, settings.step
        )
        progress(float(ride.time[-1]))
        return Trajectory(
            engine=self.name,
            version=self.version,
            settings=settings.model_dump(),
            time=ride.time,
            q=ride.q,
            qd=ride.qd,
            body_position=body_positions(problem.bicycle, ride.q),
            body_quaternion=body_quaternions(problem.bicycle, ride.q),
            steps=ride.steps,
            cpu_time=time.process_time() - begin,
            ended=ride.ended,
        )


ENGINE: Engine = OwnEngine()


def largest_error(scenario: str, engine: str) -> float:
    """Return the largest position error of an engine in a scenario [m]."""
    run = velodrome.run(scenario, engines=[engine], duration=0.1)
    assert_type(run, velodrome.Run)
    assert_type(run.trajectories[engine], Trajectory)
    assert_type(run.start, Problem)
    motion = velodrome.circular(alpha=0.005, rear_rate=18.0, family=2)
    assert_type(motion, velodrome.CircularSolution)
    assert_type(velodrome.__version__, str)
    assert_type(velodrome.scenario_names(), list[str])
    reduced = velodrome.linearise(run.start.bicycle, velodrome.Paraboloid(0.005), *motion.motion.state())
    assert_type(reduced, velodrome.Linearisation)
    return float(run.metrics[engine]["position_error"]["max"])
