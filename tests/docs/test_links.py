"""Links of the sources lead somewhere, and the built site is whole, without a warning and without a network."""

from __future__ import annotations

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from generated import fill_page
from pages import DOCS, ROOT, source_pages

pytestmark = pytest.mark.once  # text alone

_LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
_INCLUDE = re.compile(r"^```\{include\} (\S+)\n```$", re.MULTILINE)


def read_page(page: Path) -> str:
    """A page as it is built: filled, with what it includes, without its blocks."""
    text = _INCLUDE.sub(lambda mark: (page.parent / mark[1]).read_text(encoding="utf-8"), page.read_text("utf-8"))
    return re.sub(r"^(`{3,}).*?^\1$", "", fill_page(text), flags=re.DOTALL | re.MULTILINE)


def anchors(page: Path) -> set[str]:
    text = read_page(page)
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    slugs = {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}
    return slugs | set(re.findall(r"^\(([\w-]+)\)=$", text, re.MULTILINE))


@pytest.mark.parametrize("page", source_pages(), ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_of_a_page_leads_somewhere(page: Path) -> None:
    for link in _LINK.findall(read_page(page)):
        place, _, anchor = link.partition("#")
        if re.match(r"[a-z]+:", place):
            continue
        target = (page.parent / place).resolve() if place else page
        assert target.exists(), link
        if anchor:
            assert anchor in anchors(target), link


def test_every_page_is_in_the_tree_of_contents() -> None:
    named: set[Path] = set()
    for page in source_pages():
        for tree in re.findall(r"```\{toctree\}\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
            named |= {(page.parent / f"{line}.md").resolve() for line in tree.split() if not line.startswith(":")}
    assert named == {page for page in source_pages() if page.is_relative_to(DOCS)} - {DOCS / "index.md"}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site as `make docs` builds it."""
    pytest.importorskip("sphinx")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html", "-d", folder / "doctrees"]
    done = subprocess.run([*command, DOCS, folder / "html"], capture_output=True, text=True, timeout=900, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return folder / "html"


class _Reader(HTMLParser):
    """Collects the identifiers, the links and what is loaded of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.identifiers: set[str] = set()
        self.links: list[str] = []
        self.loaded: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value for name, value in attrs if value}
        if "id" in values:
            self.identifiers.add(values["id"])
        if tag == "a" and "href" in values:
            self.links.append(values["href"])
        if "src" in values:
            self.loaded.append(values["src"])
        if tag == "link" and "href" in values and values.get("rel") != "canonical":
            self.loaded.append(values["href"])


def read_built(page: Path) -> _Reader:
    reader = _Reader()
    reader.feed(page.read_text(encoding="utf-8"))
    return reader


@pytest.mark.slow
def test_the_built_site_is_whole_and_loads_nothing_from_elsewhere(site: Path) -> None:
    pages = {page: read_built(page) for page in site.rglob("*.html") if "_static" not in page.parts}
    assert len(pages) > len(source_pages())
    for page, reader in pages.items():
        for link in reader.loaded:
            assert not urlsplit(link).scheme, f"{page.name} loads {link}"
            assert (page.parent / unquote(urlsplit(link).path)).exists(), f"{page.name}: {link}"
        for link in reader.links:
            parts = urlsplit(link)
            if parts.scheme:
                continue
            target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            assert target.exists(), f"{page.name}: {link}"
            if parts.fragment and target in pages:
                assert unquote(parts.fragment) in pages[target].identifiers, f"{page.name}: {link}"


@pytest.mark.slow
def test_formulas_are_in_the_built_page(site: Path) -> None:
    source = read_page(DOCS / "theory.md")
    blocks_shown = re.findall(r"^\$\$\n.*?^\$\$", source, re.DOTALL | re.MULTILINE)
    inline = re.findall(r"\$[^$\n]+\$", re.sub(r"^\$\$\n.*?^\$\$", "", source, flags=re.DOTALL | re.MULTILINE))
    assert len(blocks_shown) > 10
    text = (site / "theory.html").read_text(encoding="utf-8")
    # Inline formulas may be broken over two lines of the source.
    assert text.count('display="block"') == len(blocks_shown)
    assert text.count('display="inline"') >= len(inline) > 30
    assert not re.search(r"<script[^>]*mathjax", text, re.IGNORECASE)
    assert not re.search(r"\\(dot|alpha|omega|frac)\b", text)  # nothing is left of LaTeX
