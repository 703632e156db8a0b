"""What commands print, letter by letter: at 60, 80 and 120 columns, into a pipe and on a terminal with its colours.

The documents shown are those of ``stored/``, so that nothing is computed. After a change that is meant, write the
snapshots anew with ``REFRESH_SNAPSHOTS=1 python -m pytest tests/scenarios/commands/test_snapshots.py`` and read the
difference.
"""

from __future__ import annotations

import io
import json
import os
import re
import sys
from collections.abc import Callable
from typing import Any

import pytest
from rich.console import Console
from stored_documents import HERE, show_stored_run, stored

from velodrome.scenarios.commands.present_basin import show_basin
from velodrome.scenarios.commands.present_bifurcations import show_bifurcations
from velodrome.scenarios.commands.present_diff import show_diff
from velodrome.scenarios.commands.present_gate import show_verdicts
from velodrome.scenarios.commands.present_history import show_history
from velodrome.scenarios.commands.present_league import show_league
from velodrome.scenarios.commands.present_motions import show_circular, show_critical, show_families
from velodrome.scenarios.commands.present_paper import show_ledger
from velodrome.scenarios.commands.present_precision import show_precision
from velodrome.scenarios.commands.present_show import show_document
from velodrome.scenarios.commands.present_sweep import show_summary
from velodrome.scenarios.commands.run import show_list
from velodrome.scenarios.gate import Verdict
from velodrome.scenarios.paper.ledger import SelfCheck, below, claim_line, figure_line, source

WIDTHS = (60, 80, 120)
COLOURED = 80  # width of the coloured snapshot
CODES = re.compile(r"\x1b\[([0-9;]*)m")
POWER = re.compile(r"(?<![\w.])-?\d\.\d+e([+-]\d\d)(?!\w)")
# Lines that are to be copied are as long as they are.
COPIED = ("run folder: ", "report: ", "recording: ", "data set: ", "continue with: ", "not installed: ")

Show = Callable[[Console], None]


def show_gate(name: str) -> Show:
    def show(console: Console) -> None:
        verdicts = [(row.pop("scenario"), Verdict(**row)) for row in stored(name)]
        show_verdicts(console, verdicts)

    return show


def show_paper(console: Console) -> None:
    seen = source("something", json.dumps)
    known = SelfCheck("residual of the equations", 1e-14, 1e-12)
    near, far = below("distance from the cusp", 1e-7, 2e-3, "m"), below("distance from the cusp", 0.3, 2e-3, "m")
    lines = [
        figure_line("3", "the rear rate of Q2", "17.2", 17.2122, 1e-12, seen),
        figure_line("3", "the steer angle of Q2", "2.78", 2.7857, 1e-12, seen),
        claim_line("4.2", "the cusps of families 2 and 4 meet", [near], "they meet", seen, [known]),
        claim_line("5", "the circles of family 3 can be ridden", [far], "none can", seen, [known]),
    ]
    show_ledger(console, lines, [], whole=True)
    show_ledger(console, lines, ["5: the circles of family 3 can be ridden: does not hold, though known to"])


SHOWN: dict[str, Show] = {
    "list": lambda console: show_list(console, **stored("list")),
    "show": lambda console: show_document(console, stored("show")),
    "run": lambda console: show_stored_run(console, stored("run")),
    "precision": lambda console: show_precision(console, stored("precision")),
    "league": lambda console: show_league(console, stored("league")),
    "diff": lambda console: show_diff(console, stored("diff")),
    "check": show_gate("check"),
    "check-new": show_gate("check-new"),
    "sweep": lambda console: show_summary(console, stored("sweep"), "velodrome sweep a.toml --out a --resume"),
    "history": lambda console: show_history(console, stored("history")),
    "circular": lambda console: show_circular(console, stored("circular")),
    "families": lambda console: show_families(console, stored("families")),
    "paper": show_paper,
    "critical": lambda console: show_critical(console, stored("critical")),
    "bifurcations": lambda console: show_bifurcations(console, stored("bifurcations")),
    "basin": lambda console: show_basin(console, stored("basin")),
}
ENGINES: dict[str, Any] = {
    "run": stored("run")["metrics"],
    "list": [entry["name"] for entry in stored("list")["engines"]],
    "precision": stored("precision")["engines"],
    "league": stored("league")["engines"],
    "diff": stored("diff")["engines"],
    "check": {row["engine"] for row in stored("check")},
    "sweep": stored("sweep")["engines"],
    "history": {row["engine"] for row in stored("history")["releases"]},
}


