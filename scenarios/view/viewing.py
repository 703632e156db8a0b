"""Viewing a stored run in the native viewer, or as its page with the viewer in it."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path
from shlex import quote

from ..error import ScenarioError
from ..files import write_text
from ..run import RECORDING, check_stored_scenario, find_part, read_document, read_stored_scenario
from .recording import record_stored_run
from .server import LOOPBACK, Content, RunPageServer
from .stored_rides import naming_broken_files, read_shown_rides
from .viewer import ReplayError, rerun, viewer_files

REPORT = "report.html"


def open_native(folder: Path) -> None:
    """Open the recording of a run in the native viewer; return when its window is closed.

    Raises
    ------
    ScenarioError
        If the folder has no recording, its scenario was changed, or the viewer cannot run here.
    """
    without = f"open {folder / REPORT} in a browser, or run: velodrome view --web {quote(str(folder))}"
    open_recording(find_recording(folder), without)


def open_recording(recording: Path, without: str) -> None:
    """Open a recording in the native viewer; return when its window is closed.

    Parameters
    ----------
    recording : Path
    without : str
        What to do without a display.

    Raises
    ------
    ScenarioError
        If the viewer cannot run here.
    """
    command = native_command(recording)
    try:
        status = subprocess.call(command)
    except OSError as error:
        raise ScenarioError(f"the viewer {command[0]} cannot be started: {error.strerror}") from error
    if status != 0:
        raise ScenarioError(f"the viewer ended with status {status}; it needs a display. Without one, {without}")


def find_recording(folder: Path) -> Path:
    """Return the path of a run's recording, after a check that the run's scenario was not changed since.

    If the run was made without a recording, it is made now, from the stored rides. A folder that holds nothing but a
    recording, as a run that was not stored makes it, has no manifest to check with.

    Raises
    ------
    ScenarioError
        If there is neither a recording nor a finished run with a ride, or the scenario was changed.
    """
    if not (folder / "manifest.json").exists():
        return find_part(folder, RECORDING)
    check_stored_scenario(folder, read_document(folder, "manifest.json"))
    if not (folder / RECORDING).exists():
        try:
            record_stored_run(folder)
        except OSError as error:
            raise ScenarioError(f"{folder / RECORDING}: cannot be written: {error.strerror}") from error
    return find_part(folder, RECORDING)


def native_command(recording: Path) -> list[str]:
    """Return the command that starts the native viewer; it also listens for data, on this machine only."""
    return [rerun(), "--bind", LOOPBACK, "--port", "auto", str(recording)]


def serve(folder: Path, port: int, ready: Callable[[str], None]) -> None:
    """Serve a run's page with the viewer in it, to this machine only, until interrupted.

    Parameters
    ----------
    folder : Path
        A run folder; its page is written if it has none.
    port : int
        Port to listen on; 0 for any free one.
    ready : callable
        Called with the page's address once it is served.

    Raises
    ------
    ScenarioError
        If the folder is not a run folder, the port is taken, or the viewer's files cannot be obtained.
    """
    with page_server(folder, port) as server:
        _answer_until_interrupted(server, ready)


def serve_recording(recording: Path, port: int, ready: Callable[[str], None]) -> None:
    """Serve the viewer with a recording in it, to this machine only, until interrupted; see `serve`."""
    with _make_server(port, {RECORDING: recording}, _fetch_viewer()) as server:
        _answer_until_interrupted(server, ready)


def _answer_until_interrupted(server: RunPageServer, ready: Callable[[str], None]) -> None:
    ready(server.address)
    try:
        server.serve_forever()
    except KeyboardInterrupt:
        return


def _fetch_viewer() -> dict[str, Content]:
    try:
        return viewer_files()
    except ReplayError as error:
        raise ScenarioError(str(error)) from error


def _make_server(port: int, files: Mapping[str, Path], viewer: Mapping[str, Content]) -> RunPageServer:
    try:
        return RunPageServer(port, files, viewer)
    except OSError as error:
        raise ScenarioError(f"--port {port}: cannot listen on it: {error.strerror}; 0 takes a free one") from error


def page_server(folder: Path, port: int) -> RunPageServer:
    """Make the server of `serve`, which listens but does not answer yet."""
    find_recording(folder)
    if not (folder / REPORT).is_file():
        text = stored_page(folder)
        try:
            write_text(folder / REPORT, text)
        except OSError as error:
            raise ScenarioError(f"{folder / REPORT}: cannot be written: {error.strerror}") from error
    viewer = _fetch_viewer()
    # Only files that are in the folder now can be served: an address is looked up, never joined to a path, and links,
    # which may lead anywhere, are left out.
    files = {
        path.name: path
        for path in folder.iterdir()
        if path.is_file() and not path.is_symlink() and not path.name.startswith(".")
    }
    return _make_server(port, files, viewer)


def stored_page(folder: Path, docs: str | None = None) -> str:
    """Make the page of a stored run from its files.

    Parameters
    ----------
    folder : Path
        A run folder.
    docs : str, optional
        As `velodrome.reports.page.make_page` takes it.

    Returns
    -------
    str
        Page as `velodrome.reports.page.make_page` returns it.

    Raises
    ------
    ScenarioError
        If the folder is not a run folder, with the file that is missing or cannot be read.
    """
    from jinja2 import TemplateError

    from ...reports.page import make_page

    manifest, measured = read_document(folder, "manifest.json"), read_document(folder, "metrics.json")
    scenario = read_stored_scenario(folder, manifest)
    with naming_broken_files(folder, TemplateError):
        surface = scenario.surface.make()
        rides = read_shown_rides(folder, manifest, measured, scenario.make_bicycle(), surface)
        verdicts = manifest.get("verdicts", [])
        return make_page(manifest, scenario.model_dump(), measured, verdicts, rides, surface, docs)
