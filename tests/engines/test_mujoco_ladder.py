"""MuJoCo's ladder of models against the reference: what each is worth, why, and where its floor lies."""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from dataclasses import replace
from functools import cache

import mujoco
import numpy as np
import pytest
from pydantic import ValidationError
from ripples import Ripples

from benchmarks.mujoco_settings.study import LADDER, drift_study, plain_step_cost
from velodrome.engines.engine import EngineError, Problem, Trajectory
from velodrome.engines.lagrange import ENGINE as REFERENCE
from velodrome.engines.mujoco import default, exact_contact, multipliers, native
from velodrome.engines.mujoco.edges import build_contacts
from velodrome.engines.mujoco.ride import set_start
from velodrome.engines.mujoco.settings import ExactContactSettings, MultiplierSettings
from velodrome.engines.mujoco.state import to_mujoco
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state
from velodrome.reference.families import find_motion
from velodrome.reference.kernels.dynamics import energies
from velodrome.reference.kinematics import constants
from velodrome.reference.stability import growth_rate, linearise
from velodrome.reference.surface import Paraboloid, Plane, Surface
from velodrome.reports.measure.friction import cone_is_left, required_friction
from velodrome.reports.measure.identify import identify

ROUND_OFF = 2.0**-52
# Circular motions: (alpha, rear rate, family, near). At 1/200 stable, at 1/20 and 1/5 unstable.
MOTIONS = {
    "1/200": (1 / 200, 18.0, 2, (0.74, 2.84)),
    "1/20": (1 / 20, 18.0, 2, None),
    "1/5": (1 / 5, 10.0, 1, (-0.42, 0.63)),
}


def every(interval: float, duration: float) -> np.ndarray:
    return np.arange(round(duration / interval) + 1) * interval


@cache
def motion(name: str, duration: float = 2.0) -> Problem:
    alpha, rear_rate, family, near = MOTIONS[name]
    _, found = find_motion(Bicycle(), Paraboloid(alpha), rear_rate, family, near)
    return Problem(Bicycle(), Paraboloid(alpha), *found.state(), every(0.1, duration))


@cache
def q2_plus(duration: float = 20.0) -> Problem:
    """Q2 with the lean rate raised by 0.1 rad/s."""
    problem = motion("1/200", duration)
    q, guess = problem.q, (float(problem.q[2]), float(problem.q[5]))
    where, lean, steer = (float(q[0]), float(q[1])), float(q[4]), float(q[6])
    state = consistent_state(problem.bicycle, problem.surface, where, lean, steer, (0.1, 0.0, 18.0), guess=guess)
    return replace(problem, q=state[0], qd=state[1])


def upright() -> Problem:
    rates = (0.0, 0.0, 4.6 / Bicycle().rear_wheel_radius)
    q, qd = consistent_state(Bicycle(), Plane(), (float(Bicycle().reference_point[0]), 0.0), 0.0, 0.0, rates)
    return Problem(Bicycle(), Plane(), q, qd, every(0.1, 0.2))


def run(engine, problem: Problem, **settings) -> Trajectory:
    return engine.ENGINE.simulate(problem, engine.ENGINE.settings(**settings), lambda t: None)


@cache
def exact(problem_of, *arguments) -> Trajectory:
    return REFERENCE.simulate(problem_of(*arguments), REFERENCE.settings(), lambda t: None)


def position_error(trajectory: Trajectory, reference: Trajectory) -> float:
    n = len(trajectory.time)
    return float(np.linalg.norm(trajectory.q[:, :3] - reference.q[:n, :3], axis=1).max())


def slip(trajectory: Trajectory) -> float:
    assert trajectory.slip is not None
    return float(np.linalg.norm(trajectory.slip, axis=2).max())


def gap(trajectory: Trajectory) -> float:
    assert trajectory.gap is not None
    return float(np.abs(trajectory.gap).max())


