"""Load Warp and use it without a word on the standard streams."""

# Warp is an extra, without which its types are not known.
# pyright: reportMissingImports=false

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import warp


@contextmanager
def quiet_warp() -> Iterator[None]:
    """Let Warp speak of errors alone inside the block: it tells of processors, caches and every kernel it loads."""
    before = warp.config.log_level
    warp.config.log_level = max(before, warp.LOG_ERROR)
    try:
        yield
    finally:
        warp.config.log_level = before


def list_devices() -> list[str]:
    """Return Warp's names of the processors here, ``cuda`` among them where it stands for one."""
    with quiet_warp():
        names = [str(device) for device in warp.get_devices()]
    return [*names, "cuda"] if any(name.startswith("cuda:") for name in names) else names
