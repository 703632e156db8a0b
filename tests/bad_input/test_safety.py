"""What input and stored files may not do: write elsewhere, run code, become markup; and what is installed is known."""

from __future__ import annotations

import ast
import json
import re
import shutil
import tomllib
from collections.abc import Iterator
from functools import partial
from html.parser import HTMLParser
from importlib.metadata import EntryPoint, PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

import pytest
from complaints import refusing
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

from tests.sealing import sealed
from velodrome.engines import registry
from velodrome.reports.figures.precision import precision_figure
from velodrome.reports.figures.style import write_formats
from velodrome.reports.recording.summary import make_summary, make_verdict
from velodrome.scenarios.gate.ci_files import junit_xml, markdown_page
from velodrome.scenarios.gate.verdict import Verdict
from velodrome.scenarios.run.folder import new_folder, resolve_plan
from velodrome.scenarios.run.runner import plan_run, run_plan
from velodrome.scenarios.scenario.schema import LIBRARY, load_scenario
from velodrome.scenarios.view import viewing as view
from velodrome.scenarios.view.server import Content

ROOT = Path(__file__).parents[2]
PACKAGES = ("reference", "engines", "reports", "scenarios")
Q2 = (LIBRARY / "q2.toml").read_text(encoding="utf-8")

# Stems that a shell, an address or another system would take for another place.
STEMS = [
    "..",
    "...",
    ". .",
    "-rf",
    "--out",
    "a b",
    "a|b",
    "%2e%2e",
    "~",
    "$HOME",
    "`id`",
    "<b>",
    "é漢😀",
    "C:x",
    "a\\b",
]


@pytest.mark.parametrize("stem", STEMS)
def test_a_run_folder_stays_inside_the_output_folder(stem: str, tmp_path: Path) -> None:
    path = tmp_path / f"{stem}.toml"
    path.write_text(Q2)
    name, _ = load_scenario(str(path))
    assert name == stem
    folder = new_folder(tmp_path / "out", name)
    assert folder.resolve().parent == tmp_path.resolve() / "out"
    assert sorted(entry.name for entry in tmp_path.iterdir()) == sorted(["out", path.name])


