"""Eigenvalues identified from MuJoCo's models: exact contacts have the bicycle's, soft ones a creeping bicycle's."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from velodrome.engines.engine import Problem
from velodrome.engines.mujoco import default, exact_contact, multipliers, native
from velodrome.engines.mujoco.engine import MujocoEngine
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state
from velodrome.reference.families import find_motion
from velodrome.reference.stability import Linearisation, linearise
from velodrome.reference.surface import Paraboloid, Plane
from velodrome.reports.measure.identify import Identified, identify
from velodrome.reports.measure.precision import eigenvalue_pairs

# Meijaard et al. 2007, Table 2, at 4.6 m/s, with more digits from the linearised equations.
WEAVE = -0.37796622642237 + 3.87284190914j
MOTIONS: dict[str, tuple[int, tuple[float, float] | None]] = {"q1": (1, None), "q2": (2, (0.74, 2.84))}


@cache
def upright() -> Problem:
    rates = (0.0, 0.0, 4.6 / Bicycle().rear_wheel_radius)
    state = consistent_state(Bicycle(), Plane(), (0.0, 0.0), 0.0, 0.0, rates)
    return Problem(Bicycle(), Plane(), *state, np.array([0.0, 1.0]))


@cache
def circle(name: str) -> tuple[Problem, Linearisation]:
    family, near = MOTIONS[name]
    surface = Paraboloid(1 / 200)
    state = find_motion(Bicycle(), surface, 18.0, family, near)[1].state()
    return Problem(Bicycle(), surface, *state, np.array([0.0, 1.0])), linearise(Bicycle(), surface, *state)


def weave(engine: MujocoEngine[Any], levels: int = 2, **settings: Any) -> tuple[complex, Identified]:
    """The weave of the upright motion; of two levels the finer one's, of three their limit."""
    found = identify(engine, engine.settings(**settings), upright(), levels=levels)
    return complex(max(found.eigenvalues, key=lambda value: value.imag)), found


@pytest.mark.slow
def test_soft_contacts_shift_the_weave_in_proportion_to_their_time_constant() -> None:
    """Twice 1 / b, twice the shift: less damped and faster, since wheels that creep give way.

    What else there is: the integrator's own error, of the size of the step, and the next power of 1 / b; rates
    of 4 1/s against b = 210 and 420 1/s.
    """
    slow, fast = (
        weave(native.ENGINE, step=0.001, time_constant=constant, integrator="RK4")[0] - WEAVE
        for constant in (0.01, 0.005)
    )
    assert abs(slow / fast - 2) < 4 * 4.0 / 210
    assert fast.real > 0
    assert fast.imag > 0


def test_defaults_have_a_weave_of_their_own() -> None:
    """Their time constant of 20 ms stays when the step is halved, and so does the shift, by a twentieth of the rate."""
    coarse, fine = (weave(default.ENGINE, step=step)[0] - WEAVE for step in (0.004, 0.002))
    assert abs(fine) > 0.04 * abs(WEAVE)
    assert abs(coarse - fine) < 0.05 * abs(fine)


def test_contacts_of_two_steps_tend_to_the_published_weave() -> None:
    """At a step of zero b is infinite: first order, extrapolated by three levels up to (4 1/s * 2 ms)^3 of the rate."""
    found, whole = weave(native.ENGINE, levels=3)
    assert whole.order == pytest.approx(1, abs=0.05)
    assert abs(found - WEAVE) < (4.0 * 0.002) ** 3 * abs(WEAVE)


@pytest.mark.slow
@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("engine", [exact_contact.ENGINE, multipliers.ENGINE], ids=lambda engine: engine.name)
def test_exact_models_have_the_eigenvalues_of_the_bowl(engine: MujocoEngine[Any], name: str) -> None:
    """All seven; the stencil leaves up to 1e-6, and noise is divided by disturbances of 1e-3 and grows by e^4."""
    problem, exact = circle(name)
    found = identify(engine, engine.settings(), problem, levels=3)
    assert np.abs(eigenvalue_pairs(exact.eigenvalues, found.eigenvalues) - exact.eigenvalues).max() < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("name", MOTIONS)
def test_native_tends_to_the_eigenvalues_of_the_bowl(name: str) -> None:
    """First order in the step, since its time constant is two steps."""
    problem, exact = circle(name)
    found = identify(native.ENGINE, native.ENGINE.settings(), problem, levels=3)
    assert found.order == pytest.approx(1, abs=0.1)
    # The third power is left: the fastest mode, 13.4 1/s, at the three levels, 2, 1 and 0.5 ms.
    left = 13.4 * (18.0 * 0.002) * (18.0 * 0.001) * (18.0 * 0.0005)
    assert np.abs(eigenvalue_pairs(exact.eigenvalues, found.eigenvalues) - exact.eigenvalues).max() < left