# ----------------------------------------------------------------------------------------------- the tree


def test_energies_of_the_tree_at_random_states() -> None:
    rng = np.random.default_rng(5)
    model, data = set_start(upright(), MultiplierSettings(), "nothing")
    for _ in range(50):
        angles = [rng.uniform(-9, 9), rng.uniform(-1.4, 1.4), *rng.uniform(-9, 9, 4)]
        q, qd = np.concatenate([rng.uniform(-3, 3, 3), angles]), rng.uniform(-5, 5, 9)
        data.qpos[:], data.qvel[:] = to_mujoco(q, qd)
        mujoco.mj_forward(model, data)
        mujoco.mj_energyPos(model, data)
        mujoco.mj_energyVel(model, data)
        kinetic, potential = energies(q, qd, constants(Bicycle()))
        # The potential passes zero: relative to the weight lifted by a metre.
        np.testing.assert_allclose(data.energy[1], kinetic, rtol=1e-12)
        np.testing.assert_allclose(data.energy[0], potential, rtol=1e-12, atol=1e-12 * 94 * 9.81)


# ----------------------------------------------------------------------------------------- exact multipliers


def test_multipliers_follow_the_reference_with_order_four() -> None:
    reference = exact(q2_plus)
    errors = [position_error(run(multipliers, q2_plus(), step=step), reference) for step in (0.005, 0.0025, 0.00125)]
    assert errors[1] < 1e-7
    assert min(np.log2(errors[0] / errors[1]), np.log2(errors[1] / errors[2])) > 3.5


def test_multipliers_give_the_reference_s_forces() -> None:
    """In the first sample they differ by round-off of the two solves, later by the ride's own error."""
    reference, trajectory = exact(q2_plus), run(multipliers, q2_plus())
    assert trajectory.contact_force is not None
    assert reference.contact_force is not None
    error = np.abs(trajectory.contact_force - reference.contact_force).max(axis=(1, 2))
    # The 6 x 6 of J M^-1 J^T has a condition of some 1e3, its solution a size of 1e3 N.
    assert error[0] < 1e3 * 1e3 * 10 * ROUND_OFF
    assert error.max() < 1e-4


def test_stabilisation_adds_nothing_on_the_constraints() -> None:
    """Whatever its rate: what it acts on are the gaps and slips that the method leaves, of its own order."""
    reference = exact(q2_plus)
    for rate in (0.0, 5.0, 50.0):
        assert position_error(run(multipliers, q2_plus(), stabilisation=rate), reference) < 1e-7


# -------------------------------------------------------------------------------------------- exact contact


def test_exact_contact_follows_the_reference() -> None:
    trajectory = run(exact_contact, q2_plus())
    assert trajectory.ended is None
    assert position_error(trajectory, exact(q2_plus)) < 1e-6
    assert slip(trajectory) < 1e-6


def test_order_of_exact_contact_is_that_of_the_integrator() -> None:
    """Until it meets its floor: from 10 to 5 ms the error falls by 2^4, as that of the multipliers does."""
    reference = exact(q2_plus)
    errors = [position_error(run(exact_contact, q2_plus(), step=step), reference) for step in (0.01, 0.005)]
    assert np.log2(errors[0] / errors[1]) > 3.5


