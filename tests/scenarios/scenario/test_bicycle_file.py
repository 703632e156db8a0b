"""Bicycle files, held against the package BicycleParameters."""

from __future__ import annotations

import math
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from velodrome.reference.bicycle import Bicycle, require_rigid_bodies
from velodrome.reference.upright import canonical_matrices, capsize_speed, stability_changes, weave_speed
from velodrome.scenarios.error import ScenarioError
from velodrome.scenarios.scenario.bicycle_file import read_bicycle_file

peer: Any = pytest.importorskip("bicycleparameters", reason="BicycleParameters, a peer of the suite, is not installed")
FOLDER = Path(peer.__file__).parent
FILES = sorted([*FOLDER.glob("app-data/bicycles/*/Parameters/*.txt"), *FOLDER.glob("tests/parameter_sets/*.yml")])
SPEEDS = np.linspace(0.0, 12.0, 49)


def peer_parameters(path: Path) -> dict[str, float]:
    """The parameters in Meijaard's symbols, as the package itself reads them."""
    import yaml
    from bicycleparameters.conversions import _convert_principal_to_benchmark
    from bicycleparameters.io import load_parameter_text_file, remove_uncertainties

    if path.suffix == ".txt":
        return remove_uncertainties(load_parameter_text_file(str(path)))
    document = yaml.safe_load(path.read_text())
    values = document.get("values", document)
    return _convert_principal_to_benchmark(values) if path.stem.startswith("principal") else values


def peer_matrices(path: Path) -> list[np.ndarray]:
    from bicycleparameters.bicycle import benchmark_par_to_canonical

    return [np.asarray(matrix, float) for matrix in benchmark_par_to_canonical(dict(peer_parameters(path)))]


def peer_eigenvalues(matrices: list[np.ndarray], speed: float, gravity: float) -> np.ndarray:
    from bicycleparameters.bicycle import ab_matrix

    mass, damping, stiffness, speed_stiffness = matrices
    state, _ = ab_matrix(mass, damping, stiffness, speed_stiffness, speed, gravity)
    return np.linalg.eigvals(np.asarray(state, float))


def test_the_package_has_files_of_every_kind() -> None:
    kinds = {(path.suffix, path.stem.partition("-")[0] if path.suffix == ".yml" else "") for path in FILES}
    assert kinds == {(".txt", ""), (".yml", "benchmark"), (".yml", "principal")}


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_matrices_and_eigenvalues_are_the_packages(path: Path) -> None:
    own = canonical_matrices(read_bicycle_file(path).bicycle)
    expected = peer_matrices(path)
    for name, matrix in zip(("M", "C1", "K0", "K2"), expected, strict=True):
        # Of the largest entry: sums of some ten products of doubles.
        np.testing.assert_allclose(getattr(own, name), matrix, rtol=0, atol=1e-12 * np.abs(matrix).max(), err_msg=name)
    for speed, found in zip(SPEEDS, own.eigenvalues(SPEEDS), strict=True):
        theirs = peer_eigenvalues(expected, speed, own.gravity)
        gaps = np.abs(found[:, None] - theirs)
        # A double eigenvalue splits by the root of round-off.
        split = np.sort(np.abs(theirs[:, None] - theirs), axis=1)[:, 1].min() < 1e-3
        assert max(gaps.min(axis=0).max(), gaps.min(axis=1).max()) < (1e-6 if split else 1e-9) * np.abs(theirs).max()


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_speeds_are_those_at_which_the_packages_eigenvalues_lie_on_the_axis(path: Path) -> None:
    expected, own = peer_matrices(path), canonical_matrices(read_bicycle_file(path).bicycle)
    for change in stability_changes(own):
        by_speed = [
            peer_eigenvalues(expected, speed, own.gravity)
            for speed in (change.speed - 1e-6, change.speed, change.speed + 1e-6)
        ]
        below, here, above = (values[np.abs(np.real(values)).argmin()].real for values in by_speed)
        # Newton's step from here to the zero of the package's real part.
        assert abs(here * 2e-6 / (above - below)) < 1e-9 * max(1.0, change.speed)


