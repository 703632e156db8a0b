"""Ride a bicycle in MJX: put the model and its start into JAX, step in one compiled loop per output, record."""

# JAX is an extra, without which its types are not known; MuJoCo's compiled bindings carry none.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from time import process_time
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from mujoco import mjx

from ...reference.fall import Fall, count_standing, describe_fall, heights_above_fallen, solve_fall
from ...reference.kinematics import WHEELS
from ..engine import EngineError, Problem, Progress
from ..mujoco.convergence import share
from ..mujoco.model import Touching
from ..mujoco.ride import Recording, RideState, bodies, set_start
from ..mujoco.settings import WRONG
from ..mujoco.state import from_mujoco
from . import multipliers, native
from .ground import choose_height
from .settings import ArraySettings, MjxMultiplierSettings, MjxSettings
from .setup import MjxInputs, MjxSetup, StepReport

# Numbers beyond this are a failure, as MuJoCo's own mjMAXVAL says.
_HUGE = 1e10
_STEPS = {"contacts": native.step_on_planes, "multipliers": multipliers.step_rolling}
_RECORDED = ("qpos", "qvel", "position", "quaternion", "force", "energy")
# Outputs of one call of the compiled function: a call takes as long as some outputs.
_BLOCK = 32


class Progression(NamedTuple):
    """State of a ride inside the compiled loop: arrays of JAX.

    Attributes
    ----------
    data : mjx.Data
    report : StepReport
    steps : array, shape ()
        Steps taken in the call; -1 before the state is evaluated.
    finite : array, shape ()
        Whether the state's numbers are finite and not huge.
    worst : array, shape ()
        Largest relative residual of the contact solver in the call.
    unconverged : array, shape ()
        Number of new states in the call with a residual above the limit.
    """

    data: Any
    report: StepReport
    steps: Any
    finite: Any
    worst: Any
    unconverged: Any


def _make_ride(setup: MjxSetup, given_tree: Any, data_tree: Any) -> Any:
    """Return the function that steps to each output of a block and samples there.

    It takes and returns the leaves of JAX's trees. ``given_tree`` is the structure of the model and the inputs,
    ``data_tree`` that of the data.
    """
    take_step = _STEPS[setup.rolling]

    def advance(given: list[Any], leaves: list[Any], counts: Any) -> Any:
        model, inputs = jax.tree.unflatten(given_tree, given)

        def go_on(now: Progression) -> Progression:
            first = now.steps < 0
            data, report = take_step(setup, model, inputs, now.data, first)
            return Progression(
                data=data,
                report=report,
                steps=now.steps + 1,
                finite=_is_finite(data),
                worst=jnp.maximum(now.worst, report.residual),
                unconverged=now.unconverged + (~first & (report.residual > inputs.converged_below)),
            )

        def reach_output(now: Progression, count: Any) -> tuple[Progression, dict[str, Any]]:
            def is_going(now: Progression) -> Any:
                return (now.steps < count) & now.report.standing & now.finite & (now.worst <= WRONG)

            now = jax.lax.while_loop(is_going, go_on, now)
            return now, _sample_state(setup, model, now)

        data, none = jax.tree.unflatten(data_tree, leaves), jnp.zeros_like(counts[0])
        real = jnp.zeros_like(inputs.converged_below)
        report = StepReport(jnp.zeros((2, 3), real.dtype), jnp.array(True), real)
        start = Progression(data, report, none - 1, jnp.array(True), real, none)
        end, found = jax.lax.scan(reach_output, start, counts)
        return jax.tree.leaves(end.data), found

    return jax.vmap(advance, in_axes=(None, 0, None)) if setup.batch_size > 1 else advance


def _sample_state(setup: MjxSetup, model: Any, now: Progression) -> dict[str, Any]:
    """Return what is recorded of an evaluated state, by the names of a `Recording`, and how the ride goes."""
    data, bodies = now.data, jnp.array(setup.bodies)
    potential = -jnp.sum(model.body_mass[:, None] * data.xipos * model.opt.gravity)
    kinetic = 0.5 * data.qvel @ mjx.mul_m(model, data, data.qvel)
    return {
        "qpos": data.qpos,
        "qvel": data.qvel,
        "position": data.xipos[bodies],
        "quaternion": data.xquat[bodies],
        "force": now.report.force,
        "energy": jnp.stack([potential, kinetic]),
        "standing": now.report.standing,
        "steps": now.steps,
        "finite": now.finite,
        "worst": now.worst,
        "unconverged": now.unconverged,
    }


_compiled: dict[Any, Any] = {}


