"""Pictures of a recording, taken in the viewer without a display.

``python -m tests.reports.recording.headless_viewer RECORDING PICTURE [SECONDS [TAB…]]`` takes one of the whole window.
"""

from __future__ import annotations

import io
import os
import socket
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from rerun.experimental import ViewerClient

DRIVERS = Path("/usr/share/vulkan/icd.d")
MENU_BAR = 0.034  # share of the window's height
# Said on every machine without a graphics card.
EXPECTED_WARNINGS = ("Software rasterizer detected",)


def missing() -> str | None:
    """Why no picture can be taken here; None if one can."""
    if not any(DRIVERS.glob("*.json")):
        return "no Vulkan driver; Debian's mesa-vulkan-drivers has one that needs no graphics card"
    return None


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@contextmanager
def viewer(recording: Path) -> Iterator[ViewerClient]:
    """A headless viewer that has loaded a recording."""
    os.environ.setdefault("XDG_RUNTIME_DIR", str(recording.parent))  # the driver's loader complains without
    executable = str(Path(sys.executable).with_name("rerun"))
    with ViewerClient.spawn(
        headless=True, port=_free_port(), executable_path=executable, hide_welcome_screen=True
    ) as client:
        client.open(str(recording))
        deadline = time.monotonic() + 30
        while client.get_state().loading or not client.get_state().views:
            if time.monotonic() > deadline:
                raise TimeoutError(f"the viewer did not load {recording}")
            time.sleep(0.1)
        yield client


def complaints(client: ViewerClient) -> list[str]:
    """Warnings and errors of the viewer and of its views."""
    logs = [entry.message for entry in client.get_logs() if entry.level in ("WARN", "ERROR")]
    logs = [text for text in logs if not text.startswith(EXPECTED_WARNINGS)]
    return logs + [str(report) for view in client.get_state().views for report in view.reports]


def _names(parts: dict[str, Any]) -> dict[str, str]:
    """Display names of views and containers by their path without the leading slash."""
    return {
        path.lstrip("/"): facts["display_name"]
        for path, archetypes in parts.items()
        for facts in archetypes.values()
        if isinstance(facts, dict) and "display_name" in facts
    }


def open_tabs(client: ViewerClient, tabs: Sequence[str]) -> None:
    """Bring the tabs of these names to the front."""
    parts = client.get_blueprint().blueprint
    names = _names(parts)
    for archetypes in parts.values():
        container = archetypes.get("ContainerBlueprint", {})
        for child in container.get("contents", []):
            if container.get("container_kind") == "Tabs" and names.get(child.lstrip("/")) in tabs:
                container["active_tab"] = child
    client.set_blueprint(parts, of="recording")


def switch(client: ViewerClient, view: str, entity: str, visible: bool) -> None:
    """Show an entity and all below it in the views of this name, or do not."""
    parts = client.get_blueprint().blueprint
    paths = [f"/{path}" for path, name in _names(parts).items() if name == view]
    assert paths, f"no view is called {view}"
    for path in paths:
        parts[f"{path}/ViewContents/overrides{entity}/visualizers"] = {"EntityBehavior": {"visible": visible}}
    client.set_blueprint(parts, of="recording")


def pixels(client: ViewerClient, seconds: float) -> np.ndarray:
    """The window at a time, shape (rows, columns, 3)."""
    return np.asarray(Image.open(io.BytesIO(picture(client, seconds))).convert("RGB")).astype(int)


def picture(client: ViewerClient, seconds: float) -> bytes:
    """A PNG of the window at a time; the same twice in a row."""
    client.set_time("time", duration=seconds, play_state="paused")
    last = b""
    for _ in range(20):
        time.sleep(0.2)
        png = client.take_screenshot()
        if png == last:
            return png
        last = png
    raise TimeoutError("the viewer's picture does not come to rest")


def save_for_page(png: bytes, path: Path) -> None:
    """Save a picture of the window 1400 pixels wide, without the menu bar (under 700 kB).

    In all its colours: of fewer the thin curves of the engines would get none.
    """
    window = Image.open(io.BytesIO(png)).convert("RGB")
    bar = round(window.height * MENU_BAR)
    window = window.crop((0, bar, window.width, window.height))
    size = (1400, round(window.height * 1400 / window.width))
    window.resize(size, Image.Resampling.LANCZOS).save(path, optimize=True)


if __name__ == "__main__":
    with viewer(Path(sys.argv[1])) as running:
        open_tabs(running, sys.argv[4:])
        save_for_page(picture(running, float(sys.argv[3]) if sys.argv[3:] else 0.0), Path(sys.argv[2]))
