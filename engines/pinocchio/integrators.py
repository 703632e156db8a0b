"""Steps of fixed length on Pinocchio's configurations: Runge-Kutta's method, and the one of Pinocchio's examples."""

# pinocchio is an optional library whose compiled bindings carry no types.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

Accelerate = Callable[[np.ndarray, np.ndarray], np.ndarray]


def differentiate_configuration(configuration: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Return the derivative (10,) of a configuration (10,) with a unit quaternion, from the velocity (9,)."""
    x, y, z, w = configuration[3:7]
    wx, wy, wz = velocity[3:6]
    rates = np.empty(10)
    rates[:3] = pin.Quaternion(configuration[3:7]).toRotationMatrix() @ velocity[:3]
    rates[3:7] = (
        0.5 * (w * wx + y * wz - z * wy),
        0.5 * (w * wy + z * wx - x * wz),
        0.5 * (w * wz + x * wy - y * wx),
        -0.5 * (x * wx + y * wy + z * wz),
    )
    rates[7:] = velocity[6:]
    return rates


def normalise_quaternion(configuration: np.ndarray) -> np.ndarray:
    """Return a configuration whose quaternion has unit length."""
    unit = configuration.copy()
    unit[3:7] /= np.linalg.norm(unit[3:7])
    return unit


def step_rk4(
    configuration: np.ndarray, velocity: np.ndarray, rates: np.ndarray, step: float, accelerate: Accelerate
) -> tuple[np.ndarray, np.ndarray]:
    """Return the state after a step of Runge-Kutta's method; ``rates`` are those of the velocity at its start.

    The quaternion is a vector of four numbers whose length the equations keep; it is normalised where it is used.
    """
    moved, changed = [differentiate_configuration(configuration, velocity)], [rates]
    for share in (0.5, 0.5, 1.0):
        here = normalise_quaternion(configuration + share * step * moved[-1])
        speed = velocity + share * step * changed[-1]
        moved.append(differentiate_configuration(here, speed))
        changed.append(accelerate(here, speed))

    def combine(slopes: list[np.ndarray]) -> np.ndarray:
        return step / 6 * (slopes[0] + 2 * slopes[1] + 2 * slopes[2] + slopes[3])

    return normalise_quaternion(configuration + combine(moved)), velocity + combine(changed)


def step_euler(
    model: pin.Model, configuration: np.ndarray, velocity: np.ndarray, rates: np.ndarray, step: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the state after a step as Pinocchio's examples take it: the velocity first, then the configuration."""
    faster = velocity + step * rates
    return pin.integrate(model, configuration, step * faster), faster
