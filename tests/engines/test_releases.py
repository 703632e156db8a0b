"""Releases of libraries: what is refused, what is left out or replaced, and that recorded settings say so."""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
from numpy.lib.stride_tricks import as_strided

import velodrome
from velodrome.engines.admission import ride_engine
from velodrome.engines.engine import EngineError, Settings, UnsuitableProblem
from velodrome.engines.exudyn import library as exudyn_library
from velodrome.engines.mujoco import inertia, layout
from velodrome.engines.mujoco.convergence import watch_solver
from velodrome.engines.mujoco.library import read_energy
from velodrome.engines.mujoco.model import mjcf
from velodrome.engines.mujoco.planes import build_planes
from velodrome.engines.mujoco.ride import ride_rig
from velodrome.engines.mujoco.settings import ExactContactSettings, NativeSettings
from velodrome.engines.registry import default_engines, engine_names, load_engine, preview_engine, uninstalled_engines
from velodrome.engines.releases import Adaptation, LibraryReach, find_reach, split_adaptations
from velodrome.reference.bicycle import Bicycle
from velodrome.scenarios.scenario.schema import load_scenario
from velodrome.scenarios.scenario.start import make_start

# Names of the suite's engines whose releases it knows begin so; other packages' may be installed too.
OWN = ("drake", "exudyn", "mjx", "mujoco", "pinocchio")
DECLARED = {name: reach for name in engine_names() if (reach := find_reach(load_engine(name))) is not None}


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a function that makes a library count as another release."""

    def pretend(version: str) -> None:
        monkeypatch.setattr(LibraryReach, "version", property(lambda _: version))

    return pretend


def start_problem(duration: float = 0.2) -> Any:
    return make_start(load_scenario("plane-circle", {"simulation.duration": duration})[1]).problem


def test_every_engine_of_mujoco_and_exudyn_says_its_releases() -> None:
    assert {name for name in default_engines() if name.startswith(("mujoco", "exudyn"))} <= set(DECLARED)


@pytest.mark.parametrize("name", sorted(DECLARED))
def test_releases_before_the_oldest_are_refused(name: str, installed: Any) -> None:
    engine, reach = load_engine(name), DECLARED[name]
    problem, settings = start_problem(), engine.settings()
    engine.check(problem, settings)
    installed(reach.oldest)
    engine.check(problem, settings)
    major, minor, _ = reach.oldest.split(".")
    before = f"{int(major) - 1}.99.9" if minor == "0" else f"{major}.{int(minor) - 1}.9"
    installed(before)
    line = f"{name} needs {reach.library} {reach.oldest} or newer ({reach.needs}), this is {before}"
    with pytest.raises(UnsuitableProblem) as raised:
        engine.check(problem, settings)
    assert str(raised.value) == line
    with pytest.raises(ValueError, match="or newer"):
        engine.simulate(problem, settings, lambda _: None)


def test_nothing_is_done_otherwise_with_the_installed_releases() -> None:
    for name, reach in DECLARED.items():
        assert reach.list_adaptations() == {}, name
        assert find_reach(load_engine(name)) is reach


def test_versions_are_compared_as_releases(installed: Any) -> None:
    reach = LibraryReach("mujoco", "MuJoCo", "3.0.0", "x")
    for version, newer in (("3.10.0", True), ("3.9.0.dev7", True), ("3.8.1", False), ("3.9", True), ("own", True)):
        installed(version)
        assert reach.has("3.9.0") == newer, version


def test_adaptations_have_a_first_and_a_last_release(installed: Any) -> None:
    change = Adaptation("thing", since="3.3.0", how="replaced", text="by another", first="3.1.0")
    reach = LibraryReach("mujoco", "MuJoCo", "3.0.0", "x", adaptations=(change,))
    for version, done in (("3.0.9", False), ("3.1.0", True), ("3.2.7", True), ("3.3.0", False)):
        installed(version)
        assert reach.list_adaptations() == ({"replaced": {"thing": "by another"}} if done else {})
    assert reach.as_json("rider")["replaced"] == {}


def test_values_that_a_release_lacks_are_refused(installed: Any) -> None:
    engine = load_engine("mujoco-native")
    installed("3.12.0")
    with pytest.raises(UnsuitableProblem, match=r"integrator 'discrete' needs MuJoCo 3\.13\.0 or newer .* is 3\.12\.0"):
        engine.check(start_problem(), NativeSettings(integrator="discrete"))
    engine.check(start_problem(), NativeSettings())


def test_inputs_are_refused_where_exudyn_lacks_the_spring(installed: Any) -> None:
    scenario = load_scenario("plane-circle", {"simulation.duration": 0.2, "inputs.steer_damping": 0.1})[1]
    problem, engine = make_start(scenario).problem, load_engine("exudyn")
    installed("1.9.0")
    with pytest.raises(UnsuitableProblem, match=r"a ride with inputs needs Exudyn 1\.10\.0 or newer"):
        engine.check(problem, engine.settings())


def test_a_ride_without_what_a_release_lacks_is_the_same_and_says_so(installed: Any) -> None:
    problem, engine = start_problem(), load_engine("mujoco-native")
    newest = ride_engine(engine, problem, engine.settings(), lambda _: None)
    installed("3.2.2")
    engine = load_engine("mujoco-native")
    older = ride_engine(engine, problem, engine.settings(), lambda _: None)
    assert np.array_equal(older.q, newest.q)
    assert older.kinetic_energy is not None
    assert newest.kinetic_energy is not None
    assert np.array_equal(older.kinetic_energy, newest.kinetic_energy)
    assert newest.unconverged_steps == 0
    assert (older.unconverged_steps, older.largest_residual) == (None, None)
    own, adapted = split_adaptations(older.settings, newest.settings)
    assert own == newest.settings
    assert set(adapted["left_out"]) == {"solver_residual"}
    assert set(adapted["replaced"]) == {"energy"}


def test_manifest_and_gate_say_what_was_left_out(installed: Any, tmp_path: Path) -> None:
    installed("3.2.2")
    run = velodrome.run("plane-circle", engines=["mujoco-native"], duration=0.1, out=tmp_path)
    assert run.folder is not None
    again = velodrome.load(run.folder)
    assert again.trajectories["mujoco-native"].settings == run.trajectories["mujoco-native"].settings
    text = (run.folder / "manifest.json").read_text()
    assert '"left_out"' in text.split('"engines"')[1].split('"warnings"')[0]
    assert "solver_residual" in text


def test_what_is_said_of_adaptations_must_be_lines(installed: Any) -> None:
    engine, problem = load_engine("mujoco-native"), start_problem(0.1)
    settings = engine.settings()
    trajectory = engine.simulate(problem, settings, lambda _: None)
    for said in ("no flag", {}, {"flag": ""}, {"flag": 3}, {"flag": "two\nlines"}):
        wrong = replace(trajectory, settings=trajectory.settings | {"left_out": said})
        told: Any = SimpleNamespace(
            name=engine.name,
            version=engine.version,
            gives=engine.gives,
            settings=engine.settings,
            takes_inputs=True,
            check=lambda *_: None,
            simulate=lambda *_, wrong=wrong: wrong,
        )
        with pytest.raises(EngineError, match=r"left_out .* lines of text by name"):
            ride_engine(told, problem, settings, lambda _: None)


def test_a_setting_of_that_name_is_no_adaptation() -> None:
    class OwnSettings(Settings):
        left_out: int = 3

    own = OwnSettings().model_dump()
    assert split_adaptations(own, own) == (own, {})


def test_models_of_older_releases_lack_the_flag_and_count_the_gap_in(installed: Any) -> None:
    bicycle = Bicycle()
    assert 'autoreset="disable"' in mjcf(bicycle, NativeSettings(), "plane")
    assert 'margin="0.001" gap="1000000000.0"' in mjcf(bicycle, ExactContactSettings(), "edges")
    installed("3.8.1")
    assert 'margin="1000000000.001" gap="1000000000.0"' in mjcf(bicycle, ExactContactSettings(), "edges")
    installed("3.2.0")
    assert "autoreset" not in mjcf(bicycle, NativeSettings(), "plane")


def test_state_that_became_infinite_ends_the_ride_without_the_flag(installed: Any) -> None:
    installed("3.2.0")
    problem = start_problem(0.5)
    rig = build_planes(problem, NativeSettings())
    rig.model.opt.gravity[2] = 1e16
    ended = ride_rig(rig, 0.002, [5 * i for i in range(51)], lambda _: None).ended
    assert ended is not None
    assert "infinite or huge" in ended


def test_inertia_of_the_older_form_is_the_same_matrix(installed: Any) -> None:
    rig = build_planes(start_problem(), NativeSettings())
    model, data = rig.model, rig.data
    mujoco.mj_forward(model, data)
    full = dense(inertia.find_inertia(model, data))
    assert np.linalg.eigvalsh(full).min() > 0
    parents, first, entries = model.dof_parentid, [], []
    for row in range(model.nv):
        first.append(len(entries))
        column = row
        while column >= 0:
            entries.append(full[row, column])
            column = int(parents[column])
    older: Any = SimpleNamespace(nv=model.nv, dof_parentid=parents, dof_Madr=np.array(first, np.int32))
    installed("3.3.5")
    state: Any = SimpleNamespace(qM=np.array(entries))
    assert np.array_equal(dense(inertia.find_inertia(older, state)), full)


def dense(arrays: inertia.InertiaArrays) -> np.ndarray:
    n = len(arrays.M_rownnz)
    out = np.zeros((n, n))
    for row in range(n):
        for at in range(arrays.M_rowadr[row], arrays.M_rowadr[row] + arrays.M_rownnz[row]):
            out[row, arrays.M_colind[at]] = out[arrays.M_colind[at], row] = arrays.M[at]
    return out


def test_energies_are_read_from_behind_a_view_without_strides() -> None:
    numbers = np.array([3.0, 5.0])
    state: Any = SimpleNamespace(energy=as_strided(numbers, (2,), (0,)))
    assert read_energy(state).tolist() == [3.0, 5.0]


def test_description_of_another_release_is_not_taken(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for cached in (layout._describe, layout.find_layout):
        cached.cache_clear()
    monkeypatch.setattr(mujoco, "__file__", str(tmp_path / "mujoco" / "__init__.py"))
    with pytest.raises(EngineError, match=r"no description of its structures, mujoco\.introspect; MuJoCo 3\.3 has"):
        layout.find_layout()
    layout._describe.cache_clear()


def test_knife_edges_are_refused_where_the_engine_is(installed: Any) -> None:
    layout.find_layout.cache_clear()
    installed("3.3.0")
    with pytest.raises(EngineError, match=r"a knife edge needs MuJoCo 3\.3\.1 or newer"):
        layout.find_layout()


def test_watching_needs_no_description(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse() -> None:
        raise AssertionError

    monkeypatch.setattr(layout, "find_layout", refuse)
    rig = build_planes(start_problem(), NativeSettings())
    with watch_solver(rig.model, rig.data, 1e-6) as convergence:
        mujoco.mj_forward(rig.model, rig.data)
    assert convergence.largest is not None


def test_renamed_arguments_of_exudyn() -> None:
    def old(bodyNumbers: Any, position: Any) -> Any:
        return bodyNumbers, position

    def new(itemNumbers: Any, position: Any, bodyNumbers: Any = None) -> Any:
        return itemNumbers, position, bodyNumbers

    assert exudyn_library.connect(old, (1, 2), position=3) == ([1, 2], 3)
    assert exudyn_library.connect(new, (1, 2), position=3) == ([1, 2], 3, None)


def test_renamed_settings_of_exudyn() -> None:
    old: Any = SimpleNamespace(solutionSettings=SimpleNamespace(), linearSolverType=None)
    exudyn_library.write_no_files(old, 0.5)
    exudyn_library.choose_dense_solver(old)
    assert vars(old.solutionSettings) == {"writeSolutionToFile": False, "sensorsWritePeriod": 0.5}
    assert old.linearSolverType.name == "EigenDense"


def test_total_coordinates_of_older_exudyn_are_the_sum(monkeypatch: pytest.MonkeyPatch) -> None:
    import exudyn as exu
    from exudyn.itemInterface import NodePoint

    container: Any = exu.SystemContainer()
    system = container.AddSystem()
    node = system.AddNode(NodePoint(referenceCoordinates=[1, 2, 3], initialCoordinates=[0.5, 0, -0.25]))
    system.Assemble()
    total = exudyn_library.read_total_coordinates(system, node)
    monkeypatch.setattr(exudyn_library, "_TOTAL", None)
    assert np.array_equal(exudyn_library.read_total_coordinates(system, node), total)
    assert total.tolist() == [1.5, 2, 2.75]


def test_printing_of_older_exudyn(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[bool] = []
    monkeypatch.setattr(exudyn_library, "_library", SimpleNamespace(SetWriteToConsole=said.append))
    assert exudyn_library.set_printing(False)
    assert said == [False]


def read_table(heading: str) -> list[list[str]]:
    """Return the rows of the table below a heading of the page on older releases."""
    page = (Path(__file__).parents[2] / "docs/guides/releases.md").read_text(encoding="utf-8")
    lines = page.split(heading)[1].splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]
    after = next(i for i, row in enumerate(rows) if set(row[0]) <= set("- "))
    return rows[after + 1 :]


def test_the_page_on_releases_says_what_is_declared() -> None:
    announced = [name for name in [*engine_names(), *uninstalled_engines()] if name.startswith(OWN)]
    own = {name: reach for name in announced if (reach := find_reach(preview_engine(name))) is not None}
    first, changes = "# Older releases\n", "## What is done otherwise\n"
    rows = read_table(first)[: len(own)]
    assert rows == [
        [f"`{name}`", f"{reach.library} {reach.oldest}", reach.needs] for name, reach in sorted(own.items())
    ]
    declared = {(reach.library, each) for reach in own.values() for each in reach.adaptations}
    told = set()
    for library, each in declared:
        releases = f"{library} {'' if each.first == '0' else f'from {each.first}, '}before {each.since}"
        told.add((f"`{each.name}`", releases, each.how.replace("_", " "), each.text))
    assert {tuple(row) for row in read_table(changes)} == told


RIDE = """
import json, sys
import numpy as np
import velodrome
scenario, engine, step = sys.argv[1], sys.argv[2], float(sys.argv[3])
run = velodrome.run(scenario, engines=[engine], duration=0.5, settings={engine: {"step": step}})
ride, right = run.trajectories[engine], run.trajectories["reference"]
energy = ride.kinetic_energy + ride.potential_energy
print(json.dumps({
    "version": ride.version,
    "error": float(np.linalg.norm(ride.q[-1, :3] - right.q[-1, :3])),
    "energy": float(energy[-1] - energy[0]),
    "force": float(np.abs(ride.contact_force[0]).max()),
    "left_out": sorted(ride.settings.get("left_out", {})),
    "replaced": sorted(ride.settings.get("replaced", {})),
}))
"""


def ride_in_process(folder: Path | None, scenario: str, engine: str, step: float) -> dict[str, Any]:
    """Ride in a process of its own, with the packages of a folder before all others."""
    path = [*([] if folder is None else [str(folder)]), *(each for each in sys.path if each)]
    done = subprocess.run(
        [sys.executable, "-c", RIDE, scenario, engine, repr(step)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def releases(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Return a function that gives the folder of a release, from the package registry."""

    def fetch(package: str, version: str) -> Path:
        folder = tmp_path_factory.getbasetemp() / f"{package}-{version}"
        if not folder.exists():
            options = ("--quiet", "--no-deps", "--only-binary", ":all:", "--target", str(folder))
            command = [sys.executable, "-m", "pip", "install", *options, f"{package}=={version}"]
            # Constraints pin the newest releases.
            environment = os.environ | {"PIP_CONSTRAINT": ""}
            done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
            if done.returncode != 0:
                pytest.skip(f"{package} {version} cannot be had here: {done.stderr.strip().splitlines()[-1]}")
        return folder

    return fetch


