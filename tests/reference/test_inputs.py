"""Steer torque, rear-wheel torque and steer damping in the equations of motion, circular motions and eigenvalues."""

from dataclasses import astuple, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.literature import published
from velodrome.reference.anchors import start_on_plane
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.circular import FORCE, SIGMA, CircularMotion, Steady
from velodrome.reference.contact import observe
from velodrome.reference.dae import consistent_state, contact_parameters, dynamics, mass_matrix
from velodrome.reference.families import find_motion, trace_all
from velodrome.reference.inputs import NO_INPUTS, Inputs
from velodrome.reference.kernels import lean
from velodrome.reference.kernels.pose import aligned
from velodrome.reference.kinematics import LEAN, REAR_ANGLE, STEER, constants
from velodrome.reference.modes import MODES, follow_modes
from velodrome.reference.simulate import simulate, simulate_modified_euler
from velodrome.reference.stability import linearise
from velodrome.reference.surface import Paraboloid, Plane, Surface
from velodrome.reference.upright import CanonicalMatrices, canonical_matrices, stability_changes

BICYCLE = Bicycle()
BOWL = Paraboloid(0.005)
PETERSON = published("peterson")
# The source's steer is positive to the right.
TURN = Inputs(steer_torque=-PETERSON["steer_torque"])
ROUND_OFF = 2.0**-52

states = st.fixed_dictionaries(
    {
        "position": st.tuples(st.floats(-1, 1), st.floats(-1, 1)),
        "lean": st.floats(-0.9, 0.9),
        "steer": st.floats(-1.5, 1.5),
        "rates": st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(-30, 30)),
    }
)
inputs_of_any_size = st.builds(Inputs, st.floats(-10, 10), st.floats(-50, 50), st.floats(0, 10))


@pytest.mark.parametrize("name", ["steer_torque", "rear_wheel_torque", "steer_damping"])
@pytest.mark.parametrize("value", [np.nan, np.inf, "1", None, True, [1.0]])
def test_an_input_that_is_no_finite_number_is_refused(name: str, value: Any) -> None:
    with pytest.raises(ValueError, match=rf"^{name} is .*; it must be a finite number$"):
        Inputs(**{name: value})


def test_damping_that_drives_is_refused() -> None:
    with pytest.raises(ValueError, match=r"^steer_damping is -0\.1; it must not be negative$"):
        Inputs(steer_damping=-0.1)


def test_inputs_say_what_they_are() -> None:
    assert Inputs(-0.0, 0, 0.5).describe() == "steer_damping 0.5 N m s/rad"
    assert Inputs(-0.0, 0, 0) == NO_INPUTS
    assert str(Inputs(-0.0)) == str(NO_INPUTS)


@pytest.mark.parametrize("surface", [Plane(), Paraboloid(0.2)])
@given(state=states, inputs=inputs_of_any_size)
def test_energy_changes_by_the_power_of_the_inputs(surface: Surface, state: dict, inputs: Inputs) -> None:
    """dE/dt = T_s steer' + T_r rear' - c steer'^2, with dE/dt from the derivative of the energy along the motion.

    The change by the inputs is qd . M (qdd - qdd without), since the conservative part has no power.
    """
    q, qd = consistent_state(BICYCLE, surface, **state)
    driven, free = (dynamics(BICYCLE, surface, q, qd, held).acceleration for held in (inputs, NO_INPUTS))
    momentum = mass_matrix(BICYCLE, q) @ qd
    damped = inputs.steer_damping * qd[STEER] ** 2
    power = inputs.steer_torque * qd[STEER] + inputs.rear_wheel_torque * qd[REAR_ANGLE] - damped
    # Round-off of the accelerations, which are of the size of the rates squared times the condition of the equations.
    size = float(np.abs(momentum) @ (np.abs(free) + np.abs(driven)))
    assert abs(momentum @ (driven - free) - power) <= 1e4 * ROUND_OFF * (1 + size)


