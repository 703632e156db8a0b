"""What of the engine in Pinocchio works without its library."""

from __future__ import annotations

import subprocess
import sys

CODE = """\
import sys

import numpy as np
from velodrome.engines.engine import Problem
from velodrome.engines.pinocchio.engine import CONSTRAINT
from velodrome.reference.bicycle import Bicycle
from velodrome.reference.dae import consistent_state
from velodrome.reference.surface import Plane

q, qd = consistent_state(Bicycle(), Plane(), (1.0, 0.0), 0.0, 0.0, (0.0, 0.0, 10.0))
CONSTRAINT.check(Problem(Bicycle(), Plane(), q, qd, np.arange(3) / 100), CONSTRAINT.settings())
assert "pinocchio" not in sys.modules
"""


def test_the_engine_is_read_and_checks_a_problem_without_the_library() -> None:
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