@pytest.mark.parametrize("stem", ["..", "$x^{ <b> | `id`"])
def test_a_scenarios_name_stays_inside_the_output_folder(stem: str, tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    path = tmp_path / "in" / f"{stem}.toml"
    path.write_text(Q2)
    name, scenario = load_scenario(str(path), {"simulation.duration": 0.02})
    assert name == stem
    plan = plan_run(name, scenario, ["reference"])
    out = tmp_path / "a" / "runs"
    folder = run_plan(plan, out, lambda *_: None, lambda _: None).folder
    assert folder.resolve().parent == out.resolve()
    # Nothing but the folder, and in it what every run leaves.
    assert [entry.name for entry in out.iterdir()] == [folder.name]
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["a", "in"]
    assert sorted(entry.name for entry in (tmp_path / "in").iterdir()) == [path.name]
    names = {"scenario.toml", "manifest.json", "metrics.json", "reference.parquet", "comparison.rrd", "report.html"}
    assert {entry.name for entry in folder.iterdir()} == names
    assert load_scenario(str(folder / "scenario.toml"))[1] == resolve_plan(plan)


@pytest.mark.parametrize(
    "name",
    [
        "../x",
        "a/b",
        "/tmp/x",
        "..",
        ".",
        "",
        "a\\b",
        "a\nb",
        "a b",
        "-x",
        ".x",
        "é",
        "x" * 65,
        "sha256",
        "schema_version",
    ],
)
def test_an_engines_name_leads_no_file_elsewhere(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    bad = EntryPoint(name=name, value="velodrome.engines.lagrange:ENGINE", group=registry.ENTRY_POINT_GROUP)
    here = registry.list_entry_points(registry.ENTRY_POINT_GROUP)
    monkeypatch.setattr(registry, "list_entry_points", lambda group: [bad, *here])
    assert name not in registry.engine_names()
    with pytest.raises(ValueError, match="is not installed"):
        registry.load_engine(name)
    with refusing() as said:
        plan_run("q2", load_scenario("q2", {f"engines.{name}": {}} if "." not in name else None)[1], [name])
    assert said


def calls(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module == "yaml":
            # Its safe_load makes plain values only.
            yield from ("yaml" for alias in node.names if alias.name not in ("safe_load", "YAMLError"))
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield (node.module or "").partition(".")[0]
        elif isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            # A method of that name, such as a regular expression's, is another matter.
            if name in ("eval", "exec", "compile", "__import__") and isinstance(node.func, ast.Name):
                yield name
            if name in ("read_pickle", "unsafe_load"):
                yield name
            yield from (word.arg for word in node.keywords if word.arg in ("allow_pickle", "shell"))


# What the same session writes for its own processes, in a temporary folder that nobody else can write, is read only if
# it has the digest that the process is told through a pipe. Compiled kernels are code, like the sources beside them.
OWN_PICKLES = {"scenarios/history/problems.py": {"pickle"}, "reference/kernels/cache.py": {"pickle"}}


@pytest.mark.parametrize("package", PACKAGES)
def test_no_file_is_run_as_code(package: str) -> None:
    forbidden = {
        *("pickle", "cPickle", "_pickle", "dill", "cloudpickle", "joblib", "marshal", "shelve", "dbm", "yaml"),
        *("eval", "exec", "compile", "__import__", "read_pickle", "unsafe_load", "allow_pickle", "shell"),
    }
    paths = sorted((ROOT / package).rglob("*.py"))
    assert paths
    for path in paths:
        used = set(calls(ast.parse(path.read_text(encoding="utf-8")))) & forbidden
        used -= OWN_PICKLES.get(path.relative_to(ROOT).as_posix(), set())
        assert not used, f"{path}: {used}"


def test_such_code_would_be_seen() -> None:
    text = (
        "import pickle, os.path\nfrom marshal import loads\nnp.load(f, allow_pickle=True)\neval('1')\nre.compile('x')\n"
    )
    assert set(calls(ast.parse(text))) == {"pickle", "os", "marshal", "allow_pickle", "eval"}


def test_a_link_in_a_run_folder_is_not_served(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(view, "viewer_files", lambda: {"": Content("text/html", b"")})
    folder = tmp_path / "run"
    folder.mkdir()
    for name in (view.RECORDING, view.REPORT):
        (folder / name).write_text("")
    (tmp_path / "secret.txt").write_text("secret")
    (folder / "link.txt").symlink_to(tmp_path / "secret.txt")
    with view.page_server(folder, 0) as server:
        assert sorted(server.files) == [view.RECORDING, view.REPORT]


class Seen(HTMLParser):
    """Names of all elements and of all their attributes."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: set[str] = set()
        self.attributes: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.attributes |= {name for name, _ in attrs}


MARKUP = "\"><wbr onerror=x>'><wbr></script><wbr></style><wbr><!--<wbr>{{ 7 }}<wbr>&lt;wbr&gt;"


def test_no_text_of_a_run_is_markup_in_its_page(tmp_path: Path) -> None:
    changes = {"title": MARKUP, "tags": [MARKUP], "simulation.duration": 0.02}
    plan = plan_run("a<wbr>", load_scenario("q2", changes)[1], ["reference"])
    folder = run_plan(plan, tmp_path, lambda *_: None, lambda _: None).folder
    clean = Seen((folder / "report.html").read_text(encoding="utf-8"))
    assert "wbr" not in clean.tags
    assert "onerror" not in clean.attributes
    # And of a folder that somebody else has written: every text in every document.
    copied = Path(shutil.copytree(folder, tmp_path / "theirs"))
    for name in ("manifest.json", "metrics.json"):
        document = json.loads((copied / name).read_text())
        (copied / name).write_text(sealed(hostile(document)))
    theirs = Seen(view.stored_page(copied))
    assert "wbr" not in theirs.tags
    assert "onerror" not in theirs.attributes


def hostile(document: object) -> object:
    """A document with markup at the end of each of its texts, but for a date and a digest, which are checked."""
    if isinstance(document, dict):
        return {
            key: value if key in ("created", "scenario_sha256") else hostile(value) for key, value in document.items()
        }
    if isinstance(document, list):
        return [hostile(value) for value in document]
    return document + MARKUP if isinstance(document, str) else document


def test_no_text_of_a_verdict_is_markup_in_junit_xml() -> None:
    verdict = Verdict(MARKUP, MARKUP, None, None, None, "missing", f"{MARKUP}\x00\x1b\n")
    assert "<wbr" not in junit_xml([(MARKUP, verdict)])


def markup(page: str) -> str:
    """What of a page of Markdown is left to be a sign: letters behind a backslash are none."""
    return re.sub(r"\\.", "", page)


def test_no_text_of_a_run_is_markup_in_markdown() -> None:
    name = f"[a](http://b)![c](d)`{MARKUP}|"
    verdict = Verdict(name, "steps", None, None, None, "missing", name)
    unmeasured = dict.fromkeys(("fell_at", "friction_left_at", "min_normal_force", "ended", "contact_force_error_at"))
    measured = {name: {**unmeasured, "horizon": None, "ended": name, "not_finite": []}}
    pages = [
        markdown_page([(name, verdict)]),
        make_summary(name, measured, {name: name}, [], -1.0, 1.0),
        make_verdict(measured, {name: name}, [{"engine": name, "quantity": name, "limit": 1.0, "holds": False}], 1.0),
    ]
    for page in pages:
        left = markup(page)
        assert "<" not in left
        assert "](" not in left
        assert "`" not in left.replace("`reference`", "")
        assert "\n\n\n" not in page


def test_a_files_name_is_no_formula_in_a_figure(tmp_path: Path) -> None:
    document = {"scenario": "$\\frac{$", "duration": 1.0, "horizon": None, "engines": {}}
    write_formats(tmp_path / "a", partial(precision_figure, document))
    assert (tmp_path / "a.png").stat().st_size > 0


def test_every_installed_requirement_is_pinned() -> None:
    """The requirements of the suite and its extras, with all of theirs, against the lists of versions."""
    pins = read_pins("constraints.txt") | read_pins("constraints-engines.txt")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    # What only a benchmark compares with may be absent.
    asked = [*project["dependencies"], *(line for extra in extras.values() for line in extra)]
    found = dict(installed([Requirement(line) for line in asked]))
    assert {canonicalize_name(Requirement(line).name) for line in project["dependencies"]} <= set(found)
    lowest = read_pins("constraints-lowest.txt")
    if {name: found.get(name) for name in lowest} == lowest:
        pytest.skip("the environment of the lowest versions, of which constraints-lowest.txt pins the direct ones")
    wrong = {name: version for name, version in found.items() if pins.get(name) != version}
    in_benchmark = dict(installed([Requirement(line) for line in extras.get("benchmark", [])]))
    # An extra may consist of others of the suite's own.
    wrong = {name: version for name, version in wrong.items() if name not in in_benchmark and name != "velodrome"}
    assert not wrong, f"installed, but not pinned so: {wrong}"


def engine_extras(project: dict[str, Any]) -> set[str]:
    """The extras that entry points of engines name, that of an importer of models, and the one with all of them."""
    points = project["entry-points"]["velodrome.engines"].values()
    return {"engines", "newton", *(extra for point in points for extra in re.findall(r"\[(.*)\]", point))}


def test_all_libraries_of_engines_are_in_one_extra() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    single = engine_extras(project) - {"engines"}
    assert sorted(extras["engines"]) == [f"velodrome[{','.join(sorted(single))}]"]


def read_pins(file: str) -> dict[str, str]:
    pins = {}
    for line in (ROOT / file).read_text().splitlines():
        name, equals, version = line.partition("==")
        assert equals, line
        pins[canonicalize_name(name)] = version.strip()
    return pins


def test_lower_bounds_are_the_versions_that_are_tested() -> None:
    """Every direct dependency, at its lower bound in pyproject.toml and nothing else in constraints-lowest.txt.

    Libraries of engines that are extras are tested in their pinned versions alone, which are large to install.
    """
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    libraries = engine_extras(project)
    extras = {extra: lines for extra, lines in project["optional-dependencies"].items() if extra not in libraries}
    # Linters, what builds the package and what builds the documentation run in the pinned environment alone: they have
    # no bound.
    pinned = {line for extra in ("dev", "docs") for line in extras[extra] if not Requirement(line).specifier}
    bounds: dict[str, set[Version]] = {}
    for line in (*project["dependencies"], *(line for extra in extras.values() for line in extra)):
        if line in pinned:
            continue
        required = Requirement(line)
        (bound,) = required.specifier
        assert bound.operator == ">=", line
        bounds.setdefault(canonicalize_name(required.name), set()).add(Version(bound.version))
    lowest = {name: {Version(version)} for name, version in read_pins("constraints-lowest.txt").items()}
    assert lowest == bounds


def installed(requirements: list[Requirement]) -> Iterator[tuple[str, str]]:
    """Names and versions of the installed packages among requirements, and of all that these require."""
    todo, seen = [(one.name, frozenset(one.extras)) for one in requirements], set()
    while todo:
        name, extras = todo.pop()
        if (name, extras) in seen:
            continue
        seen.add((name, extras))
        try:
            found = distribution(name)
        except PackageNotFoundError:
            continue
        yield canonicalize_name(name), found.version
        for line in found.requires or []:
            required = Requirement(line)
            marker = required.marker
            if marker is None or any(marker.evaluate({"extra": extra}) for extra in (*extras, "")):
                todo.append((required.name, frozenset(required.extras)))


@pytest.mark.parametrize("file", ["constraints.txt", "constraints-lowest.txt", "constraints-engines.txt"])
def test_pins_are_exact(file: str) -> None:
    lines = (ROOT / file).read_text().splitlines()
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+==[0-9][A-Za-z0-9.+!]*", line) for line in lines)
    assert len({canonicalize_name(line.partition("==")[0]) for line in lines}) == len(lines)