@pytest.mark.parametrize("surface", [Plane(), Paraboloid(0.2)])
@given(state=states, inputs=inputs_of_any_size)
def test_both_right_hand_sides_have_the_same_inputs(surface: Surface, state: dict, inputs: Inputs) -> None:
    q, qd = consistent_state(BICYCLE, surface, **state)
    y = np.concatenate([q, qd, contact_parameters(BICYCLE, surface, q)])
    full = dynamics(BICYCLE, surface, q, qd, inputs)
    where = (surface.function.real, surface.parameters, aligned(constants(BICYCLE, inputs)))
    out, force = np.empty(24), np.empty(6)
    lean.derivative(y, *where, out)
    lean.contact_forces(y, *where, force)
    # As without inputs (`test_lean`): order times round-off times a condition of up to 1e6 here.
    accelerations, forces = (1 + np.abs(part).max() for part in (full.acceleration, full.force))
    assert np.abs(out[9:18] - full.acceleration).max() <= 1e-9 * accelerations
    assert np.abs(force.reshape(2, 3) - full.force).max() <= 1e-9 * forces


def test_a_positive_torque_on_the_rear_wheel_drives_forward_and_one_on_the_steering_turns_left() -> None:
    q, qd = consistent_state(BICYCLE, Plane(), (0.0, 0.0), 0.0, 0.0, (0.0, 0.0, 15.0))
    driven = dynamics(BICYCLE, Plane(), q, qd, Inputs(rear_wheel_torque=1.0)).acceleration
    # Straight ahead the bicycle is a mass with two rolling wheels: torque = inertia at the rear wheel x acceleration.
    radius = BICYCLE.rear_wheel_radius
    turned = BICYCLE.front_wheel_Iyy * (radius / BICYCLE.front_wheel_radius) ** 2
    inertia = BICYCLE.mass * radius**2 + BICYCLE.rear_wheel_Iyy + turned
    assert driven[REAR_ANGLE] == pytest.approx(1 / inertia, rel=1e-12)
    assert driven[0] == pytest.approx(radius / inertia, rel=1e-12)
    steered = dynamics(BICYCLE, Plane(), q, qd, Inputs(steer_torque=1.0)).acceleration
    # Meijaard et al. (2007), Eq. (5.3), right positive there.
    expected = np.linalg.solve(canonical_matrices(BICYCLE).M, [0.0, -1.0])
    assert steered[LEAN] == pytest.approx(expected[0], rel=1e-12)
    assert steered[STEER] == pytest.approx(-expected[1], rel=1e-12)


@pytest.mark.parametrize("run", [simulate, simulate_modified_euler])
def test_both_integrators_ride_with_inputs(run: Any) -> None:
    """The energy's change is the work of the torques, exactly up to the integrator's error."""
    q, qd = consistent_state(BICYCLE, Plane(), (0.0, 0.0), 0.05, 0.1, (0.2, 0.0, 16.0))
    inputs = Inputs(steer_torque=0.3, rear_wheel_torque=5.0)
    ride = run(BICYCLE, Plane(), q, qd, np.linspace(0, 1, 11), inputs=inputs)
    seen = observe(BICYCLE, Plane(), ride.q, ride.qd)
    change = np.diff((seen.kinetic_energy + seen.potential_energy)[[0, -1]])[0]
    work = 0.3 * (ride.q[-1, STEER] - q[STEER]) + 5.0 * (ride.q[-1, REAR_ANGLE] - q[REAR_ANGLE])
    # Heun's error in a second is some h^2 = 1e-6 of the energy of a kilojoule.
    assert abs(change - work) <= (1e-9 if run is simulate else 1e-2)
    assert work > 50


# Rows in units of the weight are known to some 1e-15; the torque is one of them times the weight of 922 N.
TORQUE_ERROR = 4e-12


def test_petersons_steady_turn_needs_the_published_torque() -> None:
    """At the published angles rolling fixes the directions of the speeds; speed, torque and forces fit the dynamics."""
    angles = PETERSON["lean"], -PETERSON["steer"]
    free, unit = Steady(BICYCLE, Plane()), Steady(BICYCLE, Plane(), Inputs(steer_torque=1.0))
    u = start_on_plane(BICYCLE, *angles)
    linear = [SIGMA, *range(FORCE.start, FORCE.stop)]
    u[linear] = 0.0
    rest = free.residual(u)[:9]
    columns = np.column_stack([free.jacobian(u)[:9, linear], unit.residual(u)[:9] - rest])
    found, _, rank, _ = np.linalg.lstsq(columns, -rest, rcond=None)
    assert rank == 8
    assert np.abs(columns @ found + rest).max() < 1e-14
    assert abs(found[-1] - TURN.steer_torque) < TORQUE_ERROR
    u[linear] = found[:-1]
    assert abs(free.motion(u).front_rate - PETERSON["front_rate"]) < 1e-11