def test_uncertainties_are_kept() -> None:
    found = read_bicycle_file(FOLDER / "app-data/bicycles/Browser/Parameters/BrowserBenchmark.txt")
    assert found.uncertainties["trail"] == 0.00169464113488
    assert found.uncertainties["rear_frame_Ixz"] == 0.00114783359707
    assert (found.bicycle.trail, found.bicycle.rear_frame_Ixz, found.bicycle.rear_frame_z) == (0.0686, 0.1163, 0.538)


def test_scatter_of_a_measurement_is_a_warning_with_its_size() -> None:
    browser = read_bicycle_file(FOLDER / "app-data/bicycles/Browser/Parameters/BrowserBenchmark.txt").bicycle
    (line,) = browser.warnings()
    assert "rear_frame" in line
    assert "2.33 %" in line
    require_rigid_bodies(browser)
    optimised = read_bicycle_file(FOLDER / "tests/parameter_sets/benchmark-realizedopttwo.yml").bicycle
    with pytest.raises(ValueError, match=r"rear_wheel_I.*148 %"):
        require_rigid_bodies(optimised)


def test_toml_of_ours_is_read_with_its_uncertainties(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    lines = [f"{one.name} = {getattr(Bicycle(), one.name)!r}" for one in fields(Bicycle)]
    path.write_text("[bicycle]\n" + "\n".join(lines) + "\n[uncertainties]\ntrail = 0.001\n")
    found = read_bicycle_file(path)
    assert found.bicycle == Bicycle()
    assert found.uncertainties == {"trail": 0.001}


def test_a_toml_file_has_every_parameter(tmp_path: Path) -> None:
    path = tmp_path / "partial.toml"
    path.write_text("wheelbase = 1.1\ntrail = 0.07\n")
    with pytest.raises(ScenarioError, match=r"steer_axis_tilt, rear_wheel_radius, .* missing; a bicycle"):
        read_bicycle_file(path)


def test_benchmark_in_meijaards_symbols_is_the_benchmark() -> None:
    found = read_bicycle_file(FOLDER / "tests/parameter_sets/benchmark-benchmark.yml").bicycle
    for one in fields(Bicycle):
        assert getattr(found, one.name) == pytest.approx(getattr(Bicycle(), one.name), rel=1e-12), one.name
    assert weave_speed(canonical_matrices(found)) == pytest.approx(4.29238253634111, abs=1e-11)
    assert capsize_speed(canonical_matrices(found)) == pytest.approx(6.02426201538837, abs=1e-11)


GOOD = (FOLDER / "app-data/bicycles/Silver/Parameters/SilverBenchmark.txt").read_text()


def without(name: str) -> str:
    return "".join(line + "\n" for line in GOOD.splitlines() if line.partition("=")[0].strip() != name)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (GOOD + "\nzz = 1\n", "'zz' is no parameter of a bicycle"),
        (GOOD + "\nw = 1\n", "w is given a second time"),
        (without("IBxx"), "IBxx missing"),
        (GOOD.replace("lam = ", "lam = about "), "lam is 'about .*it must be a number"),
        (without("IRzz") + "IRzz = 3\n", "IRzz is 3.0; in this model it can only be"),
        (without("yB") + "yB = 0.1\n", "yB is 0.1; in this model it can only be 0.0"),
        (GOOD + "\nkTdel_phi = 2\n", "kTdel_phi is a gain of a controller"),
        ("w", "line 1: 'w' must be a name and a value"),
        (GOOD.replace("mF = ", "mF = -"), "front_wheel_mass is -"),
    ],
)
def test_a_wrong_file_is_told_in_one_line(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "wrong.txt"
    path.write_text(text)
    with pytest.raises(ScenarioError, match=said) as caught:
        read_bicycle_file(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_numbers_may_carry_a_common_exponent(tmp_path: Path) -> None:
    path = tmp_path / "exponent.txt"
    path.write_text(without("c") + "c = (19+/-2)e-02\n")
    found = read_bicycle_file(path)
    assert found.bicycle.trail == pytest.approx(0.19, rel=1e-15)
    assert math.isclose(found.uncertainties["trail"], 0.02)
