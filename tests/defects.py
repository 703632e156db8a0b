"""What every test of a script in examples/defects checks."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

DEFECTS = Path(__file__).parents[1] / "examples" / "defects"


def assert_shows_defect(script: Path, folder: Path, mended: str) -> None:
    """Run a script alone, without the suite, and check that its exit status and last line tell of the defect.

    Parameters
    ----------
    script : Path
    folder : Path
        An empty folder to run it in.
    mended : str
        What to say where the library no longer has the defect.
    """
    done = subprocess.run(
        [sys.executable, "-P", script], capture_output=True, text=True, timeout=300, check=False, cwd=folder
    )
    assert done.returncode == 1, mended if done.returncode == 0 else done.stderr
    assert "defect: " in done.stdout.splitlines()[-1]
    assert "velodrome" not in script.read_text(encoding="utf-8")
