"""Ground without any symmetry."""

from __future__ import annotations

import numpy as np

from velodrome.reference.surface import surface_function


@surface_function
def _ripples(x, y, parameters):
    a, k = parameters[0], parameters[1]
    s, c = np.sin(k * x), np.cos(k * x)
    return a * s * y, a * k * c * y, a * s, -a * k * k * s * y, a * k * c, 0 * x


class Ripples:
    """z = a sin(0.8 x) y: no surface of revolution, curved both ways."""

    function = _ripples

    def __init__(self, a: float) -> None:
        self.parameters = np.array([a, 0.8])
