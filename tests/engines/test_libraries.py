"""Engines whose library is an extra of their package: announced always, installed or with the command that does it."""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import Distribution, EntryPoint
from pathlib import Path

import pytest

from velodrome.engines import registry
from velodrome.engines.registry import (
    default_engines,
    engine_names,
    list_library_packages,
    load_engine,
    preview_engine,
    uninstalled_engines,
)
from velodrome.engines.releases import LibraryReach
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.run import plan_run
from velodrome.scenarios.scenario import choose_engines, configure_engine, list_engine_faults, load_scenario
from velodrome.scenarios.show import make_document, make_schema
from velodrome.scenarios.sweep.file import SweepFile

EXTRAS = {
    "present": "numpy>=1.0",  # the suite's own dependency
    "absent": "no-such-library>=2.0",
    "older": "numpy>=1000",  # there, in a version that will not do
}


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package with an engine for each extra, and one that needs none, all of them the reference's code."""
    folder = tmp_path / "flywheel-1.0.dist-info"
    folder.mkdir()
    lines = ["Metadata-Version: 2.1", "Name: flywheel", "Version: 1.0", "Requires-Dist: scipy"]
    lines += [f'Requires-Dist: {requirement} ; extra == "{extra}"' for extra, requirement in EXTRAS.items()]
    (folder / "METADATA").write_text("\n".join(lines) + "\n")
    (folder / "entry_points.txt").write_text(
        f"[{registry.ENTRY_POINT_GROUP}]\nflywheel = flywheel:ENGINE\n"
        + "".join(f"flywheel-{extra} = flywheel:{extra.upper()} [{extra}]\n" for extra in EXTRAS)
    )
    (tmp_path / "flywheel.py").write_text(
        "from velodrome.engines.lagrange import LagrangeEngine\n\n\n"
        "class Named(LagrangeEngine):\n"
        "    def __init__(self, name):\n"
        "        object.__setattr__(self, 'name', name)\n\n\n"
        "ENGINE = Named('flywheel')\n" + "".join(f"{extra.upper()} = Named('flywheel-{extra}')\n" for extra in EXTRAS)
    )
    monkeypatch.syspath_prepend(tmp_path)
    announced = registry.list_entry_points(registry.ENTRY_POINT_GROUP)
    own: list[EntryPoint] = list(Distribution.at(folder).entry_points)
    monkeypatch.setattr(registry, "list_entry_points", lambda group: [*announced, *own])


def test_engines_without_their_library_are_listed_with_the_command(package: None) -> None:
    there = engine_names()
    assert {"flywheel", "flywheel-present"} <= {*there}
    assert not {"flywheel-absent", "flywheel-older"} & {*there}
    found = uninstalled_engines()
    assert found["flywheel-absent"] == "pip install 'flywheel[absent]'"
    assert found["flywheel-older"] == "pip install 'flywheel[older]'"
    assert not {*found} & {*there}


def test_an_engine_without_its_library_is_refused_with_the_command(package: None) -> None:
    with pytest.raises(
        ValueError, match=r"needs no-such-library>=2\.0, not installed; .*pip install 'flywheel\[absent\]'"
    ):
        load_engine("flywheel-absent")
    with pytest.raises(
        ScenarioError, match=r"'flywheel-older' is not installed; install: pip install 'flywheel\[older\]'"
    ):
        plan_run(*load_scenario("q2"), ["flywheel-older"])
    assert load_engine("flywheel-present").name == "flywheel-present"


def test_an_engine_that_knows_its_releases_is_loaded_with_those_that_its_extra_excludes_if_asked_to(
    package: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(ScenarioError, match=r"needs numpy>=1000, not installed"):
        configure_engine("flywheel-older", {}, any_release=True)
    reach = LibraryReach("numpy", "numpy", oldest="1.0.0", needs="arrays")
    monkeypatch.setattr(import_module("flywheel").Named, "reach", reach, raising=False)
    assert load_engine("flywheel-older", any_release=True).name == "flywheel-older"
    assert configure_engine("flywheel-older", {}, any_release=True)[0].name == "flywheel-older"
    with pytest.raises(ScenarioError, match=r"needs numpy>=1000, not installed"):
        configure_engine("flywheel-older", {})
    with pytest.raises(ValueError, match=r"needs no-such-library>=2\.0, not installed"):
        load_engine("flywheel-absent", any_release=True)


def test_the_settings_of_an_engine_are_read_without_its_library(package: None) -> None:
    engine = preview_engine("flywheel-absent")
    assert (engine.name, engine.version) == ("flywheel-absent", "")
    assert engine.settings is load_engine("reference").settings
    assert preview_engine("flywheel-present").version == load_engine("flywheel-present").version
    document = make_document("flywheel-absent", SweepFile)
    assert (document["version"], document["install"]) == (None, "pip install 'flywheel[absent]'")
    assert document["settings"] == make_document("reference", SweepFile)["settings"]
    assert make_document("reference", SweepFile)["install"] is None
    assert "flywheel-absent" in make_schema("scenario", "", SweepFile)["properties"]["engines"]["properties"]
    with pytest.raises(ValueError, match="'flywheel-unknown' is not installed"):
        preview_engine("flywheel-unknown")


def test_engines_of_extras_and_of_other_packages_ride_only_when_chosen(package: None) -> None:
    default = default_engines()
    assert default[0] == "reference"
    assert not any(name.startswith("flywheel") for name in default)
    assert not any(name.startswith("flywheel") for name in plan_run(*load_scenario("q2")).engines)
    for wanted in (["flywheel*"], ["all"], ["flywheel", "flywheel-present"]):
        choice, faults = choose_engines(wanted)
        assert {"reference", "flywheel", "flywheel-present"} <= {*choice.names}
        assert not faults
    assert choose_engines(["flywheel-p*", "flywheel"])[0].named == {"flywheel"}


def test_a_pattern_leaves_out_what_the_ground_does_not_suit() -> None:
    # One of Exudyn's engines rides on the plane alone.
    plan = plan_run(*load_scenario("q2"), ["exudyn*"])
    assert set(plan.engines) == {"reference", "exudyn", "exudyn-plane-normal"}
    assert list(plan.left_out) == ["exudyn-builtin"]
    with pytest.raises(ScenarioError, match="exudyn-builtin"):
        plan_run(*load_scenario("q2"), ["exudyn-builtin"])


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("exudin", "did you mean 'exudyn'"),
        ("bullet-*", "no installed engine fits 'bullet-\\*': there are reference, exudyn"),
        ("flywheel-[ao]*", "engines flywheel-absent, flywheel-older are not installed; install: pip .*absent.*older"),
    ],
)
def test_an_entry_that_chooses_nothing_is_refused(package: None, entry: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        plan_run(*load_scenario("q2"), ["reference", entry])


def test_settings_of_engines_that_are_not_installed_are_no_fault(package: None) -> None:
    assert list_engine_faults({"flywheel-absent": {"step": 1.0}}) == []
    assert len(list_engine_faults({"flywheel-unknown": {}})) == 1


@pytest.mark.parametrize(
    ("engine", "packages"),
    [
        ("mujoco-native", ("mujoco",)),
        ("exudyn-builtin", ("exudyn",)),
        ("reference", ("velodrome",)),
        ("flywheel", ("flywheel",)),
        ("flywheel-present", ("numpy",)),
    ],
)
@pytest.mark.usefixtures("package")
def test_the_packages_whose_releases_an_engine_rides_in(engine: str, packages: tuple[str, ...]) -> None:
    assert list_library_packages(engine) == packages
