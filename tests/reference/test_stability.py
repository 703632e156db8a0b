import re
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq, fsolve

from tests.literature import published, rounds_to
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state, dynamics
from velodrome.reference.families import find_motion
from velodrome.reference.kinematics import LEAN, REAR_ANGLE, STEER
from velodrome.reference.stability import Linearisation, growth_rate, linearise
from velodrome.reference.surface import Paraboloid, Plane

BICYCLE = Bicycle()
MEIJAARD = published("meijaard2007")
KANE = published("kane2012")
PRINTED = published("xiong2020")


def upright(speed: float) -> Linearisation:
    rates = (0.0, 0.0, speed / BICYCLE.rear_wheel_radius)
    return linearise(BICYCLE, Plane(), *consistent_state(BICYCLE, Plane(), (0.0, 0.0), 0.0, 0.0, rates))


@pytest.mark.parametrize("index", range(11))
def test_upright_eigenvalues_are_meijaards(index: int) -> None:
    """Table 2: capsize, castering and weave at 0 to 10 m/s."""
    table = MEIJAARD["eigenvalues"]
    real, imaginary = table["weave_re_im"][index]
    # At rest the weave pair is two real roots.
    weave = [real, imaginary] if index == 0 else [complex(real, imaginary), complex(real, -imaginary)]
    found = list(upright(table["v"][index]).eigenvalues)
    for expected in [table["capsize"][index], table["castering"][index], *weave]:
        nearest = min(found, key=lambda value: abs(value - expected))
        assert abs(nearest - expected) < 1e-9
        found.remove(nearest)
    # What is left are the symmetries: position along and across the line, and the speed. A threefold
    # zero without three eigenvectors splits like the cube root of round-off.
    assert max(abs(value) for value in found) < 1e-4


# Rows and columns of lean and steer and their rates: the lateral equations on the straight motion.
LATERAL = [2, 3, 4, 5]


def lateral(speed: float) -> np.ndarray:
    return upright(speed).jacobian[np.ix_(LATERAL, LATERAL)]


def test_weave_speed_and_frequency_are_meijaards() -> None:
    critical = MEIJAARD["critical"]

    def weave(speed: float) -> complex:
        return max((v for v in upright(speed).eigenvalues if abs(v.imag) > 1), key=lambda v: v.imag)

    speed: Any = brentq(lambda speed: weave(speed).real, 4.2, 4.4, xtol=1e-13)
    # Eigenvalues are known to some 1e-13 times their condition, below 100; the root's slope is about 1.
    assert speed == pytest.approx(critical["v_weave"], abs=1e-11)
    assert weave(speed).imag == pytest.approx(critical["omega_weave"], abs=1e-11)


def test_capsize_speed_is_meijaards() -> None:
    speed: Any = brentq(lambda speed: float(np.linalg.det(lateral(speed))), 5.9, 6.1, xtol=1e-13)
    assert speed == pytest.approx(MEIJAARD["critical"]["v_capsize"], abs=1e-11)


def test_weave_is_born_of_a_double_root_at_meijaards_speed() -> None:
    """det(A - lambda) = 0 and its derivative by lambda: regular in (speed, lambda), unlike the eigenvalues."""
    # A is quadratic in the speed: three speeds give it at all.
    rest, one, two = lateral(0.0), lateral(1.0), lateral(2.0)
    square = (two - 2 * one + rest) / 2
    linear = one - rest - square

    def equations(x: np.ndarray) -> list[float]:
        matrix = rest + x[0] * linear + x[0] ** 2 * square
        coefficients = np.poly(matrix)
        return [np.polyval(coefficients, x[1]), np.polyval(np.polyder(coefficients), x[1])]

    found: Any = fsolve(equations, (0.7, 3.8), xtol=1e-12)
    speed, value = found
    critical = MEIJAARD["critical"]
    # Coefficients of some 1e3 known to 1e-13, slopes of some 100.
    assert speed == pytest.approx(critical["v_double_root"], abs=1e-11)
    assert value == pytest.approx(critical["lambda_double_root"], abs=1e-11)


@pytest.mark.parametrize("speed", range(6))
def test_upright_jacobian_is_that_of_kanes_equations(speed: int) -> None:
    table = {name: np.array(value) for name, value in KANE.items() if isinstance(value, list)}
    turn = np.diag([1.0, -1.0])  # the published steer is positive to the right
    found = lateral(float(speed))[2:]
    # Entries of some 50 with the published comparison's own tolerance.
    stiffness, damping = table["constant"] + speed**2 * table["quadratic"], speed * table["damping"]
    assert np.allclose(found[:, :2], turn @ stiffness @ turn, rtol=0, atol=1e-12 * (1 + speed**2) * 10)
    assert np.allclose(found[:, 2:], turn @ damping @ turn, rtol=0, atol=1e-12 * (1 + speed) * 10)


