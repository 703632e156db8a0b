"""The package as a stranger has it: ``python -m tests.wheel``.

Builds the sdist and the wheel, installs the wheel in an empty environment and uses the suite from there, in a folder
that has folders of the floors' names. What falls short ends it with one line.
"""

from __future__ import annotations

import json
import resource
import shutil
import subprocess
import sys
import tarfile
import time
import venv
import zipfile
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

ROOT = Path(__file__).parents[1]
EXAMPLE = ROOT / "examples" / "velodrome-symbrim"
PLUGIN = ROOT / "tests" / "public" / "plugin.py"
FLOORS = ("engines", "reference", "reports", "scenarios")
_PATIENCE = 900  # for a program on a busy machine [s]
# Beside a script, whatever is called after a floor is the user's own.
FOREIGN = 'raise ImportError("a folder of the user was taken for a part of the suite")\n'
SCRIPT = """\
import sys
from pathlib import Path

import velodrome
from own_kernel import square

run = velodrome.run("plane-circle", engines=["exudyn"], duration=0.2)
assert list(run.metrics) == ["reference", "exudyn"], run
assert run.metrics["exudyn"]["position_error"]["max"] < 1e-3, run
assert velodrome.__file__.startswith(sys.prefix), velodrome.__file__
assert square(3.0) == 9.0
cached = list(Path("__pycache__").glob("own_kernel.square-*.nbi"))
assert cached, "the user's function was not cached beside the user's file"
"""
KERNEL = """\
from numba import njit

import velodrome

velodrome.circular(alpha=0.005, rear_rate=18.0, family=2)  # kernels of the suite are compiled before


@njit(cache=True)
def square(x):
    return x * x
"""
# Line by line: uses that a type checker must refuse, or it does not see the package's types.
FAULTY = """\
import velodrome

velodrome.run(5)
velodrome.run("q2-plus", horizon=5.0)
velodrome.circular(0.005)
velodrome.Paraboloid("steep")
velodrome.no_such_name
wrong: int = velodrome.__version__
engine: velodrome.Engine = object()
"""


class Failure(Exception):
    """What the package falls short of."""


def call(*command: object, folder: Path, status: int = 0) -> str:
    """Run a program and return what it prints to stdout."""
    found = subprocess.run(
        [str(part) for part in command], cwd=folder, capture_output=True, text=True, timeout=_PATIENCE
    )
    if found.returncode != status:
        raise Failure(f"{' '.join(map(str, command))} ended with {found.returncode}\n{found.stdout}{found.stderr}")
    return found.stdout


def need(holds: bool, otherwise: str) -> None:
    """Fail with a line unless something holds."""
    if not holds:
        raise Failure(otherwise)


def contents(wheel: Path) -> dict[str, int]:
    """Files of a wheel with the checksums of what is in them."""
    with zipfile.ZipFile(wheel) as archive:
        return {entry.filename: entry.CRC for entry in archive.infolist() if not entry.filename.endswith("/RECORD")}


def build(work: Path) -> Path:
    """Build the sdist, the wheel from it and the wheel from the sources; the two must be the same."""
    tree = work / "tree"
    left_out = shutil.ignore_patterns(".*", "__pycache__", "*.egg-info", "build", "dist", "made", "runs", "sweeps")
    shutil.copytree(ROOT, tree, symlinks=True, ignore=left_out)
    call(sys.executable, "-m", "build", "--outdir", work / "dist", folder=tree)
    call(sys.executable, "-m", "build", "--wheel", "--outdir", work / "direct", folder=tree)
    (wheel,), (direct,) = (work / "dist").glob("*.whl"), (work / "direct").glob("*.whl")
    (sdist,) = (work / "dist").glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        links = [entry.name for entry in archive.getmembers() if entry.issym() or entry.islnk()]
    need(not links, f"{sdist.name} holds links: {links}")
    found = contents(wheel)
    need(found == contents(direct), "the wheel from the sdist is another than that from the sources")
    tops = {name.split("/")[0] for name in found}
    need(tops == {"velodrome", f"{wheel.name.split('-py3')[0]}.dist-info"}, f"the wheel holds {sorted(tops)}")
    for floor in FLOORS:
        packed = {name.removeprefix("velodrome/") for name in found if name.startswith(f"velodrome/{floor}/")}
        kinds = ("*.py", "*.toml", "*.json", "*.html", "*.css", "*.js")
        there = {str(path.relative_to(tree)) for kind in kinds for path in (tree / floor).rglob(kind)}
        need(packed == there, f"{floor}: packed and in the sources differ by {sorted(packed ^ there)}")
    need("velodrome/py.typed" in found, "py.typed is missing")
    return wheel


