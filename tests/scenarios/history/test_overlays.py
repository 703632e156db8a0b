"""What of a release's environment is laid over, and what is never loaded from elsewhere."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest
from numpy.random import _common

from velodrome.scenarios.history.requirements import RequirementConflict, find_suite_packages, resolve_needs

pytestmark = pytest.mark.once  # Python's own import system

# Any small compiled library.
COMPILED = _common.__file__
_PROBE = """
import sys
from collections.abc import Mapping
from pathlib import Path
from velodrome.scenarios.history.overlay import WrongRelease, lay_over, require_loaded_from, require_release
own = lay_over(Path(sys.argv[1]))
try:
    require_release(Path(sys.argv[1]), "mill", "2.0")
    {body}
    require_loaded_from(own)
except (WrongRelease, ImportError) as error:
    print(f"{{type(error).__name__}}: {{error}}")
else:
    print("right")
"""


def write_package(
    folder: Path, name: str, version: str, needs: str = "", modules: Mapping[str, str] | None = None
) -> None:
    """Write a package as pip would install it, with modules by their paths."""
    info = folder / f"{name}-{version}.dist-info"
    info.mkdir(parents=True)
    requires = f"Requires-Dist: {needs}\n" if needs else ""
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n{requires}")
    record = []
    for module, text in (modules or {}).items():
        path = folder / module
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        record.append(f"{path.relative_to(folder)},,\n")
    (info / "RECORD").write_text("".join(record))


@pytest.mark.parametrize("needs", ["numpy", "numpy>=1", "numpy; python_version < '3'", "absent; extra == 'all'"])
def test_what_the_suite_has_is_not_laid_over(needs: str, tmp_path: Path) -> None:
    write_package(tmp_path, "mill", "2.0", needs, {"mill.py": ""})
    assert resolve_needs(tmp_path, "mill").unmet == ()


def test_what_the_suite_has_not_is_laid_over(tmp_path: Path) -> None:
    write_package(tmp_path, "mill", "2.0", "mill-companion[fine]>=1.0", {"mill.py": ""})
    assert resolve_needs(tmp_path, "mill").unmet == ("mill-companion[fine]>=1.0",)


def test_a_companion_of_the_same_module_is_laid_over_although_the_suite_has_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_package(tmp_path / "suite", "mill-core", "2.0", "", {"mill/core.py": ""})
    write_package(tmp_path / "own", "mill", "2.0", "mill-core==2.0", {"mill/face.py": ""})
    monkeypatch.syspath_prepend(str(tmp_path / "suite"))
    assert resolve_needs(tmp_path / "own", "mill").unmet == ("mill-core==2.0",)


def test_what_the_reference_needs_is_never_replaced(tmp_path: Path) -> None:
    assert {"numpy", "scipy", "llvmlite"} <= find_suite_packages("mujoco")
    assert "mujoco-core" not in find_suite_packages("mujoco")
    write_package(tmp_path, "mill", "2.0", "numpy<1", {"mill.py": ""})
    with pytest.raises(RequirementConflict, match=r"mill needs numpy<1, and numpy is .* in the suite's environment"):
        resolve_needs(tmp_path, "mill")


@pytest.mark.parametrize(
    ("body", "told"),
    [
        ("import mill", "right"),
        ("import mill.face", "right"),
        ("pass", "WrongRelease: the engine loaded nothing of the release"),
        # The suite's own release has a module that this one has not.
        ("import mill.extra", "ModuleNotFoundError: No module named 'mill.extra' in the release"),
        (
            "import runpy, importlib.util as u; s = u.spec_from_file_location('mill.stray', OTHER / 'mill/extra.py'); "
            "m = u.module_from_spec(s); sys.modules['mill.stray'] = m",
            "WrongRelease: module mill.stray was loaded from",
        ),
    ],
)
def test_only_the_release_itself_is_loaded(body: str, told: str, tmp_path: Path) -> None:
    extending = "__path__ = __import__('pkgutil').extend_path(__path__, __name__)\n"
    write_package(tmp_path / "suite", "mill", "1.0", "", {"mill/__init__.py": extending, "mill/extra.py": ""})
    write_package(tmp_path / "own", "mill", "2.0", "", {"mill/__init__.py": extending, "mill/face.py": ""})
    found = probe(tmp_path, body)
    assert found.startswith(told)


def probe(tmp_path: Path, body: str, environment: Mapping[str, str] | None = None, before: str = "") -> str:
    """Lay the release in ``own`` over the one in ``suite``, in a process of its own, and run a line."""
    script = f"import sys; sys.path.insert(0, {str(tmp_path / 'suite')!r}); {before}\n" + _PROBE.format(
        body=body.replace("OTHER", f"Path({str(tmp_path / 'suite')!r})")
    )
    done = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path / "own")],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        env=os.environ | (environment or {}),
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_another_release_than_the_one_asked_for_is_seen(tmp_path: Path) -> None:
    write_package(tmp_path / "suite", "mill", "2.0", "", {"mill.py": ""})
    write_package(tmp_path / "own", "mill", "2.1", "", {"mill.py": ""})
    assert probe(tmp_path, "import mill").startswith("WrongRelease: mill 2.0 was asked for, and 2.1 in")


@pytest.mark.parametrize(
    ("body", "told"),
    [
        # Several packages share a namespace: what this release does not have of it is the others'.
        ("import shared.part, shared.other", "right"),
        (
            "import importlib.util as u; s = u.spec_from_file_location('shared.part', OTHER / 'shared/part.py'); "
            "sys.modules['shared.part'] = u.module_from_spec(s)",
            "WrongRelease: module shared.part was loaded from",
        ),
    ],
)
def test_of_a_namespace_only_what_the_release_has_must_be_its_own(body: str, told: str, tmp_path: Path) -> None:
    write_package(tmp_path / "suite", "other", "1.0", "", {"shared/other.py": "", "shared/part.py": ""})
    write_package(tmp_path / "own", "mill", "2.0", "", {"shared/part.py": ""})
    assert probe(tmp_path, body).startswith(told)


@pytest.mark.parametrize("variable", ["LD_LIBRARY_PATH", "LD_PRELOAD"])
def test_a_library_that_the_shell_puts_in_the_place_of_the_releases_is_seen(variable: str, tmp_path: Path) -> None:
    """The linker looks in the folders of these variables before those that a library names itself."""
    library = "libmill.so.1"
    write_package(tmp_path / "suite", "mill", "1.0", "", {"mill/__init__.py": ""})
    write_package(tmp_path / "own", "mill", "2.0", "", {"mill/__init__.py": ""})
    (tmp_path / "shell").mkdir()
    for folder in (tmp_path / "own" / "mill", tmp_path / "shell"):
        shutil.copyfile(COMPILED, folder / library)
    shell = {"LD_LIBRARY_PATH": str(tmp_path / "shell"), "LD_PRELOAD": str(tmp_path / "shell" / library)}
    loading = "import mill" if variable == "LD_PRELOAD" else f"import ctypes, mill; ctypes.CDLL({library!r})"
    found = probe(tmp_path, loading, {variable: shell[variable]})
    assert found.startswith(f"WrongRelease: {tmp_path / 'shell' / library}, of LD_LIBRARY_PATH or LD_PRELOAD, was")
    # What is found there and not loaded does no harm, nor does a folder that is not there.
    rightly = f"import ctypes, mill; ctypes.CDLL({str(tmp_path / 'own' / 'mill' / library)!r})"
    assert probe(tmp_path, rightly, {"LD_LIBRARY_PATH": f"{tmp_path / 'absent'}:{tmp_path / 'shell'}"}) == "right"


def test_of_a_package_that_the_suite_has_too_a_release_may_be_a_part(tmp_path: Path) -> None:
    """As MJX, a package of its own, is a part of MuJoCo's module, whose path is extended behind its own folder."""
    extending = "__path__ = __import__('pkgutil').extend_path(__path__, __name__)\n"
    suite = {"shared/__init__.py": extending, "shared/rest.py": "", "shared/part/__init__.py": "WHERE = 'suite'"}
    write_package(tmp_path / "suite", "mill", "1.0", "", suite | {"shared/part/gone.py": ""})
    write_package(tmp_path / "own", "mill", "2.0", "", {"shared/part/__init__.py": "WHERE = 'own'"})
    body = "import shared.part, shared.rest; assert shared.part.WHERE == 'own'"
    assert probe(tmp_path, body) == "right"
    assert probe(tmp_path, "import shared.part.gone").startswith("ModuleNotFoundError")


def test_path_files_of_the_environment_come_first(tmp_path: Path) -> None:
    write_package(tmp_path / "suite", "mill", "1.0", "", {"mill.py": "WHERE = 'suite'"})
    write_package(tmp_path / "own", "mill", "2.0", "", {"prefix/mill.py": "WHERE = 'own'"})
    (tmp_path / "own" / "mill.pth").write_text("prefix\n")
    assert probe(tmp_path, "import mill; assert mill.WHERE == 'own'") == "right"


def test_folders_of_the_environment_that_the_suites_path_files_have_added_come_first(tmp_path: Path) -> None:
    """As cmeel does: its path file adds a folder of every folder of the path, the suite's first."""
    write_package(tmp_path / "suite", "mill", "1.0", "", {"prefix/mill.py": "WHERE = 'suite'"})
    write_package(tmp_path / "own", "mill", "2.0", "", {"prefix/mill.py": "WHERE = 'own'"})
    adding = f"sys.path += [{str(tmp_path / 'suite' / 'prefix')!r}, {str(tmp_path / 'own' / 'prefix')!r}]"
    assert probe(tmp_path, "import mill; assert mill.WHERE == 'own'", before=adding) == "right"
