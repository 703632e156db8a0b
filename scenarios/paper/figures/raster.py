"""Rasterisation of triangles and lines with a depth buffer.

In vector form, for a triangle with corners p0, p1, p2 on the screen (x, y) and depth z:

    b = barycentric coordinates of the pixel's centre in (p0, p1, p2)
    drawn where all b >= 0 and  z = b . (z0, z1, z2)  is nearer than the buffer's value
    colour = b . (c0, c1, c2)
"""

from __future__ import annotations

import numpy as np

from ....reference.kernels.compilation import jit


@jit
def fill(points, triangles, colours, cull, depth, image):
    """Draw triangles.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Screen x to the right and y downwards [px], depth away from the eye.
    triangles : ndarray, shape (m, 3), int
    colours : ndarray, shape (n, 3)
        0 to 1.
    cull : bool
        Omit triangles that show their back: those that run anticlockwise on the screen.
    depth : ndarray, shape (h, w)
        Changed in place.
    image : ndarray, shape (h, w, 4)
        Colour and coverage, changed in place.
    """
    height, width = depth.shape
    for k in range(len(triangles)):
        a, b, c = triangles[k, 0], triangles[k, 1], triangles[k, 2]
        x0, y0, x1, y1 = points[a, 0], points[a, 1], points[b, 0], points[b, 1]
        x2, y2 = points[c, 0], points[c, 1]
        area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        if area == 0 or (cull and area > 0):
            continue
        left, right = max(0, int(min(x0, x1, x2))), min(width - 1, int(max(x0, x1, x2)) + 1)
        top, bottom = max(0, int(min(y0, y1, y2))), min(height - 1, int(max(y0, y1, y2)) + 1)
        for i in range(top, bottom + 1):
            for j in range(left, right + 1):
                x, y = j + 0.5, i + 0.5
                b1 = ((x - x0) * (y2 - y0) - (x2 - x0) * (y - y0)) / area
                b2 = ((x1 - x0) * (y - y0) - (x - x0) * (y1 - y0)) / area
                b0 = 1 - b1 - b2
                if b0 < 0 or b1 < 0 or b2 < 0:
                    continue
                z = b0 * points[a, 2] + b1 * points[b, 2] + b2 * points[c, 2]
                if z >= depth[i, j]:
                    continue
                depth[i, j] = z
                for channel in range(3):
                    image[i, j, channel] = (
                        b0 * colours[a, channel] + b1 * colours[b, channel] + b2 * colours[c, channel]
                    )
                image[i, j, 3] = 1.0


@jit
def stroke(points, width, lift, colour, depth, image):
    """Draw a line of a width [px] through points of shape (n, 3), moved towards the eye by ``lift``."""
    height, across = depth.shape
    half = width / 2
    for k in range(len(points) - 1):
        dx, dy = points[k + 1, 0] - points[k, 0], points[k + 1, 1] - points[k, 1]
        steps = int(np.hypot(dx, dy) / 0.5) + 1
        for s in range(steps + 1):
            t = s / steps
            x, y = points[k, 0] + t * dx, points[k, 1] + t * dy
            z = points[k, 2] + t * (points[k + 1, 2] - points[k, 2]) - lift
            for i in range(max(0, int(y - half)), min(height - 1, int(y + half)) + 1):
                for j in range(max(0, int(x - half)), min(across - 1, int(x + half)) + 1):
                    if (j + 0.5 - x) ** 2 + (i + 0.5 - y) ** 2 <= half * half and z < depth[i, j]:
                        depth[i, j] = z
                        image[i, j, 0], image[i, j, 1], image[i, j, 2] = colour[0], colour[1], colour[2]
                        image[i, j, 3] = 1.0
