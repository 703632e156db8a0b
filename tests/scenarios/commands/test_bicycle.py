"""`velodrome bicycle`: a bicycle by itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

CASES = Path(__file__).parents[2] / "cases"
# A measured city bicycle, "Browser" of Moore (2012), z up.
PAIRED = """
wheelbase = 1.121
trail = 0.0686
steer_axis_tilt = 0.399680398707
gravity = 9.81
rear_wheel_radius = 0.341
rear_wheel_mass = 3.1
rear_wheel_Ixx = 0.0904
rear_wheel_Iyy = 0.1524
rear_frame_x = 0.274
rear_frame_z = 0.538
rear_frame_mass = 9.9
rear_frame_Ixx = 0.5296
rear_frame_Iyy = 1.3164
rear_frame_Izz = 0.7568
rear_frame_Ixz = 0.1163
front_frame_x = 0.867
front_frame_z = 0.748
front_frame_mass = 3.2
front_frame_Ixx = 0.2534
front_frame_Iyy = 0.2458
front_frame_Izz = 0.0956
front_frame_Ixz = 0.072
front_wheel_radius = 0.344
front_wheel_mass = 2.0
front_wheel_Ixx = 0.0884
front_wheel_Iyy = 0.1492
"""


def test_the_document_is_complete(velodrome) -> None:
    found = velodrome("bicycle", "--speeds", "0,5,8", "--json").json()
    assert found["weave_speed"] == pytest.approx(4.29238253634111, abs=1e-13)
    assert found["capsize_speed"] == pytest.approx(6.02426201538837, abs=1e-13)
    assert found["stable_speeds"] == [[found["weave_speed"], found["capsize_speed"]]]
    assert found["speeds"] == [0.0, 5.0, 8.0]
    assert np.shape(found["eigenvalues"]) == (3, 4, 2)
    assert found["modes"]["names"] == ["weave", "weave", "capsize", "castering"]
    assert (found["uncertainties"], found["warnings"], found["speed_deviations"]) == ({}, [], {})
    assert found["parameters"]["rear_frame_Ixz"] == -2.4
    assert {name: np.shape(matrix) for name, matrix in found["canonical"].items()} == dict.fromkeys(
        ("M", "C1", "K0", "K2"), (2, 2)
    )


def test_the_two_mass_skate_is_stable_without_gyroscopes_and_trail(velodrome) -> None:
    """Kooijman et al. (2011): massless wheels, point masses, no trail; the speed from Meijaard's matrices."""
    found = velodrome("bicycle", str(CASES / "tms-exact.toml"), "--json").json()
    assert found["weave_speed"] == pytest.approx(2.841008323, abs=5e-10)
    assert found["stable_speeds"] == [[found["weave_speed"], None]]


def test_the_table_and_files_are_written(velodrome, tmp_path: Path) -> None:
    result = velodrome("bicycle", "--out", str(tmp_path / "found"))
    assert "weave speed: 4.29238253634 m/s" in result.stdout
    assert {path.name for path in (tmp_path / "found").iterdir()} == {"bicycle.json", "bicycle.html", "eigenvalues.png"}


def test_the_table_shows_a_pair_of_two_modes_as_complex(velodrome, tmp_path: Path) -> None:
    """Capsize and castering of this bicycle are a pair at low speeds."""
    path = tmp_path / "paired.toml"
    path.write_text(PAIRED)
    document = velodrome("bicycle", str(path), "--speeds", "1", "--json").json()
    (real, imaginary), other = document["modes"]["eigenvalues"][0][2:]
    assert abs(imaginary) > 0.1
    assert other == [real, -imaginary]
    table = velodrome("bicycle", str(path), "--speeds", "1").stdout
    assert f"{real:.4f} {'+' if imaginary > 0 else '-'} {abs(imaginary):.4f}i" in table


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["bicycle", "--speeds", "5:1"], "--speeds '5:1': TO must be above FROM"),
        (["bicycle", "--speeds", "fast"], "--speeds 'fast'"),
        (["bicycle", "--speeds", "-1:3"], "--speeds '-1:3'"),
        (["bicycle", "nowhere.txt"], "nowhere.txt: there is no such file"),
        (["bicycle", "--speeds", "1:1"], "--speeds '1:1': TO must be above FROM"),
        (["bicycle", "--speeds", "1,3,2"], "--speeds '1,3,2': each speed must be above the one before it"),
        (["bicycle", "--speeds", "1:1e9"], "--speeds '1:1e9': each speed must be from 0 to 10000 m/s"),
        (["bicycle", "--speeds", "1:2:3"], "--speeds '1:2:3': must be a range FROM:TO"),
        (["bicycle", "nothing"], "no bicycle 'nothing': give benchmark, a bicycle file (BicycleParameters or TOML)"),
    ],
)
def test_bad_input_is_one_line(velodrome, arguments: list[str], said: str) -> None:
    result = velodrome(*arguments)
    assert (result.status, result.stdout) == (2, "")
    assert said in result.stderr
    assert result.stderr.count("\n") == 1


def test_figures_are_written_in_each_format_and_width(velodrome, tmp_path: Path) -> None:
    out = str(tmp_path / "found")
    velodrome("bicycle", "--out", out, "--format", "pdf", "--format", "svg", "--format", "pdf", "--columns", "1")
    assert {path.name for path in (tmp_path / "found").iterdir()} == {
        "bicycle.json",
        "bicycle.html",
        "eigenvalues.pdf",
        "eigenvalues.svg",
    }
    assert 'width="252.283465pt"' in (tmp_path / "found" / "eigenvalues.svg").read_text()  # 89 mm


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--format", "pdf"), "--format: it is of figures, which are written with --out only"),
        (("--columns", "1"), "--columns: it is of figures, which are written with --out only"),
        (("--out", "found", "--format", "gif"), "--format gif: no such format (there are png, svg, pdf)"),
    ],
)
def test_figures_that_cannot_be_written_are_refused(velodrome, options: tuple[str, ...], said: str) -> None:
    result = velodrome("bicycle", *options)
    assert result.status == 2
    assert said in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
