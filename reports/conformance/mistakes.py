"""Rides with a wrong model of the ground, of the bicycle or of the inputs, predicted by the reference.

An engine may ignore a ground's curvature, read its heights in another order, ride the benchmark's bicycle whatever
bicycle the problem has, or apply a torque the wrong way. The reference simulates the problem with each of these
mistakes, and the engine's ride is compared with these rides, as it is with those of wrong maps.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace
from functools import lru_cache

import numpy as np

from ...engines.engine import Problem
from ...reference.bicycle import Bicycle
from ...reference.height_field import HeightField
from ...reference.inputs import NO_INPUTS, Inputs
from ...reference.surface import Paraboloid, Plane, Surface
from .explain import EXPLAINED
from .motions import TransientMotion
from .predictions import DISTINCT, Prediction, measure_distance, simulate_start
from .rides import Ride


def find_mistake(ride: Ride) -> str | None:
    """Return which mistake in the ground or the bicycle explains a ride's difference best, or None.

    A mistake must explain nine tenths of the difference from the reference's ride.
    """
    motion, q, qd = ride.motion, ride.q, ride.trajectory.qd
    own = measure_distance(motion, q, qd, motion.exact.q, motion.exact.qd)
    best: tuple[float, str] | None = None
    for prediction in predict_mistakes(motion):
        left = measure_distance(motion, q, qd, prediction.q, prediction.qd)
        if left <= EXPLAINED * own and (best is None or left < best[0]):
            best = left, prediction.what
    if best is None:
        return None
    left, what = best
    return f"{what}: its ride is {own:.2g} from the reference's, and {left:.2g} from the reference's with that mistake"


@lru_cache(maxsize=16)
def predict_mistakes(motion: TransientMotion) -> tuple[Prediction, ...]:
    """Predict the rides of a motion with each mistake that shows in it.

    Predictions are left out that differ from the right ride by no more than the errors of the methods that compute
    them.
    """
    exact, problem = motion.exact, motion.problem
    right = [measure_distance(motion, ride.q, ride.qd, exact.q, exact.qd) for ride in simulate_start(problem)]
    least = DISTINCT * max(right)
    found = (
        Prediction(what, True, ride.q, ride.qd)
        for what, wrong in _make_mistakes(problem)
        for ride in simulate_start(wrong)
    )
    return tuple(one for one in found if measure_distance(motion, one.q, one.qd, exact.q, exact.qd) > least)


def _make_mistakes(problem: Problem) -> Iterator[tuple[str, Problem]]:
    benchmark, both = Bicycle(), "it rides the benchmark's bicycle as the reference does on the plane"
    if not isinstance(problem.surface, Plane):
        yield "it rides as the reference does on the plane", replace(problem, surface=Plane())
        if problem.bicycle != benchmark:
            yield both, replace(problem, surface=Plane(), bicycle=benchmark)
        for what, surface in _mistake_ground(problem.surface):
            yield what, replace(problem, surface=surface)
    if problem.bicycle != benchmark:
        yield "it rides the benchmark's bicycle", replace(problem, bicycle=benchmark)
        for field in fields(Bicycle):
            usual = getattr(benchmark, field.name)
            if getattr(problem.bicycle, field.name) != usual:
                changed = replace(problem.bicycle, **{field.name: usual})
                yield f"{field.name} looks to be the benchmark's", replace(problem, bicycle=changed)
    for what, inputs in _mistake_inputs(problem.inputs):
        yield what, replace(problem, inputs=inputs)


def _mistake_inputs(inputs: Inputs) -> Iterator[tuple[str, Inputs]]:
    if inputs != NO_INPUTS:
        yield "it applies no inputs", NO_INPUTS
    for field in fields(Inputs):
        value = getattr(inputs, field.name)
        if value != 0:
            yield f"{field.name} looks to be left out", replace(inputs, **{field.name: 0.0})
            if field.name != "steer_damping":  # which is never negative
                yield f"{field.name} looks mirrored", replace(inputs, **{field.name: -value})


def _mistake_ground(surface: Surface) -> Iterator[tuple[str, Surface]]:
    if isinstance(surface, Paraboloid):
        for factor, words in ((0.1, "a tenth of"), (0.5, "half"), (2.0, "twice")):
            yield f"the bowl's curvature looks to be {words} what it is", Paraboloid(factor * surface.alpha)
    elif isinstance(surface, HeightField):
        heights, (x, y), spacing = np.array(surface.heights), surface.origin, surface.spacing
        for what, changed in (
            ("transposed", heights.T),
            ("negated", -heights),
            ("mirrored in x", heights[::-1]),
            ("mirrored in y", heights[:, ::-1]),
        ):
            yield f"the ground looks {what}", replace(surface, heights=changed.tolist())
        for i, j, words in ((1, 0, "x"), (-1, 0, "-x"), (0, 1, "y"), (0, -1, "-y")):
            shifted = replace(surface, origin=(x + i * spacing, y + j * spacing))
            yield f"the ground looks shifted by one spacing in {words}", shifted
