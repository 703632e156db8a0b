"""Public names: no two things share one, and what the public face lists is there and is described."""

from __future__ import annotations

import ast
import inspect
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

import pytest

import velodrome

pytestmark = pytest.mark.once  # names alone

ROOT = Path(__file__).parents[1]
FLOORS = ("reference", "engines", "reports", "scenarios")
# Names that stand more than once, of things that mean the same.
SAME_MEANING = {
    "main": "what a module does that is run as a program",
    # Kernels that compute, one state or one frame at a time, what the function of that name gives.
    "angular_velocities": "of the bicycle's bodies",
    "contact_forces": "of the ground on the wheels: in one state, and along a ride",
    "metric": "of the arclength along a family",
    "residual": "of the equations of motion",
    "solve": "linear equations: of any matrix, and of the reduced system",
}


def public_definitions() -> dict[str, list[str]]:
    """Names of public classes and functions at the top of the floors' modules, with the files that define them."""
    found = defaultdict(list)
    for floor in FLOORS:
        for path in sorted((ROOT / floor).rglob("*.py")):
            for node in ast.parse(path.read_text(encoding="utf-8")).body:
                if isinstance(node, ast.ClassDef | ast.FunctionDef) and not node.name.startswith("_"):
                    found[node.name].append(str(path.relative_to(ROOT)))
    return found


def test_no_two_public_classes_or_functions_share_a_name() -> None:
    found = public_definitions()
    assert len(found) > 300, "the floors were not read"
    repeated = {name: files for name, files in found.items() if len(files) > 1}
    assert {name: files for name, files in repeated.items() if name not in SAME_MEANING} == {}
    assert set(SAME_MEANING) <= set(repeated), "an exception that is none any more"


@pytest.mark.parametrize("name", sorted(set(velodrome.__all__) - {"__version__"}))
def test_what_the_face_lists_is_there_and_described(name: str) -> None:
    documentation = inspect.getdoc(getattr(velodrome, name))
    assert documentation
    first = documentation.splitlines()[0]
    assert first.endswith((".", ":")), first


def test_the_face_lists_each_name_once_in_order() -> None:
    assert velodrome.__all__ == sorted(set(velodrome.__all__))
    assert dir(velodrome) == velodrome.__all__
    assert velodrome.__version__


def test_type_checkers_see_the_names_that_the_face_lists() -> None:
    """The block for type checkers and what is imported at run time hold the same names, from the same modules."""
    source = ast.parse((ROOT / "src" / "velodrome" / "__init__.py").read_text(encoding="utf-8"))
    block = next(node for node in source.body if isinstance(node, ast.If))
    seen = {}
    for node in block.body:
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                seen[alias.asname] = f".{node.module}"
    assert set(seen) == set(velodrome.__all__) - {"__version__"}
    for name, module in seen.items():
        home = inspect.getmodule(getattr(velodrome, name))
        assert home is not None
        # A room's face stands for its modules.
        assert home.__name__.startswith(f"velodrome{module}"), name


def test_a_name_that_there_is_not_is_refused() -> None:
    with pytest.raises(AttributeError, match="no attribute 'warp'"):
        velodrome.warp  # type: ignore[attr-defined]  # noqa: B018  # pyright: ignore


def test_importing_the_face_loads_nothing_and_changes_nothing() -> None:
    """Neither numba nor numpy is loaded, and signals, folder, streams and environment are as before."""
    code = (
        "import os, signal, sys\n"
        "def state():\n"
        "    return dict(os.environ), os.getcwd(), signal.getsignal(signal.SIGINT), sys.stdout, list(sys.path)\n"
        "before = state()\n"
        "import velodrome\n"
        "assert state() == before\n"
        "others = {name.split('.')[0] for name in sys.modules} & {'numba', 'numpy', 'pydantic', 'mujoco', 'exudyn'}\n"
        "assert not others, others\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def test_numba_is_the_users_own_after_everything_was_imported() -> None:
    code = (
        "from numba.core import config\n"
        "before = config.CACHE_DIR\n"
        "import velodrome\n"
        "[getattr(velodrome, name) for name in velodrome.__all__]\n"
        "assert config.CACHE_DIR == before\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)
