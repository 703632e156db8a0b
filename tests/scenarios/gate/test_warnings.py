"""What the gate says of the bicycles of its scenarios."""

from __future__ import annotations

from pathlib import Path

from velodrome.scenarios.gate import list_bicycle_warnings


def test_a_bicycle_that_no_rigid_bodies_make_up_is_named(tmp_path: Path) -> None:
    text = 'title = "x"\nsurface = { kind = "plane" }\nmotion = { kind = "upright", speed = 5.0 }\n'
    text += "simulation = { duration = 1.0 }\n"
    (tmp_path / "plain.toml").write_text(text)
    # Of a wheel, Iyy = 2 Ixx is a thin ring; 1 % more is the scatter of a measurement.
    (tmp_path / "measured.toml").write_text(f"{text}[bicycle]\nrear_wheel_Iyy = {2 * 0.0603 * 1.01!r}\n")
    found = list_bicycle_warnings([str(tmp_path / "plain.toml"), str(tmp_path / "measured.toml")])
    assert list(found) == ["measured"]
    (line,) = found["measured"]
    assert line.startswith("rear_wheel: the largest principal moment exceeds the sum of the other two by 1 %")


def test_no_gated_bicycle_of_the_library_is_remarkable() -> None:
    assert list_bicycle_warnings() == {}