def _compile_ride(setup: MjxSetup, given: Any, data: Any) -> tuple[Any, list[Any], list[Any]]:
    """Return a compiled ride with the leaves of the model with its inputs, and of the data.

    Rides with equal setups, structures, shapes and types share the code.
    """
    leaves, trees = zip(*(jax.tree.flatten(tree) for tree in (given, data)), strict=True)
    shapes = tuple((leaf.shape, leaf.dtype.name) for part in leaves for leaf in part)
    key = (setup, *trees, shapes)
    if key not in _compiled:
        ride = jax.jit(_make_ride(setup, *trees))
        _compiled[key] = ride.lower(*leaves, jnp.zeros(_BLOCK, jnp.int32)).compile()
    return _compiled[key], *leaves


def _is_finite(data: Any) -> Any:
    state = jnp.concatenate([data.qpos, data.qvel])
    return jnp.all(jnp.abs(state) < _HUGE)


def build_setup(problem: Problem, settings: ArraySettings) -> tuple[MjxSetup, Any, MjxInputs, Any]:
    """Return the setup, the model, the inputs and the state at the start of a problem, in the current precision.

    Raises
    ------
    EngineError
        If MuJoCo or MJX refuses the model.
    """
    height, rolls = choose_height(problem.surface), isinstance(settings, MjxMultiplierSettings)
    touching: Touching = "nothing" if rolls else "plane" if height is None else "planes"
    model, data = set_start(problem, settings, touching)
    names = [f"{wheel}_wheel" for wheel in WHEELS]
    planes = [model.body(f"ground_{wheel}").mocapid[0] for wheel in WHEELS] if touching == "planes" else []
    setup = MjxSetup(
        rolling="multipliers" if rolls else "contacts",
        height=height,
        bodies=tuple(bodies(model)),
        wheels=(model.body(names[0]).id, model.body(names[1]).id),
        planes=tuple(int(plane) for plane in planes),
        batch_size=settings.batch_size,
    )
    try:
        put, state = mjx.put_model(model, impl="jax"), mjx.make_data(model, impl="jax")
    except (NotImplementedError, ValueError) as error:
        raise EngineError(f"MJX refuses the bicycle: {error}") from error
    kind = state.qpos.dtype
    state = state.replace(**{name: jnp.asarray(getattr(data, name), kind) for name in ("qpos", "qvel", "qfrc_applied")})
    inputs = MjxInputs(
        parameters=jnp.asarray(problem.surface.parameters, kind),
        radii=jnp.asarray([getattr(problem.bicycle, f"{name}_radius") for name in names], kind),
        stabilisation=jnp.asarray(settings.stabilisation if isinstance(settings, MjxMultiplierSettings) else 0.0, kind),
        converged_below=jnp.asarray(settings.converged_below if isinstance(settings, MjxSettings) else 0.0, kind),
    )
    return setup, put, inputs, state


def ride_in_mjx(problem: Problem, settings: ArraySettings, counts: list[int], progress: Progress) -> RideState:
    """Integrate a problem.

    Parameters
    ----------
    problem : Problem
    settings : ArraySettings
    counts : list of int
        Number of steps from the start to each output time.
    progress : callable

    Raises
    ------
    EngineError
        If MuJoCo or MJX refuses the model, a wheel has no contact at the start, or the contact solver fails there.
    """
    with jax.enable_x64(settings.precision == "float64"):
        setup, model, inputs, data = build_setup(problem, settings)
        # Numbers that MJX gives weak types would get others in the compiled loop.
        model, inputs, data = jax.tree.map(lambda leaf: jnp.asarray(np.asarray(leaf)), (model, inputs, data))
        if settings.batch_size > 1:
            data = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, (settings.batch_size, *leaf.shape)), data)
        # Steps of RK4 have four evaluations, and only the last one's solution remains to be looked at.
        judged = setup.rolling == "multipliers" or settings.integrator != "RK4"
        return _record_ride(problem, setup, model, inputs, data, settings, counts, progress, judged)


