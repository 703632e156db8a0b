"""Rooms: folders of `scenarios` and `reports`, each of which the others see through its face alone.

The order of floors and rooms is held by import-linter, see ``pyproject.toml``.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest

pytestmark = pytest.mark.once  # imports alone

ROOT = Path(__file__).parents[1]
FLOORS = ("reference", "engines", "reports", "scenarios")
ROOMS = {
    (floor, folder.name)
    for floor in ("reports", "scenarios")
    for folder in (ROOT / floor).iterdir()
    if (folder / "__init__.py").is_file()
}
# Arrows between the rooms of `scenarios`: with every room on every other one there would be a hundred.
MOST_ARROWS = 34


@dataclass(frozen=True)
class Import:
    """An import of the package: by what file, the module's name below the package, and what is taken from it."""

    by: Path
    module: tuple[str, ...]
    name: str | None = None

    @property
    def room(self) -> tuple[str, ...]:
        parts = self.module if self.name is None else (*self.module, self.name)
        return parts[:2]

    @property
    def own_room(self) -> tuple[str, ...]:
        return self.by.relative_to(ROOT).parts[:2]


def imports(path: Path) -> Iterator[Import]:
    """All imports of the package's modules in a file, those within functions too."""
    package = ("velodrome", *path.relative_to(ROOT).parent.parts)
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            for alias in node.names:
                top, *module = alias.name.split(".")
                if top == "velodrome":
                    yield Import(path, tuple(module))
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            top, *module = (*base, *(node.module or "").split("."))
            if top == "velodrome":
                for alias in node.names:
                    yield Import(path, tuple(part for part in module if part), alias.name)


def sources(*folders: str) -> list[Path]:
    return [path for folder in folders for path in sorted((ROOT / folder).rglob("*.py"))]


@cache
def face(room: tuple[str, ...]) -> tuple[set[str], set[str]]:
    """What the face of a room imports, at once or when it is first used, and what it lists."""
    tree = ast.parse(ROOT.joinpath(*room, "__init__.py").read_text(encoding="utf-8"))
    typing = [node for one in tree.body if isinstance(one, ast.If) for node in one.body]
    own = [node for node in [*tree.body, *typing] if isinstance(node, ast.ImportFrom) and node.level]
    had = {alias.name for node in own for alias in node.names if not (alias.asname or "").startswith("_")}
    (listed,) = [
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and [ast.unparse(target) for target in node.targets] == ["__all__"]
    ]
    return had, set(listed)


def passes_by_a_face(found: Import) -> bool:
    """Whether an import from outside a room takes an inner module, or what the room's face does not list."""
    if found.room not in ROOMS or found.room == found.own_room:
        return False
    if len(found.module) > 2:
        return True
    return len(found.module) == 2 and found.name is not None and found.name not in face(found.room)[1]


def test_there_are_rooms() -> None:
    assert {("scenarios", "run"), ("scenarios", "gate"), ("reports", "measure")} <= ROOMS
    assert len(sources(*FLOORS)) > 200


@pytest.mark.parametrize(
    ("line", "passes"),
    [
        ("from ..run.runner import run_plan", True),
        ("from ..run import runner", True),
        ("import velodrome.scenarios.run.runner", True),
        ("from velodrome.reports.measure.fall import fell_at", True),
        ("from ..run import run_plan", False),
        ("from ..error import ScenarioError", False),
        ("from .verdict import Verdict", False),
    ],
)
def test_what_passes_by_a_face_is_told(line: str, passes: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    path = ROOT / "scenarios" / "gate" / "sample.py"
    monkeypatch.setattr(Path, "read_text", lambda *_, **__: line)
    (found,) = imports(path)
    monkeypatch.undo()
    assert passes_by_a_face(found) == passes


def test_rooms_are_entered_through_their_faces() -> None:
    found = [one for path in sources(*FLOORS, "src/velodrome", "examples") for one in imports(path)]
    assert [f"{one.by.relative_to(ROOT)}: {'.'.join(one.module)}" for one in found if passes_by_a_face(one)] == []


def test_faces_list_what_they_import() -> None:
    for room in sorted(ROOMS):
        had, listed = face(room)
        assert had == listed, room


def test_faces_that_import_late_find_each_name_where_they_say() -> None:
    late = [room for room in sorted(ROOMS) if "TYPE_CHECKING" in ROOT.joinpath(*room, "__init__.py").read_text()]
    assert ("scenarios", "scenario") in late
    for room in late:
        package = import_module(".".join(("velodrome", *room)))
        tree = ast.parse(ROOT.joinpath(*room, "__init__.py").read_text(encoding="utf-8"))
        (block,) = [one for one in tree.body if isinstance(one, ast.If) and ast.unparse(one.test) == "TYPE_CHECKING"]
        for node in block.body:
            assert isinstance(node, ast.ImportFrom)
            for alias in node.names:
                home = import_module(f"{package.__name__}.{node.module}")
                assert getattr(package, alias.name) is getattr(home, alias.name), (room, alias.name)
        with pytest.raises(AttributeError, match="no attribute 'nothing'"):
            _ = package.nothing


def test_the_rooms_of_scenarios_know_few_of_each_other() -> None:
    arrows = {(one.own_room, one.room) for path in sources("scenarios") for one in imports(path)}
    between = {(a, b) for a, b in arrows if a != b and {a, b} <= ROOMS and b[0] == "scenarios"}
    assert 10 < len(between) < MOST_ARROWS, sorted(between)