def test_floor_is_the_softness_of_the_rows() -> None:
    """Slip = R F / b and gap = R F / k, with R = efc_R: what a rigid row would not need.

    The slip follows its force's changes at the rate b, and the bicycle those of the slip.
    """
    problem, settings = motion("1/200"), ExactContactSettings(softness=1.0)
    rig = build_contacts(problem, settings)
    with rig.callbacks():
        mujoco.mj_forward(rig.model, rig.data)
        softness, rates = rig.data.efc_R.copy(), rig.data.efc_KBIP.reshape(-1, 4).copy()
        rows = {rig.wheels[int(c.geom[1])]: c.efc_address for c in rig.data.contact}
    trajectory = run(exact_contact, problem, softness=1.0)
    assert trajectory.contact_force is not None
    assert trajectory.slip is not None
    assert trajectory.gap is not None
    for wheel, row in rows.items():
        force = trajectory.contact_force[-1, wheel]
        normal = np.array([0.0, 0.0, 1.0])  # the bowl is 1 in 50 steep here: a change of the split by 2 %
        pressure = force @ normal
        sideways = np.linalg.norm(force - pressure * normal)
        expected = softness[row + 1] * sideways / rates[row + 1, 1]
        depth = softness[row] * pressure / (rates[row, 0] * rates[row, 2])
        settling = 12.3 / rates[row, 1]  # of the motion's fastest mode against b
        assert abs(np.linalg.norm(trajectory.slip[-1, wheel]) / expected - 1) < 0.05 + settling
        assert abs(trajectory.gap[-1, wheel] / -depth - 1) < 0.05 + settling


def test_floor_moves_with_the_softness() -> None:
    """Error, slip and gap are linear in it; each power of ten moves the floor by one."""
    reference = exact(q2_plus)
    rides = [run(exact_contact, q2_plus(), softness=softness) for softness in (1.0, 1e-1, 1e-2)]
    for measure in (lambda ride: position_error(ride, reference), slip, gap):
        values = [measure(ride) for ride in rides]
        # RK4 itself leaves a slip of 1e-8 m/s at 2 ms, of 7e-7 here; the multipliers show as much.
        np.testing.assert_allclose([values[0] / values[1], values[1] / values[2]], 10, rtol=0.02)


def test_floor_moves_with_friction_and_with_the_contacts_rate() -> None:
    """Slip = R F / b with R by impratio and b by the time constant; gap = R F / k with k by its square.

    On a circle the slip turns with the bicycle at its yaw rate w while it follows at b: R F / sqrt(b^2 + w^2).
    """
    problem = motion("1/200")
    base, hard, slow = (
        run(exact_contact, problem, softness=1.0, **changed)
        for changed in ({}, {"impratio": 10.0}, {"time_constant": 0.1})
    )
    sizes = [np.linalg.norm(np.asarray(ride.slip)[-1], axis=1) for ride in (base, hard, slow)]
    depths = [np.asarray(ride.gap)[-1] for ride in (base, hard, slow)]
    # Of slips of 60 and 6 µm/s RK4's own are 0.01 µm/s.
    np.testing.assert_allclose(sizes[0] / sizes[1], 10, rtol=2e-3)
    b, w = 2 / (0.9999 * 0.05), float(problem.qd[3])
    np.testing.assert_allclose(sizes[2] / sizes[0], np.hypot(b, w) / np.hypot(b / 2, w), rtol=1e-3)
    np.testing.assert_allclose(depths[2] / depths[0], 4, rtol=1e-3)


def test_below_the_floor_no_step_helps() -> None:
    """With MuJoCo's own softness from 2 to 1 ms nothing changes; a hundredth of it, and the floor is a hundredth."""
    reference = exact(q2_plus, 5.0)
    errors = {
        (softness, step): position_error(run(exact_contact, q2_plus(5.0), softness=softness, step=step), reference)
        for softness, step in ((1.0, 0.002), (1.0, 0.001), (1e-2, 0.001))
    }
    np.testing.assert_allclose(errors[1.0, 0.002], errors[1.0, 0.001], rtol=0.02)
    np.testing.assert_allclose(errors[1.0, 0.001] / errors[1e-2, 0.001], 100, rtol=0.02)