def _record_ride(
    problem: Problem,
    setup: MjxSetup,
    model: Any,
    inputs: MjxInputs,
    data: Any,
    settings: ArraySettings,
    counts: list[int],
    progress: Progress,
    judged: bool,
) -> RideState:
    advance, given, state = _compile_ride(setup, (model, inputs), data)
    recording = Recording.empty(len(counts))
    steps, samples, unconverged, worst, cpu_time, ended = 0, 0, 0, 0.0, 0.0, None
    fall, standing = None, 0

    def ride_on(state: list[Any], steps: int, block: np.ndarray) -> tuple[list[Any], dict[str, np.ndarray]]:
        """Ride from a state after ``steps`` to each number of steps in a block, and sample there."""
        # Behind the last output the ride stays there.
        ahead = np.pad(block - steps, (0, _BLOCK - len(block)), mode="edge")
        state, found = jax.block_until_ready(advance(given, state, jnp.asarray(ahead, jnp.int32)))
        found = {name: np.asarray(value) for name, value in jax.device_get(found).items()}
        if setup.batch_size > 1:
            found = {name: value[settings.batch_place] for name, value in found.items()}
        return state, found

    for first in range(0, len(counts), _BLOCK):
        block = np.array(counts[first : first + _BLOCK])
        before, begun = (state, steps), process_time()
        state, found = ride_on(state, steps, block)
        cpu_time += process_time() - begun
        reached, ended = _find_first_ending(found, steps, len(block), settings.step)
        last = min(reached, len(block) - 1)
        for name in _RECORDED:
            getattr(recording, name)[first : first + reached] = found[name][:reached]
        recording.time[first : first + reached] = block[:reached] * settings.step
        samples += reached
        steps += int(found["steps"][last])
        unconverged, worst = unconverged + int(found["unconverged"][last]), max(worst, float(found["worst"][last]))
        if not problem.beyond_fall and samples > 0:
            begun = process_time()
            standing = _count_standing(problem, recording, max(first - 1, 0), samples)
            if standing > 0 and (standing < samples or ended is not None):
                around = counts[standing - 1], counts[standing] if standing < samples else steps
                fall = _narrow_fall(problem, settings.step, partial(ride_on, *before), before[1], around)
            cpu_time += process_time() - begun
        if fall is not None:
            heights = heights_above_fallen(problem.bicycle, problem.surface, fall.q, fall.qd)
            samples, ended = standing, describe_fall(solve_fall(fall.time, *heights))
            steps = round(fall.time[1] / settings.step)  # the call has gone on to the end of its block
        if ended is not None:
            break
        progress(steps * settings.step)
    if samples == 0:
        raise EngineError(ended)
    contacts = setup.rolling == "contacts"
    return RideState(
        recording=recording.first(samples),
        steps=steps,
        cpu_time=cpu_time,
        ended=ended,
        unconverged_steps=unconverged if judged else None,
        largest_residual=worst if judged and contacts and np.isfinite(worst) else None,
        fall=fall,
    )


def _count_standing(problem: Problem, recording: Recording, first: int, samples: int) -> int:
    """Return the number of samples before the first, from ``first`` on, in which the bicycle has fallen."""
    part = slice(first, samples)
    q, qd = from_mujoco(recording.time[part], recording.qpos[part], recording.qvel[part], problem.q)
    return first + count_standing(problem.bicycle, problem.surface, q, qd)


def _narrow_fall(
    problem: Problem,
    step: float,
    ride_again: Callable[[np.ndarray], tuple[list[Any], dict[str, np.ndarray]]],
    begun: int,
    around: tuple[int, int],
) -> Fall | None:
    """Return the states around a fall, one step apart; None if the bicycle stands as long as it can ride.

    MJX rides many outputs in one compiled call. The same call rides the block again, with outputs that are closer to
    each other.

    Parameters
    ----------
    problem : Problem
    step : float
        [s].
    ride_again : callable
        Rides the block again, and returns its end and samples after the given numbers of steps.
    begun : int
        Number of steps before the block.
    around : tuple of int
        Numbers of steps after which the bicycle stands, and has fallen or cannot ride on.
    """
    while True:
        counts = np.unique(np.linspace(*around, _BLOCK).astype(int))
        _, found = ride_again(counts)
        going, _ = _find_first_ending(found, begun, len(counts), step)
        q, qd = from_mujoco(counts[:going] * step, found["qpos"][:going], found["qvel"][:going], problem.q)
        k = count_standing(problem.bicycle, problem.surface, q, qd)
        if k in (0, len(counts)):
            return None
        if counts[k] - counts[k - 1] == 1:
            pair = slice(k - 1, k + 1)
            return Fall(counts[pair] * step, q[pair], qd[pair]) if k < going else None
        around = int(counts[k - 1]), int(counts[k])


def _find_first_ending(found: dict[str, np.ndarray], steps: int, outputs: int, step: float) -> tuple[int, str | None]:
    """Return the number of outputs of a block, begun after ``steps``, that the ride reaches, and why it then ends."""
    endings = (_find_ending(found, i, (steps + found["steps"][i]) * step) for i in range(outputs))
    return next(((i, why) for i, why in enumerate(endings) if why is not None), (outputs, None))


def _find_ending(found: dict[str, np.ndarray], i: int, time: float) -> str | None:
    """Return why a ride ends before output i of a block, at a time [s]; None if it goes on."""
    if not found["finite"][i]:
        return f"MJX's state became infinite or huge at {time:.6g} s"
    if not found["worst"][i] <= WRONG:
        return f"MJX's contact solver stopped unconverged at {time:.6g} s: {share(float(found['worst'][i]))}"
    return (
        None if found["standing"][i] else f"a wheel lies flat or has no contact point with the surface at {time:.6g} s"
    )
