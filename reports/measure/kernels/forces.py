"""Contact forces along the ground's normal and in its tangent plane."""

from __future__ import annotations

import math

from ....reference.kernels.compilation import jit


@jit
def split_forces(point, force, function, parameters, pressure, tangential):
    """Fill the parts (n, 2) of forces (n, 2, 3) along the upward normal, signed, and across it, at points (n, 2, 3)."""
    for n in range(force.shape[0]):
        for k in range(force.shape[1]):
            _, fx, fy, _, _, _ = function(point[n, k, 0], point[n, k, 1], parameters)
            length = math.sqrt(fx * fx + fy * fy + 1)
            normal = (-fx / length, -fy / length, 1 / length)
            along = 0.0
            for i in range(3):
                along += force[n, k, i] * normal[i]
            across = 0.0
            for i in range(3):
                across += (force[n, k, i] - along * normal[i]) ** 2
            pressure[n, k], tangential[n, k] = along, math.sqrt(across)
