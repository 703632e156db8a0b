"""Defects of the library that the suite works around: as long as these tests pass, it needs to."""

from __future__ import annotations

import runpy
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from velodrome.engines.engine import Problem
from velodrome.engines.exudyn.engine import BUILTIN
from velodrome.engines.exudyn.solve import no_progress
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state
from velodrome.reference.simulate import simulate
from velodrome.reference.surface import Plane

SCRIPT = SimpleNamespace(
    **runpy.run_path(str(Path(__file__).parents[2] / "examples" / "exudyn_contact_forces.py"), run_name="example")
)
SPIN = SCRIPT.precession()[1]  # of the disc [rad/s], its fastest rate
FIXED = f"Exudyn {version('exudyn')} has mended this: drop what works around it"


def disc(solver, step, *rest, **options) -> np.ndarray:
    with no_progress():
        return SCRIPT.disc_force(solver, step, 0.2, *rest, **options)


def test_initial_accelerations_omit_a_term_of_rolling() -> None:
    """The first contact force of the library's own disc is wrong by W (W q')_q q', 16 % of it."""
    error = disc(SCRIPT.SOLVERS.GeneralizedAlpha, 4e-3, 0.8)
    assert error[0] == pytest.approx(0.16, abs=0.01), FIXED


def test_the_trapezoidal_rule_never_forgets_it() -> None:
    """At any step the force alternates by the initial error, changed by k h only, about what is constant."""
    for step in (4e-3, 1e-3):
        error = disc(SCRIPT.SOLVERS.TrapezoidalIndex2, step)
        np.testing.assert_allclose(error, error[0], rtol=SPIN * step, err_msg=FIXED)


def test_a_spectral_radius_below_one_forgets_it() -> None:
    """Within a tenth of a second, by the radius in every step: 0.8^100 at 1 ms, with growth by the steps' number."""
    error = disc(SCRIPT.SOLVERS.GeneralizedAlpha, 1e-3, 0.8)
    assert error[100:].max() < error[0] * 0.8**100 * 100**2 + (SPIN * 1e-3) ** 2


def test_imported_accelerations_cure_it() -> None:
    """Newton's method leaves 1e-10 of forces that one step's square makes of positions; the method (k h)^2."""
    error = disc(SCRIPT.SOLVERS.TrapezoidalIndex2, 1e-3, right_start=True)
    assert error[1:].max() < (SPIN * 1e-3) ** 2


def test_first_steps_of_generalized_alpha_are_of_first_order() -> None:
    """The library starts from what it was given: a pendulum's reaction is off by O(h), later by O(h^2)."""
    with no_progress():
        coarse, fine = (SCRIPT.pendulum_force(step, 1.0, 0.8) for step in (2e-3, 1e-3))
    fastest = 8.0  # the bar's first swing [rad/s]
    assert coarse[:11].max() / fine[:11].max() == pytest.approx(2, rel=3 * fastest * 2e-3), FIXED
    assert coarse[-2:].max() / fine[-2:].max() == pytest.approx(4, rel=3 * fastest * 2e-3)


def test_the_library_s_discs_give_wrong_forces_on_the_bicycle_at_any_step() -> None:
    q, qd = consistent_state(Bicycle(), Plane(), (0.986, 2.148), 0.7, 2.83, (0.1, 0.0, 18.0))
    problem = Problem(Bicycle(), Plane(), q, qd, np.arange(11) / 10)
    exact = simulate(problem.bicycle, problem.surface, q, qd, problem.times).force
    for step in (4e-3, 2e-3):
        settings = BUILTIN.settings.model_validate({"step": step, "solver": "trapezoidal-index2"})
        force = BUILTIN.simulate(problem, settings, lambda _time: None).contact_force
        assert force is not None
        error = (np.linalg.norm(force - exact, axis=2) / np.linalg.norm(exact, axis=2)).max(axis=1)
        assert error.min() > 0.1, FIXED
