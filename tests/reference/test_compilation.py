"""Compiled kernels on disk are renewed when anything that they call changes."""

from __future__ import annotations

import runpy
import shutil
from pathlib import Path

from velodrome.reference.kernels import compilation


def test_cache_follows_the_files_beside_a_kernel(tmp_path: Path) -> None:
    """In a copy of the package: a file beside a kernel counts wherever it stands, but not one of a user's folder."""
    inner, outer, users = (tmp_path / name for name in ("package/reference/kernels", "package/engines/one", "users"))
    for folder in (inner, outer, users):
        folder.mkdir(parents=True)
        (folder / "helper.py").write_text("x = 1\n")
    copy = shutil.copy(compilation.__file__, inner)
    find_folder = runpy.run_path(str(copy))["_cache_folder"]

    def folders() -> list[str]:
        find_folder.cache_clear()
        return [find_folder("", folder) for folder in (inner, outer, users)]

    before = folders()
    assert before[0] == before[2] != before[1]
    for changed, differs in ((users, [False, False, False]), (outer, [False, True, False]), (inner, [True] * 3)):
        (changed / "helper.py").write_text("x = 2\n")
        after = folders()
        assert [old != new for old, new in zip(before, after, strict=True)] == differs
        before = after
