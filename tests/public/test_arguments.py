"""Wrong arguments from Python: one line names the argument, what it is and what would be right."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import velodrome


class Unwritable:
    """An object whose repr breaks."""

    def __repr__(self) -> str:
        raise RuntimeError("no repr")


def run(**given: Any) -> Any:
    return velodrome.run(**{"scenario": "q2", "engines": [], "duration": 0.02, **given})


def circular(**given: Any) -> Any:
    return velodrome.circular(**{"alpha": 0.005, "rear_rate": 18.0, "family": 2, **given})


def near(angles: Any) -> Any:
    return circular(family=None, near=angles)


def ground(surface: Any) -> Any:
    return circular(alpha=None, surface=surface)


REFERENCE = velodrome.load_engine("reference")
BY_NAME = "engines are given by name"
TABLE = "such as {'exudyn': {'step': 0.001}}"
KEYS = "dotted keys"
ANGLES = "two angles, lean and steer [rad]"


@pytest.mark.parametrize(
    ("call", "argument", "right"),
    [
        (lambda: run(scenario=None), "scenario is None", "a str or a Path"),
        (lambda: run(scenario=3), "scenario is 3", "a str or a Path"),
        (lambda: run(engines=[REFERENCE]), "engines[0] is GuardedEngine", "engines=['reference']"),
        (lambda: run(engines=REFERENCE), "engines is GuardedEngine", "engines=['reference']"),
        (lambda: run(engines=[None]), "engines[0] is None", BY_NAME),
        (lambda: run(engines=["exudyn", Unwritable()]), "engines[1] is an object without a repr (Unwritable)", BY_NAME),
        (lambda: run(engines=3), "engines is 3 (int)", BY_NAME),
        (lambda: run(engines=b"exudyn"), "engines is b'exudyn'", BY_NAME),
        (lambda: run(engines={"exudyn": {}}), "engines is {'exudyn': {}}", BY_NAME),
        (lambda: run(settings=[1]), "settings is [1] (list)", TABLE),
        (lambda: run(settings=REFERENCE.settings()), "settings is LagrangeSettings(", TABLE),
        (lambda: run(settings={3: {}}), "a key of settings is 3", TABLE),
        (lambda: run(settings={"exudyn": {3: 1}}), "a key of settings['exudyn'] is 3", "{'step': 0.001}"),
        (lambda: run(settings={"exudyn": None}), "settings['exudyn'] is None", "{'step': 0.001}"),
        (lambda: run(changes=["a=1"]), "changes is ['a=1'] (list)", KEYS),
        (lambda: run(changes="a=1"), "changes is 'a=1'", KEYS),
        (lambda: run(changes={3: 1}), "a key of changes is 3", KEYS),
        (lambda: run(out=3), "out is 3 (int)", "a str or a Path"),
        (lambda: run(out=b"runs"), "out is b'runs'", "a str or a Path"),
        (lambda: run(out="a\0b"), "out is 'a\\x00b'", "no null character"),
        (lambda: run(progress=True), "progress is True", "a function"),
        (lambda: velodrome.load(3), "folder is 3", "a str or a Path"),  # type: ignore[arg-type]
        (lambda: velodrome.load(Path("a\0b")), "folder is 'a\\x00b'", "no null character"),
        (lambda: circular(alpha="a"), "alpha is 'a' (str)", "a number [1/m]"),
        (lambda: circular(alpha=True), "alpha is True", "a number [1/m]"),
        (lambda: velodrome.families(alpha="x"), "alpha is 'x'", "a number [1/m]"),  # type: ignore[arg-type]
        (lambda: circular(rear_rate="18"), "rear_rate is '18'", "a number [rad/s]"),
        (lambda: circular(rear_rate=None), "rear_rate is None", "a number [rad/s]"),
        (lambda: circular(rear_rate=[18.0]), "rear_rate is [18.0]", "a number [rad/s]"),
        (lambda: circular(family=True), "family is True", "1, 2, 3 and 4"),
        (lambda: circular(family="2"), "family is '2'", "1, 2, 3 and 4"),
        (lambda: circular(family=2.5), "family is 2.5", "1, 2, 3 and 4"),
        (lambda: near((0.74, 2.84, 1.0)), "near is (0.74, 2.84, 1.0)", ANGLES),
        (lambda: near((0.74,)), "near is (0.74,)", ANGLES),
        (lambda: near("ab"), "near is 'ab'", ANGLES),
        (lambda: near(("a", "b")), "near is ('a', 'b')", ANGLES),
        (lambda: near(3), "near is 3", ANGLES),
        (lambda: near(np.zeros((2, 2))), "near is array(", ANGLES),
        (lambda: ground("sphere"), "surface sphere: ", "radius"),
        (lambda: ground("sfere:radius=20"), "surface sfere:radius=20: ", "did you mean 'sphere'?"),
        (lambda: ground(velodrome.Sphere), "surface is <class", "Sphere(...)"),
        (lambda: ground(0.005), "surface is 0.005", "Sphere(20.0)"),
        (lambda: circular(bicycle="x"), "bicycle is 'x'", "a Bicycle"),
        (lambda: circular(bicycle={}), "bicycle is {}", "a Bicycle"),
        (lambda: velodrome.families(alpha=0.005, bicycle=0), "bicycle is 0", "a Bicycle"),  # type: ignore[arg-type]
        (lambda: velodrome.critical(bicycle=3), "bicycle is 3", "a Bicycle"),  # type: ignore[arg-type]
        (lambda: velodrome.critical(progress=3), "progress is 3", "a function"),  # type: ignore[arg-type]
    ],
)
def test_a_wrong_argument_is_named_in_one_line(
    call: Callable[[], Any], argument: str, right: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(velodrome.ScenarioError) as told:
        call()
    line = str(told.value)
    assert line.startswith(argument), line
    assert right in line
    assert line.isprintable()
    assert not list(tmp_path.iterdir())


def test_arguments_of_other_types_that_mean_the_same_are_taken() -> None:
    plain = circular()
    numpy = circular(alpha=np.array(0.005), rear_rate=np.float64(18), family=np.int64(2))
    assert numpy.as_json() == plain.as_json()
    assert near(np.array([0.74, 2.84])).as_json() == near([0.74, 2.84]).as_json() == near((0.74, 2.84)).as_json()
    text = ground("sphere:radius=100")
    assert text.as_json() == ground(velodrome.Sphere(100.0)).as_json()
    assert list(run(engines=iter(["mujoco-native"])).trajectories) == ["reference", "mujoco-native"]