def petersons_turn() -> CircularMotion:
    angles = PETERSON["lean"], -PETERSON["steer"]
    equations = Steady(BICYCLE, Plane(), TURN)
    guess = equations.motion(start_on_plane(BICYCLE, *angles, TURN))
    family, motion = find_motion(BICYCLE, Plane(), guess.rear_rate, near=(0.0873, -0.025), inputs=TURN)
    assert family is None
    return motion


def test_petersons_steady_turn_is_found_with_its_torque_held() -> None:
    motion = petersons_turn()
    found = (motion.lean, motion.steer, motion.front_rate, motion.front_rate * BICYCLE.front_wheel_radius)
    expected = (PETERSON["lean"], -PETERSON["steer"], PETERSON["front_rate"], PETERSON["front_speed"])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
    assert motion.residual < 1e-12
    # The equation that is left out of those that are solved holds as well.
    now = dynamics(BICYCLE, Plane(), *motion.state(), TURN).acceleration
    assert np.abs(now[[LEAN, STEER, REAR_ANGLE]]).max() < 1e-10


def test_a_torque_to_the_other_side_gives_the_mirrored_turn() -> None:
    motion = petersons_turn()
    mirrored = find_motion(
        BICYCLE, Plane(), motion.rear_rate, near=(-motion.lean, -motion.steer), inputs=Inputs(-TURN.steer_torque)
    )[1]
    for name, sign in (("lean", -1), ("steer", -1), ("pitch", 1), ("yaw_rate", -1), ("front_rate", 1)):
        assert getattr(mirrored, name) == pytest.approx(sign * getattr(motion, name), rel=1e-11, abs=1e-13)


def test_a_torque_that_vanishes_leads_to_the_hands_free_motion() -> None:
    """The change is linear in the torque: of two small torques it is twice for twice the torque."""
    _, free = find_motion(BICYCLE, BOWL, 18.0, 2, (0.74, 2.84))
    lean_of = [
        find_motion(BICYCLE, BOWL, 18.0, near=(free.lean, free.steer), inputs=Inputs(size))[1].lean - free.lean
        for size in (1e-6, 2e-6)
    ]
    assert lean_of[0] != 0
    # The second-order term is some ten times the torque; motions are known to 1e-13.
    assert lean_of[1] / lean_of[0] == pytest.approx(2, rel=1e-4)


def test_families_and_rear_torques_are_refused_with_the_reason() -> None:
    with pytest.raises(ValueError, match=r"families are numbered by their hands-free motions; with steer_torque 0.1 N"):
        find_motion(BICYCLE, BOWL, 18.0, 2, (0.74, 2.84), Inputs(0.1))
    driven = Inputs(rear_wheel_torque=0.1)
    for refused in (
        lambda: find_motion(BICYCLE, BOWL, 18.0, 2, inputs=driven),
        lambda: trace_all(BICYCLE, BOWL, inputs=driven),
        lambda: Steady(BICYCLE, Plane(), driven),
    ):
        with pytest.raises(ValueError, match=r"no circular motion exists with a rear-wheel torque of 0.1 N m"):
            refused()


def test_damping_changes_the_eigenvalues_of_a_circle_and_not_the_circle() -> None:
    damped = Inputs(steer_damping=1.0)
    number, motion = find_motion(BICYCLE, BOWL, 18.0, 2, (0.74, 2.84), damped)
    _, free = find_motion(BICYCLE, BOWL, 18.0, 2, (0.74, 2.84))
    assert number == 2
    assert motion.state()[0].tolist() == free.state()[0].tolist()
    values = linearise(BICYCLE, BOWL, *motion.state(), damped).eigenvalues
    hands_free = linearise(BICYCLE, BOWL, *motion.state()).eigenvalues
    # The family's zero stays. The sum of all eigenvalues, a trace, falls by d steer'' / d torque times the damping.
    assert np.abs(values).min() < 1e-10
    pushed, free_of = (dynamics(BICYCLE, BOWL, *motion.state(), held) for held in (Inputs(steer_torque=1.0), NO_INPUTS))
    falls = pushed.acceleration[STEER] - free_of.acceleration[STEER]
    assert falls > 0.1
    assert np.sum(hands_free - values).real == pytest.approx(falls, rel=1e-10)


