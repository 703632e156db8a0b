"""Compiled kernels: plain loops and scalars, generic over real and complex numbers.

Everything here runs on float64 and on complex128 alike, since derivatives are taken by the complex
step: no conjugation, no absolute value, comparisons on real parts only.

Compiled code is cached on disk. numba renews an entry when the file of the function changes, but not
when a kernel that it calls from another file does; so the cache's folder carries a fingerprint of all
kernels, and a changed kernel starts a new one. Another version of numba does so too: it would write over
the entries of the first.
"""

# numba fills its configuration in at run time.
# pyright: reportAttributeAccessIssue=false

import hashlib
from pathlib import Path

from numba import __version__, config


def _cache_folder() -> str:
    here = Path(__file__).parent
    digest = hashlib.sha256(__version__.encode())
    for source in sorted(here.glob("*.py")):
        digest.update(source.read_bytes())
    # A folder that the user chose through NUMBA_CACHE_DIR stays the place.
    return str(Path(config.CACHE_DIR or here / "__pycache__") / f"kernels-{digest.hexdigest()[:16]}")


config.CACHE_DIR = _cache_folder()
