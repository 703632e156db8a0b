"""Changes of a base scenario: the result is that of validating all of it."""

from collections.abc import Callable

from hypothesis import given, settings
from hypothesis import strategies as st

from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.scenario import Scenario, ScenarioTemplate, load_scenario, set_keys, validate_scenario

BASE = load_scenario("q2-plus")[1].model_dump(mode="json", exclude_none=True)
values = st.one_of(st.floats(), st.integers(-3, 30), st.booleans(), st.text(max_size=2), st.none())
keys = st.sampled_from(
    [
        *(
            "perturbation.lean",
            "perturbation.leen",
            "motion.rear_rate",
            "motion.family",
            "motion.kind",
            "surface.alpha",
        ),
        *("surface.kind", "simulation.duration", "simulation.output_rate", "simulation", "inputs.steer_damping"),
        *(
            "inputs.steer_torque",
            "bicycle.trail",
            "bicycle.rear_frame_Ixx",
            "engines.reference.tolerance",
            "title",
            "x",
        ),
    ]
)


@settings(max_examples=300, deadline=None)
@given(st.lists(st.dictionaries(keys, values, max_size=3), min_size=1, max_size=4))
def test_changes_give_what_the_whole_validation_gives(points: list[dict]) -> None:
    template = ScenarioTemplate(BASE, "task", lambda data: data)
    for changes in points:
        expected = _result_of(lambda changes=changes: validate_scenario(set_keys(BASE, changes), "task"))
        assert _result_of(lambda changes=changes: template.apply(changes)) == expected


def _result_of(validate: Callable[[], Scenario]) -> tuple[str, str]:
    """Return the type and the text of a result, in which numbers of other types differ, or of an error."""
    try:
        result: Scenario | Exception = validate()
    except (ScenarioError, ValueError) as error:
        result = error
    return type(result).__name__, str(result) if isinstance(result, Exception) else repr(result)
