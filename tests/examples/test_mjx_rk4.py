"""MJX's RK4 has order 2 on a free body; a right one has order 4, so that the script would say when it is mended."""

# JAX is an extra, without which its types are not known.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

import runpy
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mujoco.mjx", reason="needs the extra mjx")

import jax.numpy as jnp
from mujoco import mjx
from mujoco.mjx._src import forward

pytestmark = pytest.mark.engines

SCRIPT = SimpleNamespace(
    **runpy.run_path(str(Path(__file__).parents[2] / "examples" / "defects" / "mjx_rk4.py"), run_name="example")
)


def right_rk4(model: Any, data: Any) -> Any:
    """The classical method on the quaternion itself; the data are evaluated."""
    step, start = model.opt.timestep, (data.qpos, data.qvel)

    def rate(data: Any) -> tuple[Any, Any]:
        (w, x, y, z), (a, b, c) = data.qpos[3:7], data.qvel[3:6]
        turn = [-x * a - y * b - z * c, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a]
        return jnp.concatenate([data.qvel[:3], 0.5 * jnp.stack(turn)]), data.qacc

    rates = [rate(data)]
    for node in (0.5, 0.5, 1.0):
        qpos, qvel = (at + node * step * slope for at, slope in zip(start, rates[-1], strict=True))
        rates.append(rate(mjx.forward(model, data.replace(qpos=qpos, qvel=qvel))))
    qpos, qvel = (at + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4) for at, k1, k2, k3, k4 in zip(start, *rates, strict=True))
    return data.replace(qpos=qpos.at[3:7].divide(jnp.linalg.norm(qpos[3:7])), qvel=qvel)


def test_order_is_two() -> None:
    errors, orders = SCRIPT.measure_orders()
    mended = f"MJX {version('mujoco-mjx')} has mended its RK4: mjx-multipliers could use it"
    np.testing.assert_allclose(orders, 2, rtol=0, atol=0.2, err_msg=mended)
    # The first steps turn by 0.12 rad: an error of third order in the angle, a step.
    assert errors[0] < 0.12**3


def test_script_would_see_it_mended(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(forward, "rungekutta4", right_rk4)
    _, orders = SCRIPT.measure_orders()
    np.testing.assert_allclose(orders, 4, rtol=0, atol=0.3)
    SCRIPT.main()
    assert "the defect is mended" in capsys.readouterr().out