@pytest.mark.slow
@pytest.mark.parametrize(
    ("version", "left_out", "replaced"),
    [
        ("3.0.0", ["autoreset", "solver_residual"], ["energy"]),
        ("3.2.2", ["solver_residual"], ["energy"]),
        ("3.2.3", [], ["energy", "inertia"]),
        ("3.3.5", [], ["inertia"]),
        ("3.3.6", [], []),
    ],
)
def test_native_model_rides_with_old_releases_of_mujoco(
    releases: Any, version: str, left_out: list[str], replaced: list[str]
) -> None:
    old = ride_in_process(releases("mujoco", version), "q2-plus", "mujoco-native", 0.002)
    new = ride_in_process(None, "q2-plus", "mujoco-native", 0.002)
    assert (old["version"], old["left_out"], old["replaced"]) == (version, left_out, replaced)
    # Each of 250 steps may leave 1e-8 of the forces unconverged.
    assert old["error"] == pytest.approx(new["error"], rel=250 * 1e-8)
    assert old["energy"] == pytest.approx(new["energy"], rel=250 * 1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("version", ["3.3.1", "3.8.1"])
@pytest.mark.parametrize("engine", ["mujoco-exact-contact", "mujoco-multipliers"])
def test_exact_models_ride_with_old_releases_of_mujoco(releases: Any, version: str, engine: str) -> None:
    folder = releases("mujoco", version)
    coarse, fine = (ride_in_process(folder, "q2-plus", engine, step) for step in (0.002, 0.001))
    assert coarse["version"] == version
    # RK4 with a free joint has order 2 before MuJoCo 4.0; the next order of its error is h times rates of some 10/s.
    assert coarse["error"] / fine["error"] == pytest.approx(4, rel=10 * 0.002 * 2)
    # Its error there is a thousand times that of order 4, which says that the model itself is right.
    assert fine["error"] < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize(
    ("version", "replaced", "left_out"),
    [("1.9.0", ["coordinates"], ["first_force"]), ("1.10.0", [], ["first_force"]), ("1.11.0", [], [])],
)
def test_exudyn_rides_with_old_releases(releases: Any, version: str, replaced: list[str], left_out: list[str]) -> None:
    old = ride_in_process(releases("exudyn", version), "q2-plus", "exudyn", 0.001)
    new = ride_in_process(None, "q2-plus", "exudyn", 0.001)
    assert (old["version"], old["left_out"], old["replaced"]) == (version, left_out, replaced)
    # Newton's method may leave 1e-11 m in each of 500 steps.
    assert old["error"] == pytest.approx(new["error"], abs=500 * 1e-11)
    assert (old["force"] == 0) == bool(left_out)