@pytest.mark.parametrize(("softness", "impratio"), [(1.0, 1e6), (1e-3, 300.0), (1e-5, 100.0), (1e-5, 1e3)])
def test_hard_friction_gives_no_spikes(softness, impratio) -> None:
    """Forces are the reference's but for the softness, 0.07 N of MuJoCo's own, and round-off by the condition."""
    problem = replace(q2_plus(), times=every(0.01, 0.5))
    reference = REFERENCE.simulate(problem, REFERENCE.settings(), lambda t: None)
    settings = ExactContactSettings(softness=softness, impratio=impratio)
    trajectory = exact_contact.ENGINE.simulate(problem, settings, lambda t: None)
    error = np.abs(np.asarray(trajectory.contact_force) - np.asarray(reference.contact_force)).max()
    assert error < 0.1 * softness + 1e3 * ROUND_OFF * settings.condition + 1e-4


def test_exact_contact_repeats_bitwise_and_does_not_depend_on_output() -> None:
    for engine in (exact_contact, multipliers):
        problem = q2_plus(1.0)
        often, again = (run(engine, replace(problem, times=every(0.01, 1.0))) for _ in range(2))
        seldom = run(engine, problem)
        for name in ("q", "qd", "contact_force", "kinetic_energy"):
            np.testing.assert_array_equal(getattr(often, name), getattr(again, name))
        for name in ("qd", "contact_force"):
            np.testing.assert_array_equal(getattr(often, name)[::10], getattr(seldom, name))


@pytest.mark.parametrize("surface", [Plane(), Ripples(0.02)])
def test_any_surface(surface: Surface) -> None:
    """Two seconds of an uncontrolled ride: the same as the reference's to RK4's error and the rows' softness."""
    q, qd = consistent_state(Bicycle(), surface, (1.0, 0.5), 0.1, 0.05, (0.1, 0.0, 15.0), yaw=0.7)
    problem = Problem(Bicycle(), surface, q, qd, every(0.1, 2.0))
    reference = REFERENCE.simulate(problem, REFERENCE.settings(), lambda t: None)
    for engine in (multipliers, exact_contact):
        assert position_error(run(engine, problem), reference) < 1e-6


# ------------------------------------------------------------------------------------------------- modes


@pytest.mark.parametrize("engine", [multipliers, exact_contact])
def test_weave_eigenvalue(engine) -> None:
    """Meijaard et al. 2007, Table 2: -0.37797 + 3.87284i at 4.6 m/s (five digits)."""
    found = identify(engine.ENGINE, engine.ENGINE.settings(step=0.005), upright(), levels=2).eigenvalues
    weave = found[np.argmax(found.imag)]
    assert abs(weave - (-0.37796622642237 + 3.87284190914j)) < 1e-5
    assert abs(weave.real + 0.37797) < 1e-5
    assert abs(weave.imag - 3.87284) < 1e-5


# ------------------------------------------------------------------------------------ friction and falling


def test_exact_contact_slides_where_the_cone_is_left() -> None:
    """Q2 needs 0.959 on the front wheel, at any time; a thousandth less and it slides, as much more and it rolls."""
    problem, reference = motion("1/200"), exact(motion, "1/200")
    needed = required_friction(reference, problem.surface)
    # In a circular motion nothing changes; the reference's own error is the ride's.
    assert np.ptp(needed, axis=0).max() < 1e-9
    enough, short = needed.max() * 1.001, needed.max() * 0.999
    assert cone_is_left(enough, reference, problem.surface) is None
    assert cone_is_left(short, reference, problem.surface) == 0.0
    assert slip(run(exact_contact, problem, friction=enough)) < 1e-7
    # A thousandth of a force of 800 N on some 10 kg of effective mass: 0.08 m/s^2.
    assert slip(run(exact_contact, problem, friction=short)) > 1e-3


def test_required_friction_counts_pull_as_impossible() -> None:
    trajectory = exact(motion, "1/200")
    pulled = replace(trajectory, contact_force=-np.asarray(trajectory.contact_force))
    assert np.all(np.isinf(required_friction(pulled, motion("1/200").surface)))
    airborne = replace(trajectory, contact_force=np.zeros_like(trajectory.contact_force))
    assert np.all(required_friction(airborne, motion("1/200").surface) == 0)
    with pytest.raises(ValueError, match="no contact forces"):
        required_friction(replace(trajectory, contact_force=None), motion("1/200").surface)


