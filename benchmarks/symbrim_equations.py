"""The Whipple bicycle on the plane as derived by symbrim, compiled to C.

symbrim's axes are x forward, y right, z down, and its angles yaw, roll, pitch, steer; its rear frame
is aligned with the steering axis. The state is its eight coordinates and eight speeds in the order of
its bicycle: rear contact's x and y, yaw, roll, pitch, rear-wheel angle, steer, front-wheel angle.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import sysconfig
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from velodrome.reference.bicycle import Bicycle

# symbrim and its dependencies are an extra: `pip install -e '.[benchmark]'`.
# pyright: reportMissingImports=false

_TEMPLATE = """#include <math.h>

static const double p[] = {%(constants)s};

static void equations(const double *x, double *m, double *g)
{
%(body)s
}

void derivative(const double *x, double *out)
{
    double m[64], g[8];
    equations(x, m, g);
    for (int k = 0; k < 8; k++) {
        int best = k;
        for (int i = k + 1; i < 8; i++)
            if (fabs(m[8 * i + k]) > fabs(m[8 * best + k])) best = i;
        if (best != k) {
            for (int j = k; j < 8; j++) {
                double t = m[8 * k + j]; m[8 * k + j] = m[8 * best + j]; m[8 * best + j] = t;
            }
            double t = g[k]; g[k] = g[best]; g[best] = t;
        }
        for (int i = k + 1; i < 8; i++) {
            double f = m[8 * i + k] / m[8 * k + k];
            if (f == 0.0) continue;
            for (int j = k + 1; j < 8; j++) m[8 * i + j] -= f * m[8 * k + j];
            g[i] -= f * g[k];
        }
    }
    for (int i = 7; i >= 0; i--) {
        for (int j = i + 1; j < 8; j++) g[i] -= m[8 * i + j] * out[8 + j];
        out[8 + i] = g[i] / m[8 * i + i];
    }
    for (int i = 0; i < 8; i++) out[i] = x[8 + i];
}

void repeat(const double *x, double *out, int count)
{
    for (int i = 0; i < count; i++) derivative(x, out);
}
"""


def compiler() -> str | None:
    """Return the path of the system's C compiler, None if there is none."""
    names = [(sysconfig.get_config_var("CC") or "cc").split()[0], "cc", "gcc", "clang"]
    return next((path for path in map(shutil.which, names) if path), None)


def _derive_system() -> tuple[Any, Any]:
    import symbrim as sb
    from sympy import Symbol

    bike = sb.WhippleBicycle.from_convention("moore", "bike")
    bike.ground = sb.FlatGround("ground")
    bike.rear_frame = sb.RigidRearFrame("rear_frame")
    bike.front_frame = sb.RigidFrontFrame("front_frame")
    bike.rear_wheel, bike.front_wheel = sb.KnifeEdgeWheel("rear_wheel"), sb.KnifeEdgeWheel("front_wheel")
    bike.rear_tire, bike.front_tire = sb.NonHolonomicTire("rear_tire"), sb.NonHolonomicTire("front_tire")
    bike.define_all()
    system = bike.to_system()
    system.apply_uniform_gravity(-Symbol("g") * bike.ground.get_normal(bike.ground.origin))
    system.q_ind, system.q_dep = [*bike.q[:4], *bike.q[5:]], [bike.q[4]]
    system.u_ind, system.u_dep = [bike.u[3], *bike.u[5:7]], [*bike.u[:3], bike.u[4], bike.u[7]]
    system.form_eoms(constraint_solver="CRAMER")
    return bike, system