def install(work: Path, wheel: Path) -> Path:
    """Install the wheel in an empty environment; return its interpreter."""
    venv.create(work / "env", with_pip=True)
    python = work / "env" / "bin" / "python"
    pip = (python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-c", ROOT / "constraints.txt")
    call(*pip, wheel, folder=work)
    metadata = (
        "from importlib.metadata import distribution\n"
        "print('\\n'.join(sorted({file.parts[0] for file in distribution('velodrome').files})))"
    )
    tops = [top for top in call(python, "-c", metadata, folder=work).split() if not top.endswith(".dist-info")]
    # The command lies outside of site-packages.
    need(tops == ["..", "velodrome"], f"site-packages got {tops}")
    call(*pip, EXAMPLE, folder=work)
    copy_kernels(Path(call(python, "-c", "import velodrome; print(velodrome.__path__[0])", folder=work).strip()))
    return python


def copy_kernels(package: Path) -> None:
    """Give an installed package what has been compiled of the same sources, whose digests are in the files' names."""
    kernels = Path("reference", "kernels", "__pycache__", "kernels")
    if (ROOT / kernels).is_dir():
        shutil.copytree(ROOT / kernels, package / kernels)


def use(work: Path, python: Path) -> None:
    """Ride, check and run a script in a folder with folders of the floors' names."""
    here = work / "here"
    for floor in FLOORS:
        (here / floor).mkdir(parents=True)
        (here / floor / "__init__.py").write_text(FOREIGN)
    (here / "script.py").write_text(SCRIPT)
    (here / "own_kernel.py").write_text(KERNEL)
    command = python.with_name("velodrome")
    call(python, "script.py", folder=here)
    names = call(command, "--version", folder=here)
    need("symbrim" in names and names.startswith("velodrome "), f"--version says {names!r}")
    ride = call(command, "run", "q2-plus", "--engine", "mujoco-native", "--duration", "0.5", "--json", folder=here)
    (run,) = json.loads(ride)["runs"]
    need(list(run["engines"]) == ["reference", "mujoco-native"] and not run["failures"], ride)
    call(python, "-c", f"import velodrome; velodrome.load({run['folder']!r})", folder=here)
    call(command, "check", "plane-circle", "--engine", "mujoco-multipliers", folder=here)
    call(command, "run", "plane-circle", "--engine", "symbrim", "--duration", "0.5", folder=here)
    call(command, "check", "plane-circle", "--engine", "symbrim", "--baselines", EXAMPLE / "baselines", folder=here)


def check_types(work: Path, python: Path) -> None:
    """Let pyright and mypy pass the plug-in and find every fault of `FAULTY`, strictly, by an environment's types."""
    here = work / f"types-{python.parents[1].name}"
    here.mkdir()
    shutil.copy(PLUGIN, here / "plugin.py")
    (here / "faulty.py").write_text(FAULTY)
    (here / "pyrightconfig.json").write_text('{"typeCheckingMode": "strict"}')
    tools = Path(sys.executable).parent
    faults = {k for k, line in enumerate(FAULTY.splitlines(), 1) if line and not line.startswith("import")}
    pyright = (tools / "pyright", "--pythonpath", python)
    mypy = (tools / "mypy", "--strict", "--python-executable", python, "--cache-dir", here / "cache")
    call(*pyright, "plugin.py", folder=here)
    call(*mypy, "plugin.py", folder=here)
    found: Any = json.loads(call(*pyright, "--outputjson", "faulty.py", folder=here, status=1))
    seen = {entry["range"]["start"]["line"] + 1 for entry in found["generalDiagnostics"]}
    need(seen == faults, f"pyright finds faults in lines {sorted(seen)}, not {sorted(faults)}")
    text = call(*mypy, "faulty.py", folder=here, status=1)
    seen = {int(line.split(":")[1]) for line in text.splitlines() if ": error:" in line}
    need(seen == faults, f"mypy finds faults in lines {sorted(seen)}, not {sorted(faults)}")


def children_time() -> float:
    """CPU time of the programs that have been called [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> int:
    """Do all of it, and say how long each part takes."""
    with TemporaryDirectory(prefix="velodrome-wheel-") as name:
        work = Path(name)

        def do(what: str, part: Callable[..., Any], *arguments: Any) -> Any:
            begin, before = time.perf_counter(), children_time()
            result = part(work, *arguments)
            taken = time.perf_counter() - begin, children_time() - before
            print("{}: {:.0f} s, {:.0f} s of CPU time".format(what, *taken), flush=True)
            return result

        try:
            wheel = do("build", build)
            python = do("install", install, wheel)
            do("use", use, python)
            do("types of the wheel", check_types, python)
            do("types of the editable install", check_types, Path(sys.executable))
        except (Failure, subprocess.TimeoutExpired) as failure:
            print(f"tests/wheel.py: {failure}", file=sys.stderr)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