def test_default_slides_for_want_of_friction_then_falls_by_creep() -> None:
    """On Q2: with a coefficient of 1 in a pyramid the front wheel slides at once; with 2 it still creeps and falls."""
    problem = replace(motion("1/200"), times=every(0.02, 1.0), beyond_fall=True)
    sliding, creeping, careful = (
        run(engine, problem, **settings)
        for engine, settings in ((default, {}), (default, {"friction": 2.0}), (native, {}))
    )
    sizes = [np.linalg.norm(np.asarray(ride.slip)[5, 1]) for ride in (sliding, creeping, careful)]
    assert sizes[0] > 1.0
    # v^2 / R is 12 m/s^2, b = 2 / (0.95 * 0.02 s); and soft friction of impratio 1 adds to it.
    assert 0.9 < sizes[1] / (12 * 0.95 * 0.02 / 2) < 2.0
    assert sizes[2] < 0.03
    # The rear frame's centre of mass, 0.9 m high at rest, is nearly on the ground, 3 cm up the bowl.
    low = sliding.body_position[:, 0, 2] < 0.12
    assert 0.3 < sliding.time[np.argmax(low)] < 0.7
    assert np.abs(creeping.q[:, 4] - problem.q[4]).max() < 0.5


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("engine", [multipliers, exact_contact])
def test_deviation_is_what_the_slip_left_can_grow_to(engine, name) -> None:
    """On stable and unstable circles: error <= slip (exp(growth t) - 1) / growth, in two seconds."""
    problem = motion(name)
    trajectory = run(engine, problem)
    assert trajectory.ended is None
    growth = growth_rate(
        problem.surface,
        linearise(problem.bicycle, problem.surface, problem.q, problem.qd).eigenvalues,
        float(problem.qd[3]),
    )
    # A stable circle's errors still follow along it: the circle that they change to goes at another rate.
    reach = 2.0 * 2.0 if growth <= 0 else np.expm1(growth * 2.0) / growth
    assert position_error(trajectory, exact(motion, name)) < slip(trajectory) * reach


@pytest.mark.parametrize("name", MOTIONS)
def test_every_model_starts(name) -> None:
    problem = replace(motion(name), times=every(0.1, 0.2))
    for engine in LADDER:
        trajectory = engine.simulate(problem, engine.settings(), lambda t: None)
        assert trajectory.ended is None
        np.testing.assert_allclose(trajectory.q[0], problem.q, rtol=0, atol=1e-14)


def test_fall() -> None:
    """The multipliers end where the rim comes to lie flat; a contact lets go, and the bicycle drops on."""
    q, qd = consistent_state(Bicycle(), Plane(), (0.1, 0.2), 0.05, 0.0, (0.0, 0.0, 3.0))
    for engine in (multipliers, exact_contact):
        trajectory = run(engine, Problem(Bicycle(), Plane(), q, qd, every(0.02, 4.0), beyond_fall=True))
        low = trajectory.body_position[:, 0, 2] < 0.09  # a tenth of its height
        assert 0.5 < trajectory.time[np.argmax(low)] < 3.0
        assert np.all(np.isfinite(trajectory.qd))
        if engine is multipliers:
            assert trajectory.ended is not None
            # Rigid rolling on a flat rim is singular: forces may grow without bound before.
            assert trajectory.ended.startswith(("a wheel lies flat or has no contact point", "MuJoCo's state became"))


