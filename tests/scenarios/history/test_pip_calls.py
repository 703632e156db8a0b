"""Calls of pip: what of its configuration counts, what was installed, and what its failures say."""

from __future__ import annotations

from pathlib import Path

import pytest
from mill import PACKAGE, make_wheel, use_registry

from velodrome.scenarios.files import file_digest
from velodrome.scenarios.history import Children, pip_calls
from velodrome.scenarios.history.pip_calls import (
    PipError,
    install_packages,
    list_registry_versions,
    select_pip_settings,
)

pytestmark = pytest.mark.once  # pip alone


def test_only_where_pip_looks_and_how_it_gets_there_counts() -> None:
    listed = [
        "global.extra-index-url='\\nhttps://one.invalid/simple\\nhttps://two.invalid/simple'",
        "global.constraint='pins.txt'",
        "global.cert='global.pem'",
        "install.cert='install.pem'",
        "install.target='elsewhere'",
        "freeze.find-links='never'",
        ":env:.dry-run='1'",
        ":env:.index-url=''",
        ":env:.no-index='1'",
        "no setting",
    ]
    assert select_pip_settings(listed) == {
        "PIP_EXTRA_INDEX_URL": "https://one.invalid/simple https://two.invalid/simple",
        "PIP_CERT": "install.pem",
        "PIP_NO_INDEX": "1",
    }


def test_what_would_change_an_installation_is_set_aside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    registry = tmp_path / "registry"
    use_registry(registry, monkeypatch)
    wheel = make_wheel(registry, "1.0")
    (tmp_path / "pins.txt").write_text(f"{PACKAGE}==9\n")
    (tmp_path / "wanted.txt").write_text("a-package-that-nobody-has\n")
    # Half of it in the environment, half in a file; each alone would spoil the installation or the list.
    for name, value in (("DRY_RUN", "1"), ("ROOT", tmp_path / "root"), ("REQUIREMENT", tmp_path / "wanted.txt")):
        monkeypatch.setenv(f"PIP_{name}", str(value))
    configuration = tmp_path / "pip.conf"
    configuration.write_text(
        f"[global]\nquiet = 3\nconstraint = {tmp_path / 'pins.txt'}\n"
        f"[install]\nrequire-hashes = true\nprefix = {tmp_path / 'prefix'}\n"
    )
    monkeypatch.setenv("PIP_CONFIG_FILE", str(configuration))
    children = Children()
    assert list_registry_versions(PACKAGE, False, children) == ["1.0"]
    found = install_packages([f"{PACKAGE}===1.0"], tmp_path / "there", children)
    assert found == {PACKAGE: file_digest(wheel)}
    assert (tmp_path / "there" / f"{PACKAGE}.py").is_file()
    assert not (tmp_path / "root").exists()
    assert not (tmp_path / "prefix").exists()


def test_a_fault_of_pip_itself_is_told_by_its_last_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = (
        "import sys\n"
        "print('ERROR: Exception:\\nTraceback (most recent call last):\\n  File x\\n"
        "OSError: [Errno 28] No space left on device', file=sys.stderr); sys.exit(2)"
    )
    (tmp_path / "pip.py").write_text(script)
    monkeypatch.setattr(pip_calls, "make_pip_environment", lambda _: {"PYTHONPATH": str(tmp_path)})
    with pytest.raises(PipError, match=r"^OSError: \[Errno 28\] No space left on device$"):
        list_registry_versions(PACKAGE, False, Children())
