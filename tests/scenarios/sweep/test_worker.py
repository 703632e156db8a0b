"""What a worker of a sweep loads before its first task."""

from __future__ import annotations

import subprocess
import sys


def test_a_worker_loads_only_what_tasks_need() -> None:
    """Counted in imports, since a machine's seconds vary."""
    unwanted = (
        *("asyncio", "matplotlib", "scipy.linalg", "pyarrow.compute", "numba.np.linalg"),
        *("velodrome.scenarios.sweep.cluster", "velodrome.scenarios.sweep.figure", "velodrome.scenarios.sweep.pool"),
    )
    script = "import sys\nfrom velodrome.scenarios.sweep.worker import _warm_up\n_warm_up()\n"
    script += f"print([name for name in {unwanted!r} if name in sys.modules])"
    command = [sys.executable, "-c", script]
    # The first time it may compile kernels, for which numba needs more.
    subprocess.run(command, capture_output=True, check=True)
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"