@pytest.mark.parametrize("engine", [multipliers, exact_contact])
def test_start_without_contact_is_refused_and_an_interrupt_leaves_nothing(engine) -> None:
    problem = q2_plus(1.0)
    q = problem.q.copy()
    q[4] = np.pi / 2  # the rear wheel lies flat
    with pytest.raises(EngineError, match="no contact point"):
        run(engine, replace(problem, q=q, surface=Plane()))

    def interrupt(time: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        engine.ENGINE.simulate(problem, engine.ENGINE.settings(), interrupt)
    assert mujoco.get_mjcb_control() is None
    assert mujoco.get_mju_user_warning() is None


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"softness": 0.0}, "softness"),
        ({"impedance": (0.99999, 0.99999, 0.001, 0.5, 2.0)}, "no impedance may exceed 0.9999"),
        ({"time_constant": 0.003}, "at least twice the step"),
        ({"friction": -1.0}, "friction"),
        ({"stiffness": 1.0}, "stiffness"),
        ({"impratio": 1e6}, "with impratio 1000000.0 it must be at least 0.00022"),
        ({"softness": 1e-9, "impratio": 100.0}, "forces drown in round-off"),
    ],
)
def test_settings_are_checked(settings, message) -> None:
    with pytest.raises(ValidationError, match=message):
        ExactContactSettings.model_validate(settings)


# ------------------------------------------------------------------------------------------------ longer


@pytest.mark.slow
def test_cost_of_a_step() -> None:
    """Compiled callbacks: within a small factor of MuJoCo's own step of the same tree, in one run."""
    problem = replace(motion("1/200"), times=every(1.0, 10.0))
    budget = {"mujoco-native": 40e-6, "mujoco-exact-contact": 150e-6, "mujoco-multipliers": 80e-6}
    for engine in LADDER[1:]:
        trajectory = engine.simulate(problem, engine.settings(), lambda t: None)
        plain = plain_step_cost(problem, trajectory.settings["integrator"])
        cost = trajectory.cpu_time / trajectory.steps
        assert cost < budget[engine.name]
        # Four stages with a 3 x 9 Jacobian, its rate and a small solve each, beside a 9 x 9 tree.
        assert cost < 12 * plain


@pytest.mark.slow
def test_two_minutes() -> None:
    """Q2 for 120 s: the exact models stay on the circle, the native one loses height until it falls."""
    problem = replace(motion("1/200"), times=every(0.02, 120.0))
    rows = {row.engine: row for row in drift_study(problem)}
    for name, limit in (("mujoco-multipliers", 1e-10), ("mujoco-exact-contact", 5e-9)):
        row = rows[name]
        assert row.ridden == 120.0
        assert abs(row.radius.value) + row.radius.half_width < limit
    native_row = rows["mujoco-native"]
    assert 60.0 < native_row.ridden < 120.0
    assert native_row.radius.value + native_row.radius.half_width < 0
    assert native_row.energy.value + native_row.energy.half_width < 0
    assert rows["mujoco-default"].ridden < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("engine", [native, exact_contact, multipliers])
def test_verdict_on_stability(engine, name) -> None:
    """The growth rate that each model has itself, extrapolated to a step of zero, against the linearisation.

    At a step of 2 ms the native model has Q2's weave unstable: its verdict is right for small steps only.
    """
    problem = motion(name)
    true = linearise(problem.bicycle, problem.surface, problem.q, problem.qd).eigenvalues
    found = identify(engine.ENGINE, engine.ENGINE.settings(), problem, levels=3)
    expected = growth_rate(problem.surface, true, float(problem.qd[3]))
    own = growth_rate(problem.surface, found.eigenvalues, float(problem.qd[3]))
    assert (own > 0) == (expected > 0)
    # The identification's stencil leaves up to 2e-5 of an entry. Of a method of first order extrapolation
    # takes two powers of the step and leaves the product of spin and step at its three levels, 2 to 0.5 ms.
    first_order = 12.3 * (18.0 * 0.0005) * (18.0 * 0.001) * (18.0 * 0.002) if engine is native else 0.0
    assert abs(own - expected) < 2e-5 * max(1.0, abs(expected)) + first_order
