"""The reference's right-hand side in C (`right_hand_side.c`), compiled here: what its kernels are measured against."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

SOURCE = Path(__file__).with_name("right_hand_side.c")
# The compiler's best, without and with the right to change results: terms reordered, signs of zero and nan ignored.
FLAGS = ("-O3", "-march=native")
FAST_FLAGS = (*FLAGS, "-ffast-math")


def flatten_constants(bicycle: Any) -> np.ndarray:
    """Return the numbers of `pose.Aligned`, pairs and tensors one after another."""
    return np.concatenate([np.atleast_1d(np.asarray(value, dtype=float)) for value in bicycle])


class RightHandSide:
    """The right-hand side on the plane in a shared library built in ``folder``.

    Parameters
    ----------
    bicycle : kernels.pose.Aligned
    folder : Path
    compiler : str
        The C compiler's path.
    flags : tuple of str
        Its options of optimisation.
    """

    def __init__(self, bicycle: Any, folder: Path, compiler: str, flags: tuple[str, ...]) -> None:
        library = folder / f"right_hand_side{'-'.join(flags)}.so"
        command = [compiler, "-std=gnu11", *flags, "-shared", "-fPIC", "-o", str(library), str(SOURCE), "-lm"]
        subprocess.run(command, check=True)
        compiled = ctypes.CDLL(str(library))
        self._repeat = compiled.repeat
        self._repeat.argtypes = [ctypes.c_void_p] * 4 + [ctypes.c_int, ctypes.c_void_p]
        self._ground = ctypes.cast(compiled.plane, ctypes.c_void_p)
        self._bicycle = flatten_constants(bicycle)

    def repeat(self, y: np.ndarray, count: int) -> np.ndarray:
        """Evaluate ``count`` times at y (24,) without Python in between; return dy/dt (24,)."""
        out = np.empty(24)
        self._repeat(y.ctypes.data, self._ground, None, self._bicycle.ctypes.data, count, out.ctypes.data)
        return out
