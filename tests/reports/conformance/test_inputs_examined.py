"""The examination rides with inputs where an engine says that it takes them, and names what is wrong of them."""

from dataclasses import dataclass, replace

import pytest
from planting import Planted, same

from velodrome.engines.engine import Problem, UnsuitableProblem
from velodrome.engines.registry import load_engine
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.inputs import NO_INPUTS, Inputs
from velodrome.reference.surface import is_level
from velodrome.reports.conformance.motions import make_motion
from velodrome.testing import ConformanceReport, examine_engine


@dataclass(frozen=True)
class Taking(Planted):
    """An engine that says that it takes inputs."""

    takes_inputs = True


# The first ground that an engine accepts, and the last one.
FAILING = ["order on plane, with inputs", "order on waves, another bicycle, with inputs"]


def examine(engine: str, **factors: float) -> ConformanceReport:
    """Examine an engine whose inputs are multiplied by factors on the way in."""

    def before(problem: Problem) -> Problem:
        changed = {name: factor * getattr(problem.inputs, name) for name, factor in factors.items()}
        return replace(problem, inputs=replace(problem.inputs, **changed))

    return examine_engine(Taking(load_engine(engine), before, lambda trajectory, *_: trajectory))


def test_a_mirrored_steer_torque_is_named() -> None:
    report = examine("exudyn", steer_torque=-1)
    assert [check.name for check in report.failed] == FAILING
    assert "steer_torque looks mirrored: " in "\n".join(report.failed[0].found)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["exudyn", "mujoco-native"])
@pytest.mark.parametrize(
    ("factors", "named"),
    [
        ({"steer_torque": -1}, "steer_torque looks mirrored: "),
        ({"rear_wheel_torque": -1}, "rear_wheel_torque looks mirrored: "),
        ({"steer_damping": 0}, "steer_damping looks to be left out: "),
        ({"steer_torque": 0, "rear_wheel_torque": 0, "steer_damping": 0}, "it applies no inputs: "),
    ],
)
def test_a_wrong_input_is_named(engine: str, factors: dict, named: str) -> None:
    report = examine(engine, **factors)
    assert [check.name for check in report.failed] == FAILING
    assert named in "\n".join(report.failed[0].found)


def test_an_engine_that_applies_inputs_on_the_plane_alone_fails() -> None:
    def before(problem: Problem) -> Problem:
        return problem if is_level(problem.surface) else replace(problem, inputs=NO_INPUTS)

    report = examine_engine(Taking(load_engine("exudyn"), before, lambda trajectory, *_: trajectory))
    assert [check.name for check in report.failed] == FAILING[1:]
    assert "it applies no inputs: " in "\n".join(report.failed[0].found)


def test_an_engine_that_takes_them_rightly_passes_and_one_that_says_nothing_is_not_asked() -> None:
    names = {check.name: check.outcome for check in examine("exudyn").checks}
    assert names["ride on plane, with inputs"] == names["order on plane, with inputs"] == "passed"
    silent = examine_engine(Planted(load_engine("exudyn"), same, lambda trajectory, *_: trajectory))
    assert silent.passed
    assert not any("inputs" in check.name for check in silent.checks)


def test_an_engine_that_says_nothing_is_never_given_inputs() -> None:
    problem = make_motion("plane", Bicycle(), 0.01, inputs=Inputs(steer_torque=1.0)).problem
    engine = replace(load_engine("exudyn"), takes_inputs=False)
    with pytest.raises(UnsuitableProblem, match="it applies no inputs"):
        engine.check(problem, engine.settings())
    with pytest.raises(UnsuitableProblem, match="it applies no inputs"):
        engine.simulate(problem, engine.settings(), lambda _: None)


def test_takes_inputs_must_be_true_or_false() -> None:
    @dataclass(frozen=True)
    class Perhaps(Planted):
        takes_inputs = "perhaps"

    report = examine_engine(Perhaps(load_engine("exudyn"), same, lambda trajectory, *_: trajectory))
    assert "its takes_inputs is 'perhaps'; it must be True or False" in report.failed[0].found
