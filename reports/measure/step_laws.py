"""Where a method's fixed step moves the end of a stable section, predicted from the equations of motion alone.

There are laws for the methods whose step is known: the paper's modified Euler method, generalized alpha on bodies with
true constraints, and the Runge-Kutta method of order 4 on MuJoCo's tree under the forces of rolling.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...engines.engine import Settings
from ...engines.exudyn.method import generalized_alpha
from ...engines.exudyn.settings import ExudynSettings
from ...engines.lagrange import LagrangeSettings
from ...engines.mujoco.settings import MultiplierSettings
from ...reference.bifurcations.hopf import HopfPoint
from ...reference.bifurcations.paper_steps import solve_modified_euler_circle
from ...reference.bifurcations.second_order_error import SecondOrderMethod, second_order_error
from ...reference.bifurcations.small_orbits import flow_near
from ...reference.bifurcations.step_shift import eigenvalue_slope, shift_eigenvalue
from ...reference.bifurcations.tree_steps import solve_runge_kutta_circle
from ...reference.stability import independent


@dataclass(frozen=True)
class StepLaw:
    """Prediction for one step.

    Attributes
    ----------
    order : int
        Power of the step with which the shifts begin.
    eigenvalue : complex
        Change of the weave's eigenvalue at a circle of the Hopf point's rear rate, in the method's own rates [1/s].
    rear_rate : float
        Change of the rear rate at which the weave neither grows nor dies out, to first order in it [rad/s].
    """

    order: int
    eigenvalue: complex
    rear_rate: float


def predict_shift(point: HopfPoint, settings: Settings) -> StepLaw | None:
    """Predict what an engine's fixed step does to a Hopf point; None where no law is known for the settings.

    Parameters
    ----------
    point : HopfPoint
    settings : Settings
        Of the engine, with its step.

    Returns
    -------
    StepLaw or None
    """
    flow, (q, qd), weave = flow_near(point), point.motion.state(), 1j * point.frequency
    if isinstance(settings, LagrangeSettings) and settings.integrator == "modified-euler":
        order, found = 2, solve_modified_euler_circle(flow, q, qd, settings.step).nearest(weave) - weave
    elif isinstance(settings, MultiplierSettings) and settings.integrator == "RK4":
        circle = solve_runge_kutta_circle(flow, q, qd, settings.step, settings.stabilisation)
        order, found = 4, circle.nearest(weave) - weave
    elif isinstance(settings, ExudynSettings) and settings.solver == "generalized-alpha":
        order, found = 2, settings.step**2 * _shift_generalized_alpha(point, settings.spectral_radius)
    else:
        return None
    return StepLaw(order, found, -found.real / eigenvalue_slope(flow, q, qd, weave).real)


def _shift_generalized_alpha(point: HopfPoint, spectral_radius: float) -> complex:
    """Return the change of the weave's eigenvalue by generalized alpha over the squared step."""
    flow, (q, qd), weave = flow_near(point), point.motion.state(), 1j * point.frequency
    method = second_order_method(spectral_radius)
    shift = shift_eigenvalue(flow, q, qd, weave, lambda v: second_order_error(flow, v, method).field)
    # At the same rear rate in the method's own velocities, the wheel's angle turns slower by what these are ahead.
    ahead = second_order_error(flow, independent(q, qd), method).rear_rate
    return shift.eigenvalue - ahead * eigenvalue_slope(flow, q, qd, weave)


def second_order_method(spectral_radius: float) -> SecondOrderMethod:
    """Return the coefficients of generalized alpha's modified equation.

    With E the shift by a step and s = log E, the method's formulas are, in its auxiliary accelerations a,

        (E - 1) v = h (1 - gamma + gamma E) a,    (E - 1) x = h v + h^2 (1/2 - beta + beta E) a
        (1 - alpha_m) E a + alpha_m a = (1 - alpha_f) E A + alpha_f A

    from which v / x' and A / x'' follow as power series in s.
    """
    method = generalized_alpha(spectral_radius)
    alpha_f = spectral_radius / (spectral_radius + 1)
    velocity = 1 / 6 - method.shift / 2 - method.beta
    return SecondOrderMethod(velocity, 1 / 12 - method.beta - alpha_f * method.shift)
