"""The arrays in which MuJoCo keeps the inertia matrix: compressed rows, or the older form of ancestors' entries.

Since MuJoCo 3.3.6 the rows' lengths, starts and columns are in `mjModel`, and the entries in `mjData.M`. Before, the
entries are in `mjData.qM`: from ``dof_Madr[i]`` on those of row i, with itself, with its parent, and so on to the root.
"""

# MuJoCo's compiled bindings carry no types.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from .releases import INERTIA, is_present


class InertiaArrays(NamedTuple):
    """Arrays of the inertia matrix, whose names are those of the blackboard's fields.

    Attributes
    ----------
    M : ndarray, shape (k,)
        Entries of one triangle, MuJoCo's own array.
    M_rownnz, M_rowadr : ndarray, shape (n,)
        Number of entries of each row, and the place of its first.
    M_colind : ndarray, shape (k,)
        Columns of the entries.
    """

    M: np.ndarray
    M_rownnz: np.ndarray
    M_rowadr: np.ndarray
    M_colind: np.ndarray


def find_inertia(model: mujoco.MjModel, data: mujoco.MjData) -> InertiaArrays:
    """Return the arrays in which a state keeps its inertia matrix."""
    if is_present(INERTIA):
        return InertiaArrays(data.M, model.M_rownnz, model.M_rowadr, model.M_colind)
    lengths, columns = np.zeros(model.nv, np.int32), np.zeros(len(data.qM), np.int32)
    for row in range(model.nv):
        first, column = int(model.dof_Madr[row]), row
        while column >= 0:
            columns[first + lengths[row]] = column
            lengths[row] += 1
            column = int(model.dof_parentid[column])
    return InertiaArrays(data.qM, lengths, np.array(model.dof_Madr, np.int32), columns)