@pytest.mark.parametrize("speed", [0.0, 3.3, 7.7])
def test_upright_jacobian_is_the_canonical_equation(speed: float) -> None:
    """M q'' + v C1 q' + (g K0 + v^2 K2) q = 0; the published steer is positive to the right."""
    matrices = {name: np.array(MEIJAARD["canonical"][name]) for name in ("M", "C1", "K0", "K2")}
    turn = np.diag([1.0, -1.0])
    inverse = np.linalg.inv(matrices["M"])
    stiffness = -turn @ inverse @ (BICYCLE.gravity * matrices["K0"] + speed**2 * matrices["K2"]) @ turn
    damping = -turn @ inverse @ (speed * matrices["C1"]) @ turn
    jacobian = upright(speed).jacobian
    # Printed to 14 decimals; the smallest entry of M is 0.3 against 81: its inverse loses two digits.
    assert np.allclose(jacobian[np.ix_([4, 5], [2, 3])], stiffness, rtol=1e-12, atol=1e-11)
    assert np.allclose(jacobian[np.ix_([4, 5], [4, 5])], damping, rtol=1e-12, atol=1e-11)


@pytest.mark.parametrize(("name", "family", "stable"), [("Q1", 1, False), ("Q2", 2, True)])
def test_eigenvalues_of_q_round_to_the_print(name: str, family: int, stable: bool) -> None:
    point, surface = PRINTED[name], Paraboloid(0.005)
    _, motion = find_motion(BICYCLE, Paraboloid(0.005), 18.0, family)
    reduced = linearise(BICYCLE, surface, *motion.state())
    found = list(reduced.eigenvalues)
    for text in point["eigenvalues"]:
        real, imaginary = re.fullmatch(r"(-?\d+(?:\.\d+)?)(?:([+-]\d+\.\d+)i)?", text).groups()  # pyright: ignore
        match = [v for v in found if rounds_to(v.real, real) and rounds_to(v.imag, imaginary or "0.00")]
        assert match, text
        # The zero is printed without decimals: of all that round to it take the nearest.
        found.remove(min(match, key=lambda v: abs(v - complex(float(real), float(imaginary or 0)))))
    assert not found
    assert (growth_rate(surface, reduced.eigenvalues, motion.yaw_rate) < 0) == stable
    # On a circular motion X(v) vanishes: accelerations of some 100 m/s^2 cancel.
    assert np.abs(reduced.field).max() < 1e-10


@pytest.mark.parametrize(("family", "rear_rate"), [(1, 12.0), (1, 18.0), (2, 18.0), (3, 9.0), (4, 6.0)])
def test_on_the_plane_the_circles_centre_is_free(family: int, rear_rate: float) -> None:
    """alpha = 0: the spectrum contains 0 and +-i times the yaw rate."""
    _, motion = find_motion(BICYCLE, Paraboloid(0.0), rear_rate, family)
    reduced = linearise(BICYCLE, Plane(), *motion.state())
    for expected in (0, 1j * motion.yaw_rate, -1j * motion.yaw_rate):
        assert np.abs(reduced.eigenvalues - expected).min() < 1e-8


def test_jacobian_is_the_derivative_of_the_field() -> None:
    """Against central differences through the public interface, extrapolated once in the step."""
    surface = Paraboloid(0.2)
    _, motion = find_motion(BICYCLE, Paraboloid(0.2), 10.0, 1)
    q, qd = motion.state()
    jacobian = linearise(BICYCLE, surface, q, qd).jacobian
    v = np.array([q[0], q[1], q[LEAN], q[STEER], 0.0, 0.0, qd[REAR_ANGLE]])

    def field(values: np.ndarray) -> np.ndarray:
        state = consistent_state(
            BICYCLE, surface, (values[0], values[1]), values[2], values[3], tuple(values[4:]), guess=(q[2], q[5])
        )
        a = dynamics(BICYCLE, surface, *state).acceleration
        _, rate = state
        turning = rate[3]
        drift = [rate[0] + turning * values[1], rate[1] - turning * values[0]]
        return np.array([*drift, values[4], values[5], a[LEAN], a[STEER], a[REAR_ANGLE]])

    for j in range(7):
        e = np.eye(7)[j]
        slopes = [(field(v + h * e) - field(v - h * e)) / (2 * h) for h in (2e-3, 1e-3)]
        # Left after extrapolation: h^4 times fifth derivatives (some 1e4), and round-off 1e-13 / h.
        assert np.allclose((4 * slopes[1] - slopes[0]) / 3, jacobian[:, j], rtol=0, atol=1e-7)
