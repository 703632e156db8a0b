"""The rerun viewer for a browser: its files, fetched from the program that contains them."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from http.client import HTTPConnection
from pathlib import Path

from .server import LOOPBACK, Content

_FILES = ("", "re_viewer.js", "re_viewer_bg.wasm", "favicon.ico")
_PATIENCE = 20.0  # [s] for a program of 300 MB to be read from a cold disk and to listen
# Links to fonts elsewhere: the viewer has its own fonts, and the page must not use the network.
_ELSEWHERE = re.compile(rb"<link\b[^>]*\bhttps://[^>]*>")
# The viewer asks whether there is a newer version and reports that it is used. The page must not use the network, and
# its policy forbids it; answered with nothing, the viewer does not complain either.
_STAY_HERE = b"""<script>
      const fetchHere = window.fetch;
      window.fetch = (from, ...options) => {
        const { protocol, origin } = new URL(from.url ?? from, location);
        const elsewhere = protocol.startsWith("http") && origin !== location.origin;
        return elsewhere ? Promise.resolve(new Response(null, { status: 204 })) : fetchHere(from, ...options);
      };
    </script>
    <script"""


class ReplayError(RuntimeError):
    """The viewer's files cannot be obtained."""


def rerun() -> str:
    """Return the path of the viewer's program, which is installed beside the interpreter."""
    return str(Path(sys.executable).with_name("rerun"))


def viewer_files() -> dict[str, Content]:
    """Fetch the files of the viewer for a browser, by name; the page itself is "".

    The viewer's program serves them. It runs only while they are fetched, on the loopback
    interface.

    Raises
    ------
    ReplayError
        If it does not serve them.
    """
    port = _free_port()
    # With the address of a recording it serves the viewer and does not listen for data.
    command = [rerun(), "--serve-web", "--bind", LOOPBACK, "--web-viewer-port", str(port), f"http://{LOOPBACK}/x.rrd"]
    try:
        # A process group of its own: the program runs under a launcher that would leave it behind.
        program = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
        )
    except OSError as error:
        raise ReplayError(f"the viewer {command[0]} cannot be started: {error.strerror}") from error
    try:
        _wait_until_listening(program, port)
        return {name: _fetch(port, name) for name in _FILES}
    finally:
        with suppress(ProcessLookupError):  # it may have ended by itself
            os.killpg(program.pid, signal.SIGTERM)
        program.wait()


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return probe.getsockname()[1]


def _wait_until_listening(program: subprocess.Popen[bytes], port: int) -> None:
    """Wait until the program listens."""
    deadline = time.monotonic() + _PATIENCE
    while time.monotonic() < deadline:
        if program.poll() is not None:
            raise ReplayError(f"the viewer ended with status {program.returncode} instead of serving its files")
        try:
            socket.create_connection((LOOPBACK, port), timeout=1).close()
        except OSError:
            time.sleep(0.05)
        else:
            return
    raise ReplayError(f"the viewer did not serve its files within {_PATIENCE:g} s")


def _fetch(port: int, name: str) -> Content:
    connection = HTTPConnection(LOOPBACK, port, timeout=_PATIENCE)
    try:
        connection.request("GET", f"/{name}")
        answer = connection.getresponse()
        body = answer.read()
    except OSError as error:
        raise ReplayError(f"the viewer did not give its file {name!r}: {error}") from error
    finally:
        connection.close()
    if answer.status != 200:
        raise ReplayError(f"the viewer has no file {name!r}: this version of rerun keeps them elsewhere")
    kind = answer.getheader("Content-Type", "application/octet-stream")
    return Content(kind, _keep_here(body) if name == "" else body)


def _keep_here(page: bytes) -> bytes:
    """Return the viewer's page without links to elsewhere, and with no questions to elsewhere."""
    return _ELSEWHERE.sub(b"", page).replace(b"<script", _STAY_HERE, 1)