def printed(name: str, width: int, **kind: Any) -> str:
    """What a command prints into a pipe, or on the ``kind`` of terminal."""
    file = io.StringIO()
    SHOWN[name](Console(file=file, width=width, highlight=False, **kind))
    return file.getvalue()


def picture(name: str, width: int, colours: bool = False) -> str:
    """What a terminal shows, with the codes of colours in sight, without the spaces that fill tables."""
    kind = {"color_system": "standard"} if colours else {"color_system": None}
    text = printed(name, width, force_terminal=True, **kind)
    lines = [re.sub(r"( |\x1b\[0m)*$", "", line) for line in text.splitlines()]
    shown = CODES.sub(lambda code: f"<{code[1]}>", "\n".join(lines))
    # Where a colour ends and begins again, it goes on.
    while (joined := re.sub(r"<([\d;]+)>([^<\n]*)<0><\1>", r"<\1>\2", shown)) != shown:
        shown = joined
    return re.sub(r" +$", "", shown, flags=re.MULTILINE)


def snapshot(name: str) -> str:
    parts = [("pipe", re.sub(r" +$", "", printed(name, 80), flags=re.MULTILINE).rstrip("\n"))]
    parts += [(f"terminal of {width} columns", picture(name, width)) for width in WIDTHS]
    parts.append((f"terminal of {COLOURED} columns, with colours", picture(name, COLOURED, colours=True)))
    return "\n".join(f"{f'=== {title} ':=<120}\n{text}" for title, text in parts) + "\n"


@pytest.mark.parametrize("name", SHOWN)
def test_what_is_printed_is_as_stored(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/suite/bin/python")  # beside it is the command that the lines name
    path = HERE / "snapshots" / f"{name}.txt"
    found = snapshot(name)
    if os.environ.get("REFRESH_SNAPSHOTS"):
        path.write_text(found, encoding="utf-8")
    assert found == path.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", SHOWN)
def test_colours_change_no_letter(name: str) -> None:
    for width in WIDTHS:
        plain = printed(name, width, force_terminal=True, color_system=None)
        coloured = printed(name, width, force_terminal=True, color_system="truecolor")
        assert CODES.sub("", coloured) == plain
        # No figure within a name is coloured: a code stands before or after a whole word.
        assert not re.search(r"[\w.]\x00+[\w.]", CODES.sub("\x00", coloured))
        without = printed(name, width, force_terminal=True, color_system="standard", no_color=True)
        assert CODES.sub("", without) == plain
    assert not CODES.search(printed(name, 80))


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", SHOWN)
def test_no_line_is_wider_than_the_terminal(name: str, width: int) -> None:
    lines = printed(name, width, force_terminal=True, color_system=None).splitlines()
    long = [line for line in lines if len(line.rstrip()) > width and not line.lstrip().startswith(COPIED)]
    assert [line for line in long if not line.startswith("  pip install")] == []


@pytest.mark.parametrize("name", SHOWN)
def test_every_width_has_the_same_words_and_figures(name: str) -> None:
    words = [set(printed(name, width, force_terminal=True, color_system=None).split()) for width in WIDTHS]
    assert words[0] == words[1] == words[2] == set(printed(name, 80).split())


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", ENGINES)
def test_names_of_engines_are_whole(name: str, width: int) -> None:
    words = re.split(r"[\s,;:]+", printed(name, width, force_terminal=True, color_system=None))
    assert set(ENGINES[name]) <= set(words)


@pytest.mark.parametrize("name", ["run", "precision", "league", "diff", "sweep"])
def test_powers_of_ten_stand_below_each_other(name: str) -> None:
    """In a column of a table, all numbers have a power of ten or none has, and the powers end in one place."""
    for width in WIDTHS:
        blocks: list[list[str]] = [[]]
        # A table goes on as long as its lines are as long as those before: rich fills them with spaces.
        for line in printed(name, width, force_terminal=True, color_system=None).splitlines():
            if blocks[-1] and len(line) == len(blocks[-1][-1]):
                blocks[-1].append(line)
            else:
                blocks.append([line])
        found = 0
        for block in blocks:
            places = [{match.end() for match in POWER.finditer(line)} for line in block]
            ends = set().union(*places)
            for end in ends:
                for line in block:
                    cell = line[:end].split(" ")[-1]
                    numeric = re.fullmatch(r"-?\d[\d.]*", cell) and line[end : end + 1] in (" ", "")
                    # Zero needs no power, and 1 is the unit of a ratio.
                    assert not numeric or cell in ("0", "1"), (line, cell)
            found += len(ends)
        assert found > 0
