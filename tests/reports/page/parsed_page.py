"""A page as its elements and their text, and what every page of the family keeps."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from itertools import pairwise
from typing import Any


class Parsed(HTMLParser):
    """Elements with their attributes, and their text."""

    VOID = ("meta", "link", "br", "input", "img", "line")

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.elements: list[tuple[str, dict[str, str | None], list[str]]] = []
        self._open: list[int] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs), []))
        if tag not in self.VOID:
            self._open.append(len(self.elements) - 1)

    def handle_endtag(self, tag: str) -> None:
        if tag not in self.VOID:
            assert self.elements[self._open.pop()][0] == tag, f"</{tag}> closes another element"

    def handle_data(self, data: str) -> None:
        for index in self._open:
            self.elements[index][2].append(data)

    def all(self, *tags: str) -> list[tuple[dict[str, str | None], str]]:
        return [(attrs, " ".join("".join(t).split())) for tag, attrs, t in self.elements if tag in tags]

    def data(self) -> dict[str, Any]:
        return next(json.loads(text) for attrs, text in self.all("script") if attrs.get("id") == "data")


def check_accessible_names(parsed: Parsed) -> None:
    """What a page needs to be read without eyes: headings in order, names of tables and figures, links that lead on."""
    levels = [int(tag[1]) for tag, _, _ in parsed.elements if re.fullmatch("h[1-6]", tag)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))
    assert len(parsed.all("caption")) == len(parsed.all("table"))
    assert all(attrs.get("scope") in ("row", "col") for attrs, _ in parsed.all("th"))
    ids = [attrs["id"] for _, attrs, _ in parsed.elements if "id" in attrs]
    assert len(ids) == len(set(ids))
    links = [(a.get("href") or "")[1:] for a, _ in parsed.all("a") if (a.get("href") or "").startswith("#")]
    named = [attrs["aria-labelledby"] for _, attrs, _ in parsed.elements if "aria-labelledby" in attrs]
    assert set(links) | set(named) <= set(ids)
    assert "main" in links  # past the header
    assert all(attrs.get("aria-label") for _, attrs, _ in parsed.elements if attrs.get("role") in ("img", "region"))
    assert next(attrs for tag, attrs, _ in parsed.elements if tag == "html").get("lang") == "en"


def check_static_page(page: str, hostile: str) -> Parsed:
    """A page without a script is whole, escapes what it shows, and loads nothing."""
    parsed = Parsed(page)
    assert page.startswith("<!doctype html>")
    assert not parsed.all("script")
    assert hostile not in page
    links = [attrs[key] or "" for _, attrs, _ in parsed.elements for key in ("src", "href") if attrs.get(key)]
    assert all(link.startswith(("#", "data:")) for link in links)
    assert "None" not in re.sub(r"<style>.*?</style>", "", page, flags=re.DOTALL)
    check_accessible_names(parsed)
    return parsed
