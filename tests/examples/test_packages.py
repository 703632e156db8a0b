"""Packages of engines in `examples/`, read without their libraries: what they announce, tell to type and commit."""

from __future__ import annotations

import ast
import re
import shlex
import tomllib
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import pytest
import typer

from velodrome.engines.registry import ENTRY_POINT_GROUP
from velodrome.scenarios.cli import app
from velodrome.scenarios.gate.checks import read_baseline

SUITE = Path(__file__).parents[2]
PACKAGES = sorted(path.parent for path in (SUITE / "examples").glob("velodrome-*/pyproject.toml"))


@pytest.fixture(params=PACKAGES, ids=lambda package: package.name)
def package(request: pytest.FixtureRequest) -> Path:
    return request.param


def read_project(package: Path) -> dict[str, Any]:
    return tomllib.loads((package / "pyproject.toml").read_text(encoding="utf-8"))


def read_engines(package: Path) -> dict[str, str]:
    return read_project(package)["project"]["entry-points"][ENTRY_POINT_GROUP]


def read_commands(package: Path) -> list[str]:
    guide = (package / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```sh\n(.*?)^```$", guide, re.DOTALL | re.MULTILINE)
    return [str(line) for line in "".join(blocks).splitlines()]


def test_there_are_packages() -> None:
    assert [path.name.removeprefix("velodrome-") for path in PACKAGES] == ["bullet", "dart", "jiminy", "symbrim"]


def test_a_package_announces_the_engine_that_it_has(package: Path) -> None:
    suite = tomllib.loads((SUITE / "pyproject.toml").read_text(encoding="utf-8"))
    project = read_project(package)
    for name, value in read_engines(package).items():
        point = EntryPoint(name, value, ENTRY_POINT_GROUP)
        source = ast.parse((package / f"{point.module.replace('.', '/')}.py").read_text(encoding="utf-8"))
        targets = [target for node in source.body if isinstance(node, ast.Assign) for target in node.targets]
        assert point.attr in [target.id for target in targets if isinstance(target, ast.Name)]
        assert project["tool"]["setuptools"]["packages"] == [point.module.split(".")[0]]
        assert name not in suite["project"]["entry-points"][ENTRY_POINT_GROUP]


def test_a_package_s_commands_exist(package: Path) -> None:
    commands = read_commands(package)
    assert commands
    group: Any = typer.main.get_command(app)
    for command in commands:
        for word in shlex.split(command):
            if word.startswith(("examples/", "constraints")):
                assert (SUITE / word).exists(), word
        if command.startswith("velodrome "):
            words = shlex.split(command)[1:]
            name, chosen, rest = group.resolve_command(group.make_context("velodrome", list(words)), words)
            chosen.make_context(name, rest)  # raises on an option that there is not


def test_the_rides_that_a_package_gates_have_its_baselines(package: Path) -> None:
    (engine,) = read_engines(package)
    checks = [shlex.split(line) for line in read_commands(package) if line.startswith("velodrome check ")]
    rides = sorted({word for words in checks for word in words[2 : words.index("--engine")]})
    assert rides == sorted(path.stem for path in (package / "baselines").glob("*.json"))
    for ride in rides:
        assert list(read_baseline(ride, package / "baselines")) == [engine]


def test_libraries_are_pinned() -> None:
    """At least at the versions that the packages ask for; symbrim is an extra of the suite."""
    pinned = {}
    for file in ("constraints-packages.txt", "constraints-jiminy.txt"):
        for line in (SUITE / file).read_text(encoding="utf-8").splitlines():
            name, equals, version = line.partition("==")
            assert equals, line
            pinned[name.lower()] = version
    for package in PACKAGES:
        for line in read_project(package)["project"]["dependencies"]:
            name, _, bound = line.partition(">=")
            if name in ("jiminy-py", "dartpy", "pybullet"):
                assert pinned[name].startswith(bound), line