@pytest.mark.parametrize("damping", [0.0, 0.4, 3.0])
@pytest.mark.parametrize("speed", [0.5, 4.0, 7.0])
def test_eigenvalues_of_the_damped_upright_bicycle_are_those_of_the_canonical_matrices(
    damping: float, speed: float
) -> None:
    rates = (0.0, 0.0, speed / BICYCLE.rear_wheel_radius)
    state = consistent_state(BICYCLE, Plane(), (0.0, 0.0), 0.0, 0.0, rates)
    jacobian = linearise(BICYCLE, Plane(), *state, Inputs(steer_damping=damping)).jacobian
    block = np.ix_([2, 3, 4, 5], [2, 3, 4, 5])
    found = np.sort_complex(np.linalg.eigvals(jacobian[block]))
    expected = np.sort_complex(canonical_matrices(BICYCLE, damping).eigenvalues(speed)[0])
    # Simple eigenvalues of size 10 with condition numbers of some tens.
    assert np.abs(found - expected).max() < 1e-11


@pytest.mark.parametrize("damping", [0.0, 0.5, 2.0])
def test_stability_of_the_damped_upright_bicycle_changes_at_the_solved_speeds(damping: float) -> None:
    matrices = canonical_matrices(BICYCLE, damping)
    changes = stability_changes(matrices)
    assert [change.mode for change in changes] == ["weave", "capsize"]
    for change in changes:
        before, after = (_mode_growth(matrices, change.mode, change.speed * (1 + d)) for d in (-1e-6, 1e-6))
        assert (before > 0) == change.stabilises
        assert (after > 0) != change.stabilises
    # Damping does nothing at a zero eigenvalue.
    undamped = stability_changes(canonical_matrices(BICYCLE))
    assert changes[1].speed == pytest.approx(undamped[1].speed, rel=1e-12)
    assert (changes[0].speed > undamped[0].speed) == (damping > 0)


def _mode_growth(matrices: CanonicalMatrices, mode: str, speed: float) -> float:
    values = matrices.eigenvalues(speed)[0]
    chosen = values[np.imag(values) > 0.1] if mode == "weave" else values[np.abs(np.imag(values)) < 1e-9]
    return float(np.real(chosen).max())


@pytest.mark.slow
def test_curves_under_a_steer_torque_have_no_numbers_and_hold_the_torque() -> None:
    surface, held = Paraboloid(0.005), Inputs(steer_torque=0.5)
    curves, absent = trace_all(BICYCLE, surface, 0.1, held)
    assert curves
    assert set(absent) == {1, 2, 3, 4}
    for curve in curves:
        assert curve.numbers == ()
        for point in curve.points[:: max(1, len(curve.points) // 10)]:
            motion = curve.equations.motion(point.unknowns)
            now = dynamics(BICYCLE, surface, *motion.state(), held).acceleration
            assert np.abs(now[[LEAN, STEER, REAR_ANGLE]]).max() < 1e-8 * (1 + motion.rear_rate**2 + motion.yaw_rate**2)
    # Left and right differ: both signs of the steer are there, and no curve is another's mirror image.
    steers = np.concatenate([[point.unknowns[5] for point in curve.points] for curve in curves])
    assert steers.min() < 0 < steers.max()


@pytest.mark.slow
def test_modes_of_a_damped_family_are_followed() -> None:
    curves, _ = trace_all(BICYCLE, BOWL, 0.1, Inputs(steer_damping=0.5))
    assert [curve.number for curve in curves][:4] == [1, 2, 3, 4]
    rows = follow_modes(curves[0])
    assert rows.shape == (len(curves[0].points), len(MODES))
    for k in (3, len(rows) // 2):
        motion = curves[0].equations.motion(curves[0].points[k].unknowns)
        values = linearise(BICYCLE, BOWL, *motion.state(), Inputs(steer_damping=0.5)).eigenvalues
        np.testing.assert_allclose(np.sort_complex(rows[k]), np.sort_complex(values), rtol=0, atol=1e-6)


def test_inputs_enter_the_constants_as_they_are() -> None:
    inputs = Inputs(1.0, 2.0, 3.0)
    assert constants(BICYCLE, inputs)[-3:] == astuple(inputs)
    assert constants(BICYCLE, inputs)[:-3] == constants(BICYCLE)[:-3]
    assert constants(replace(BICYCLE), NO_INPUTS) is constants(BICYCLE, NO_INPUTS)
