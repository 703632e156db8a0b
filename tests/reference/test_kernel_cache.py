"""Compiled kernels on disk are found again, renewed when anything that they call changes, and compiled once."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numba as nb
import numpy as np
import pytest
from numba.core import config, event
from numba.core.errors import TypingError

from velodrome.reference.kernels import cache
from velodrome.reference.kernels.compilation import compile_callback, jit

KERNELS = Path(cache.__file__).parent
# Compiles a kernel and the one that it calls for two types, and prints how many compilations it took.
PROCESS = """\
import sys
from numba.core import event
from velodrome.reference.kernels.vector import dot, scale

with event.install_recorder("numba:compile") as recorder:
    sys.stdin.readline()
    for number in (1.5, 1.5 + 0.5j) if sys.argv[1] == "real first" else (1.5 + 0.5j, 1.5):
        vector = (number, number, number)
        assert dot(scale(2.0, vector), vector) == 6 * number**2
# numba also compiles the parts that it puts into them.
print(sum(kept.is_start and kept.data["dispatcher"] in (dot, scale) for _, kept in recorder.buffer))
"""
# Calls one kernel and prints what it returns and which of the modules that numba needs only for compilation are loaded.
LOADING = """\
import sys
from tests.reference import test_kernel_cache
from velodrome.reference.kernels.compilation import jit

print(jit(getattr(test_kernel_cache, sys.argv[1]))(*eval(sys.argv[2])))
print(*sorted({"numba.np.linalg", "numba.cpython.unicode", "scipy.linalg"} & set(sys.modules)))
"""

# Kernels that call one another, with an error in the innermost.
FAILING = """\
import sys

from velodrome.reference.kernels.compilation import jit


@jit
def fail(x):
    if x > 1:
        raise ValueError(f"not {x}")
    return x


@jit
def middle(x):
    return fail(x) + 1


@jit
def first(x):
    return middle(x) + 1


@jit
def second(x):
    return middle(x) + 2


try:
    globals()[sys.argv[1]](2)
except ValueError as error:
    print(error)
"""


@pytest.fixture
def folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Path]:
    """Choose an empty folder for compiled code, as NUMBA_CACHE_DIR does."""
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "chosen"))
    yield tmp_path / "chosen" / "kernels"
    cache.find_folders.cache_clear()


def double(x: Any) -> Any:
    return 2 * x


def find_hash(text: str) -> int:
    return hash(text)


def add_squares(vector: Any) -> Any:
    return np.dot(vector, vector)


def count_compilations(work: Callable[[], object]) -> int:
    with event.install_recorder("numba:compile") as recorder:
        work()
    return sum(kept.is_start for _, kept in recorder.buffer)


def test_every_import_of_a_kernel_is_found() -> None:
    """Against Python's own parser, which takes too long for every start."""
    for path in KERNELS.glob("*.py"):
        imports: set[Path] = set()
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.level == 1:
                imports |= {
                    path.parent / f"{name}.py"
                    for name in ([node.module] if node.module else [n.name for n in node.names])
                }
            assert not isinstance(node, ast.ImportFrom) or node.level < 2, f"{path.name} imports from outside"
        direct = {source for source in imports if source.is_file()}
        indirect = {source for one in direct for source in cache._find_imports(one)}
        assert cache._find_imports(path) == direct | indirect, path.name


