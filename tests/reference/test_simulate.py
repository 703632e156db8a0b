import numpy as np
import pytest

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.contact import observe
from velodrome.reference.dae import consistent_state
from velodrome.reference.families import find_motion
from velodrome.reference.kinematics import LEAN, YAW
from velodrome.reference.simulate import PreciseMotion, simulate, simulate_modified_euler, steps_per_output
from velodrome.reference.stability import linearise
from velodrome.reference.surface import Paraboloid, Plane

BICYCLE = Bicycle()
BOWL = Paraboloid(0.005)
TIMES = np.arange(2001) / 100


def q2(lean_rate: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    _, motion = find_motion(BICYCLE, Paraboloid(0.005), 18.0, 2)
    q, _ = motion.state()
    return consistent_state(BICYCLE, BOWL, (q[0], q[1]), q[4], q[6], (lean_rate, 0.0, 18.0), guess=(q[2], q[5]))


@pytest.fixture(scope="module")
def q2_plus() -> PreciseMotion:
    return simulate(BICYCLE, BOWL, *q2(0.1), TIMES)


def test_energy_gaps_and_rolling_are_kept(q2_plus: PreciseMotion) -> None:
    seen = observe(BICYCLE, BOWL, q2_plus.q, q2_plus.qd)
    energy = seen.kinetic_energy + seen.potential_energy
    assert np.abs(energy / energy[0] - 1).max() <= 1e-11
    assert np.abs(seen.gap).max() <= 1e-12
    assert np.abs(seen.slip).max() <= 1e-11


def test_constraints_are_kept_whatever_the_tolerance() -> None:
    """Steps and outputs are projected: a coarse motion is wrong, but it rolls."""
    coarse = simulate(BICYCLE, BOWL, *q2(0.1), TIMES, tolerance=1e-5)
    seen = observe(BICYCLE, BOWL, coarse.q, coarse.qd)
    assert np.abs(seen.gap).max() <= 1e-12
    assert np.abs(seen.slip).max() <= 1e-11


def test_two_tolerances_agree(q2_plus: PreciseMotion) -> None:
    loose = simulate(BICYCLE, BOWL, *q2(0.1), TIMES, tolerance=1e-11)
    assert np.linalg.norm(loose.q[:, :3] - q2_plus.q[:, :3], axis=1).max() <= 1e-9
    assert np.abs(loose.force - q2_plus.force).max() <= 1e-6


def test_error_follows_the_tolerance(q2_plus: PreciseMotion) -> None:
    """The error of an order-8 method is about proportional to its tolerance."""
    errors = []
    for tolerance in (1e-8, 1e-9, 1e-10, 1e-11):
        motion = simulate(BICYCLE, BOWL, *q2(0.1), TIMES[::50], tolerance=tolerance)
        errors.append(np.abs(motion.q[:, :7] - q2_plus.q[::50, :7]).max())
    slope = np.polyfit(np.log(np.logspace(-8, -11, 4)), np.log(errors), 1)[0]
    # Error per unit tolerance ~ tol^(p/(p+1)) / h ~ between tol^(7/8) and tol^(9/8).
    assert 0.85 < slope < 1.15


def test_the_papers_integrator_converges_with_order_two(q2_plus: PreciseMotion) -> None:
    errors = []
    for step in (2e-3, 1e-3, 5e-4):
        motion = simulate_modified_euler(BICYCLE, BOWL, *q2(0.1), TIMES, step)
        errors.append(np.linalg.norm(motion.q[:, :3] - q2_plus.q[:, :3], axis=1).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    # e = C h^2 (1 + c h): the leading correction to the order is c h / ln 2, measured to halve.
    assert np.abs(orders - 2).max() < 0.05
    assert abs(orders[1] - 2) < abs(orders[0] - 2)


def test_the_paper_s_stable_motion_stays_and_the_unstable_one_leaves() -> None:
    _, q1 = find_motion(BICYCLE, Paraboloid(0.005), 18.0, 1)
    state = q1.state()
    rate = linearise(BICYCLE, BOWL, *state).eigenvalues[-1].real
    kicked = consistent_state(
        BICYCLE,
        BOWL,
        tuple(q1.position[:2]),
        q1.lean + 1e-6,
        q1.steer,
        (0.0, 0.0, 18.0),
        guess=(q1.position[2], q1.pitch),
    )
    leaving = simulate(BICYCLE, BOWL, *kicked, TIMES)
    error = np.abs(leaving.q[:, LEAN] - q1.lean)
    # Once the decaying modes are gone the growth is that of the unstable eigenvalue; what is left of
    # them and the nonlinearity (1e-6 e^(0.38 t) stays below 1e-3) are small against 2 %.
    late = slice(1000, 1500)
    slope = np.polyfit(TIMES[late], np.log(error[late]), 1)[0]
    assert slope == pytest.approx(rate, rel=0.02)
    staying = simulate(BICYCLE, BOWL, *q2(0.1), TIMES)
    assert np.abs(staying.q[:, LEAN] - q2()[0][LEAN]).max() < 0.05


def test_a_turned_start_gives_the_turned_ride() -> None:
    """The bowl is a surface of revolution: turning the start about z turns everything."""
    angle = 1.1
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    q, qd = q2(0.1)
    other, other_rate = q.copy(), qd.copy()
    other[:3], other_rate[:3], other[YAW] = turn @ q[:3], turn @ qd[:3], q[YAW] + angle
    straight = simulate(BICYCLE, BOWL, q, qd, TIMES[:501])
    turned = simulate(BICYCLE, BOWL, other, other_rate, TIMES[:501])
    # Both carry the integrator's error, some 1e-12 (tolerance 1e-13, five hundred steps at the most).
    assert np.abs(turned.q[:, :3] - straight.q[:, :3] @ turn.T).max() < 5e-11
    assert np.abs(turned.force - straight.force @ turn.T).max() < 1e-7


def test_the_mirrored_start_gives_the_mirrored_ride() -> None:
    q, qd = consistent_state(BICYCLE, Plane(), (0.0, 0.0), 0.1, 0.2, (0.3, -0.1, 16.0))
    mirror = np.array([1, -1, 1, -1, -1, 1, -1, 1, 1])
    left = simulate(BICYCLE, Plane(), q, qd, TIMES[:301])
    right = simulate(BICYCLE, Plane(), q * mirror, qd * mirror, TIMES[:301])
    assert np.abs(left.q - right.q * mirror).max() < 1e-10


@pytest.mark.parametrize(("speed", "lean_rate"), [(4.0, 0.05), (4.6, 0.5), (8.0, 0.05)])
def test_iftomm_benchmark_keeps_its_energy(speed: float, lean_rate: float) -> None:
    """Uncontrolled bicycle: 100 (Emax - Emin) / E0 < 1e-3 is asked; the reference keeps round-off."""
    rates = (lean_rate, 0.0, speed / BICYCLE.rear_wheel_radius)
    motion = simulate(BICYCLE, Plane(), *consistent_state(BICYCLE, Plane(), (0.0, 0.0), 0.0, 0.0, rates), TIMES)
    seen = observe(BICYCLE, Plane(), motion.q, motion.qd)
    energy = seen.kinetic_energy + seen.potential_energy
    assert 100 * np.ptp(energy) / energy[0] < 1e-9


def test_a_small_lean_follows_the_linear_modes() -> None:
    """At 4.6 m/s upright a small disturbance moves like exp(J t): error quadratic in its size."""
    speed, times = 4.6, TIMES[:201]
    rates = (0.0, 0.0, speed / BICYCLE.rear_wheel_radius)
    jacobian = linearise(BICYCLE, Plane(), *consistent_state(BICYCLE, Plane(), (0.0, 0.0), 0.0, 0.0, rates)).jacobian
    block = jacobian[2:6, 2:6]
    values, vectors = np.linalg.eig(block)
    deviations = []
    for size in (1e-3, 1e-4):
        start = consistent_state(BICYCLE, Plane(), (0.0, 0.0), 0.0, 0.0, (size, 0.0, rates[2]))
        motion = simulate(BICYCLE, Plane(), *start, times)
        weights = np.linalg.solve(vectors, np.array([0, 0, size, 0], complex))
        linear = (vectors[0] * weights * np.exp(np.outer(times, values))).sum(axis=1).real
        deviations.append(np.abs(motion.q[:, LEAN] - linear).max() / size)
    # Left-right symmetry leaves no quadratic term: relative deviation ~ size^2.
    assert deviations[0] < 1e-3
    assert deviations[1] < 1.5e-2 * deviations[0]


def test_a_fall_ends_with_a_reason() -> None:
    q, qd = consistent_state(BICYCLE, Plane(), (0.0, 0.0), 0.3, 0.0, (1.0, 0.0, 2.0))
    motion = simulate(BICYCLE, Plane(), q, qd, TIMES, tolerance=1e-8)
    assert motion.ended is not None
    assert len(motion.time) == len(motion.q) == len(motion.force) < len(TIMES)
    assert np.all(np.isfinite(motion.q))


def test_progress_is_told() -> None:
    seen: list[float] = []
    simulate(BICYCLE, BOWL, *q2(0.1), np.array([0.0, 30.0]), progress=seen.append)
    assert len(seen) > 1
    assert seen == sorted(seen)
    assert seen[-1] == 30.0


@pytest.mark.parametrize(
    ("times", "step", "words"),
    [
        (np.arange(11) / 100, 3e-3, "0.0025 s would"),
        (np.array([0.1, 0.2]), 1e-3, "starts at 0"),
        (np.array([0.0, 0.1, 0.15]), 1e-3, "evenly spaced"),
        (np.arange(11) / 100, 0.02, "does not divide"),
    ],
)
def test_grids_that_a_step_does_not_meet_are_refused(times: np.ndarray, step: float, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        steps_per_output(times, step)