def _symbol_values(bike: Any, bicycle: Bicycle) -> dict[Any, float]:
    """Return the values of symbrim's symbols: lengths and inertia along (u, right, down the steering axis)."""
    from sympy import Symbol

    along = np.array([np.cos(bicycle.steer_axis_tilt), 0, np.sin(bicycle.steer_axis_tilt)])
    down = -np.asarray(bicycle.steer_axis)
    rear, front = bicycle.centre("rear_wheel"), bicycle.centre("front_wheel")
    rear_frame, front_frame = bicycle.centre("rear_frame") - rear, bicycle.centre("front_frame") - front
    values = {
        bike.rear_wheel.symbols["r"]: bicycle.rear_wheel_radius,
        bike.front_wheel.symbols["r"]: bicycle.front_wheel_radius,
        bike.rear_frame.symbols["d1"]: along @ (bicycle.reference_point - rear),
        bike.front_frame.symbols["d2"]: down @ (front - rear),
        bike.front_frame.symbols["d3"]: along @ (front - bicycle.reference_point),
        bike.rear_frame.symbols["l1"]: along @ rear_frame,
        bike.rear_frame.symbols["l2"]: down @ rear_frame,
        bike.front_frame.symbols["l3"]: along @ front_frame,
        bike.front_frame.symbols["l4"]: down @ front_frame,
        Symbol("g"): bicycle.gravity,
    }
    for name in ("rear_frame", "front_frame", "rear_wheel", "front_wheel"):
        body = getattr(bike, name).body
        tensor, inertia = body.central_inertia.to_matrix(body.frame), bicycle.inertia(name)
        values[body.mass] = bicycle.body_mass(name)
        values[tensor[0, 0]], values[tensor[1, 1]] = along @ inertia @ along, inertia[1, 1]
        if name.endswith("frame"):
            values[tensor[0, 2]], values[tensor[2, 2]] = along @ inertia @ down, down @ inertia @ down
    return {symbol: float(value) for symbol, value in values.items()}


def _write_source(bicycle: Bicycle) -> str:
    from sympy import Symbol, ccode, cse, numbered_symbols

    bike, system = _derive_system()
    constants = _symbol_values(bike, bicycle)
    names: dict[Any, Any] = {symbol: Symbol(f"p[{i}]") for i, symbol in enumerate(constants)}
    names |= {value: Symbol(f"x[{i}]") for i, value in enumerate([*bike.q, *bike.u])}
    # symbrim's equations are in the order of its independent, then its dependent speeds.
    order = [list(system.u).index(u) for u in bike.u]
    mass, forcing = system.mass_matrix[:, order].xreplace(names), system.forcing.xreplace(names)
    steps, (mass, forcing) = cse([mass, forcing], symbols=numbered_symbols("t"))
    lines = [f"    double {symbol} = {ccode(value)};" for symbol, value in steps]
    lines += [f"    m[{i}] = {ccode(value)};" for i, value in enumerate(mass)]
    lines += [f"    g[{i}] = {ccode(value)};" for i, value in enumerate(forcing)]
    return _TEMPLATE % {"constants": ", ".join(map(repr, constants.values())), "body": "\n".join(lines)}


class Equations:
    """symbrim's right-hand side x' = f(x) of 16 states in a shared library built in ``folder``."""

    def __init__(self, bicycle: Bicycle, folder: Path, cc: str) -> None:
        source, library = folder / "equations.c", folder / "equations.so"
        source.write_text(_write_source(bicycle), encoding="utf-8")
        flags = ["-O3", "-march=native", "-shared", "-fPIC"]
        subprocess.run([cc, *flags, "-o", str(library), str(source), "-lm"], check=True)
        compiled = ctypes.CDLL(str(library))
        self._derivative, self._repeat = compiled.derivative, compiled.repeat
        self._derivative.argtypes = [ctypes.c_void_p, ctypes.c_void_p]
        self._repeat.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int]

    def function(self) -> Callable[[float, np.ndarray], np.ndarray]:
        """Return the right-hand side as scipy's integrators call it."""
        state, out = np.empty(16), np.empty(16)
        where, there, derivative = state.ctypes.data, out.ctypes.data, self._derivative

        def evaluate(_: float, x: np.ndarray) -> np.ndarray:
            state[:] = x
            derivative(where, there)
            return out.copy()

        return evaluate

    def repeat(self, x: np.ndarray, count: int) -> None:
        """Evaluate ``count`` times without Python in between."""
        out = np.empty(16)
        self._repeat(x.ctypes.data, out.ctypes.data, count)


def start(bicycle: Bicycle, speed: float, lean_rate: float, contact: np.ndarray) -> np.ndarray:
    """Return the state (16,) of the upright bicycle riding straight, its rear contact at ``contact`` (x, y; y left)."""
    x = np.zeros(16)
    x[0], x[1], x[4] = contact[0], -contact[1], bicycle.steer_axis_tilt
    x[8], x[11] = speed, lean_rate
    # Spins are about axles to the right, so forward is negative.
    x[13], x[15] = -speed / bicycle.rear_wheel_radius, -speed / bicycle.front_wheel_radius
    return x