def test_fingerprint_follows_what_a_kernel_calls(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A file counts where it is imported, however far away, or stands beside an engine's kernel; no other does."""
    inner, outer, users = (tmp_path / name for name in ("package/reference/kernels", "package/engines/one", "users"))
    for place in (inner, outer, users):
        place.mkdir(parents=True)
        (place / "kernel.py").write_text("from .middle import x\n")
        (place / "middle.py").write_text("from . import (\n    helper,\n)\n")
        (place / "helper.py").write_text("x = 1\n")
        (place / "other.py").write_text("x = 1\n")
    monkeypatch.setattr(cache, "_HERE", inner)
    monkeypatch.setattr(cache, "_PACKAGE", tmp_path / "package")

    def fingerprints() -> list[str]:
        cache.fingerprint.cache_clear()
        cache._find_imports.cache_clear()
        return [cache.fingerprint(place / "kernel.py") for place in (inner, outer, users)]

    before = fingerprints()
    for place, name, differs in (
        (inner, "helper.py", [True, True, True]),
        (inner, "other.py", [False, True, True]),
        (outer, "helper.py", [False, True, False]),
        (users, "helper.py", [False, False, False]),
        (users, "kernel.py", [False, False, True]),
    ):
        (place / name).write_text("x = 2\n")
        after = fingerprints()
        assert [old != new for old, new in zip(before, after, strict=True)] == differs, (place, name)
        before = after


def test_compiled_code_is_found_again(folder: Path) -> None:
    assert count_compilations(lambda: [jit(double)(1.5), jit(double)(2)]) == 2
    assert len(list(folder.glob("*.nbc"))) == 2
    assert count_compilations(lambda: [jit(double)(1.5), jit(double)(2)]) == 0
    assert count_compilations(lambda: jit(double)(1.5j)) == 1


def test_kernel_is_compiled_into_others(folder: Path) -> None:
    """For others it is compiled to bitcode, which is kept as well and parsed when it is needed."""

    def call_through_another(kernel: Any) -> tuple[int, float]:
        @nb.njit
        def quadruple(x: Any) -> Any:
            return kernel(kernel(x))

        found: list[float] = []
        return count_compilations(lambda: found.append(quadruple(1.5))), found[0]

    assert call_through_another(jit(double)) == (2, 6.0)
    inner = jit(double)
    assert count_compilations(lambda: inner.part.compile((nb.float64,))) == 0
    (loaded,) = inner.part.overloads.values()
    assert loaded.library._shared_module is None
    assert call_through_another(inner) == (1, 6.0)
    assert loaded.library._shared_module is not None
    assert inner.overloads == {}
    assert inner(1.5) == 3.0
    assert count_compilations(lambda: jit(double)(1.5)) == 0


def test_error_of_an_inner_kernel_is_raised(tmp_path: Path) -> None:
    """Its text is made of objects in an environment that the machine code of the outer kernel has to find."""
    (tmp_path / "failing.py").write_text(FAILING)
    paths = os.pathsep.join([str(tmp_path), *sys.path])
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": paths}
    # Compiled, loaded, and compiled from a part that was loaded and has the inner kernel compiled into it.
    for outer in ("first", "first", "second"):
        process = [sys.executable, str(tmp_path / "failing.py"), outer]
        said = subprocess.run(process, env=environment, text=True, check=True, capture_output=True).stdout
        assert said.strip() == "not 2"


@pytest.mark.parametrize(
    ("kernel", "argument", "needs"),
    [
        ("double", "(1.5,)", set()),
        # It calls a function in C that imports SciPy itself.
        ("add_squares", "(__import__('numpy').array([3.0, 4.0]),)", {"scipy.linalg"}),
        # It reads a variable that only one of the modules makes known.
        ("find_hash", "('a longer text',)", {"numba.cpython.unicode", "numba.np.linalg", "scipy.linalg"}),
    ],
)
def test_loaded_kernel_needs_no_compiler(tmp_path: Path, kernel: str, argument: str, needs: set[str]) -> None:
    """What numba imports before it compiles is imported for the kernels that need it only."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "PYTHONHASHSEED": "1"}

    def call() -> list[str]:
        process = [sys.executable, "-c", LOADING, kernel, argument]
        return subprocess.run(process, env=environment, text=True, check=True, capture_output=True).stdout.splitlines()

    compiled, loaded = call(), call()
    assert loaded[0] == compiled[0]
    assert set(compiled[1].split()) == {"numba.cpython.unicode", "numba.np.linalg", "scipy.linalg"}
    assert set(loaded[1].split()) == needs


def test_damaged_file_is_compiled_anew(folder: Path) -> None:
    jit(double)(1.5)
    (path,) = folder.glob("*.nbc")
    whole = path.read_bytes()
    for kept in (0, len(whole) // 2):
        path.write_bytes(whole[:kept])
        assert count_compilations(lambda: jit(double)(1.5)) == 1
        assert count_compilations(lambda: jit(double)(1.5)) == 0


@pytest.mark.parametrize("home_is_writable", [True, False])
def test_package_that_cannot_be_written_to_keeps_its_code(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, home_is_writable: bool
) -> None:
    """What was compiled ahead is read where it is; anything else goes to the user's folder, or is not kept."""
    package, home = tmp_path / "package", tmp_path / "home"
    allowed = [package, home] if home_is_writable else [package]
    monkeypatch.setattr(config, "CACHE_DIR", "")
    monkeypatch.setattr(cache, "_HERE", package)
    monkeypatch.setenv("XDG_CACHE_HOME", str(home))
    is_writable = cache._is_writable
    # The rights of a folder do not hold for an administrator, who runs the tests in containers.
    monkeypatch.setattr(
        cache, "_is_writable", lambda path: is_writable(path) and set(allowed) & set(path.parents) != set()
    )
    cache.find_folders.cache_clear()
    jit(double)(1.5)
    warm = sorted(package.rglob("*.nbc"))
    assert len(warm) == 1
    allowed.remove(package)
    cache.find_folders.cache_clear()
    try:
        assert count_compilations(lambda: jit(double)(1.5)) == 0
        assert count_compilations(lambda: jit(double)(2)) == 1
        assert count_compilations(lambda: jit(double)(2)) == (0 if home_is_writable else 1)
        assert sorted(package.rglob("*.nbc")) == warm
        assert len(list(home.rglob("*.nbc"))) == home_is_writable
    finally:
        cache.find_folders.cache_clear()


def test_error_leaves_nothing_locked(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    locked: list[str] = []
    monkeypatch.setattr(cache, "wait_for_lock", lambda _, name: locked.append(name))
    monkeypatch.setattr(cache, "unlock", lambda _, name: locked.remove(name))
    for _ in range(2):
        with pytest.raises(TypingError):
            jit(double)(None)
        with pytest.raises(TypingError):
            compile_callback("float64(none)")(double)
        assert locked == []


def test_function_without_a_file_is_compiled(folder: Path) -> None:
    names: dict[str, Any] = {}
    exec("def shift(x):\n    return x + 1.0\n", names)
    assert compile_callback("float64(float64)")(names["shift"]).ctypes(1.5) == 2.5
    assert not folder.exists()


def test_processes_that_start_at_once_share_the_work(tmp_path: Path) -> None:
    """Each kernel is compiled for each type in one of them, and both compute with the right one."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    both = [
        subprocess.Popen(
            [sys.executable, "-c", PROCESS, order],
            env=environment,
            text=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        for order in ("real first", "complex first")
    ]
    for process in both:
        assert process.stdin is not None
        process.stdin.write("go\n")
        process.stdin.flush()
    counts = [int(process.communicate(timeout=120)[0]) for process in both]
    assert sum(counts) == 4, counts
    assert len(list(tmp_path.rglob("*.nbc"))) == 4
