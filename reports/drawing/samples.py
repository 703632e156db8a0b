"""The samples that draw a curve."""

from __future__ import annotations

import numpy as np


def choose_samples(values: np.ndarray, most: int) -> np.ndarray:
    """Choose samples that draw a curve: smallest and largest of each of equal parts, the first and the last.

    No extremum of the curve is lost, however short it is.

    Parameters
    ----------
    values : ndarray, shape (n,)
        NaN where there is no value.
    most : int
        Largest number of samples, at least 4.

    Returns
    -------
    ndarray of int
        Indices of finite values, in rising order.
    """
    finite = np.flatnonzero(np.isfinite(values))
    if len(finite) <= most:
        return finite
    parts = np.array_split(finite, (most - 2) // 2)
    chosen = [finite[0], finite[-1]]
    for part in parts:
        chosen += [part[values[part].argmin()], part[values[part].argmax()]]
    return np.unique(chosen)
