"""The machine code of the right-hand side: what a timing on a busy machine cannot guard."""

import platform
import re
from collections.abc import Iterator

import numba as nb
import numpy as np
import pytest
from numba.core.runtime import _nrt_python  # pyright: ignore[reportAttributeAccessIssue]
from numba.core.runtime.nrt import rtsys

from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state, contact_parameters
from velodrome.reference.kernels.compilation import jit
from velodrome.reference.kernels.lean import derivative
from velodrome.reference.kernels.pose import aligned
from velodrome.reference.kinematics import constants
from velodrome.reference.surface import Paraboloid, Plane, Surface


def arguments(surface: Surface) -> tuple:
    """Return the arguments of the right-hand side in a leaning, turning ride, without the array that it fills."""
    bicycle = Bicycle()
    q, qd = consistent_state(bicycle, surface, (0.1, -0.2), 0.3, 0.2, (0.5, 0.2, 14.0))
    y = np.concatenate([q, qd, contact_parameters(bicycle, surface, q)])
    return y, surface.function.real, surface.parameters, aligned(constants(bicycle))


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="reads machine code of x86-64")
def test_right_hand_side_calls_only_the_surface() -> None:
    """Two calls, one for each contact: neither the C library's sine, nor a count of references, nor an exception."""
    # Compiled anew: numba keeps no readable code of what it loads from the disk.
    fresh = nb.njit(error_model="numpy")(derivative.py_func)
    fresh(*arguments(Plane()), np.empty(24))
    codes = list(fresh.inspect_asm().values())
    assert codes
    for code in codes:
        name = re.search(r"^(_ZN9velodrome9reference7kernels4lean10derivative\S*):$", code, re.MULTILINE)
        assert name is not None
        body = code[name.end() : code.index(".size", name.end())]
        assert len(re.findall(r"\tcallq?\t", body)) == 2


@jit
def _repeat(y, function, parameters, bicycle, count, out):
    for _ in range(count):
        derivative(y, function, parameters, bicycle, out)


@pytest.fixture
def _allocations_counted() -> Iterator[None]:
    _nrt_python.memsys_enable_stats()
    yield
    _nrt_python.memsys_disable_stats()


@pytest.mark.usefixtures("_allocations_counted")
@pytest.mark.parametrize("surface", [Plane(), Paraboloid(0.005)], ids=["plane", "bowl"])
def test_right_hand_side_allocates_nothing(surface: Surface) -> None:
    """A thousand evaluations allocate as little as one."""
    where, out = arguments(surface), np.empty(24)
    _repeat(*where, 1, out)
    before = rtsys.get_allocation_stats()
    _repeat(*where, 1, out)
    once = rtsys.get_allocation_stats()
    _repeat(*where, 1000, out)
    after = rtsys.get_allocation_stats()
    assert after.alloc - once.alloc == once.alloc - before.alloc
