"""A server of one run's files for the browser on this machine."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlsplit

LOOPBACK = "127.0.0.1"
_TYPES = {".html": "text/html; charset=utf-8", ".json": "application/json", ".toml": "text/plain; charset=utf-8"}
_BINARY = "application/octet-stream"
_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
# The viewer may run its compiled code and read from this server, but load nothing from elsewhere.
_VIEWER_POLICY = (
    "default-src 'self' data: blob:; style-src 'unsafe-inline'; "
    "script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval'; frame-ancestors 'self'"
)


@dataclass(frozen=True)
class Content:
    """A file in memory.

    Attributes
    ----------
    kind : str
        Media type.
    body : bytes
    """

    kind: str
    body: bytes


class RunPageServer(ThreadingHTTPServer):
    """Server on the loopback interface, which listens as soon as it is made; `serve_forever` answers.

    Parameters
    ----------
    port : int
        0 for any free one.
    files : mapping of str to Path
        The run's files by name: with ``report.html``, or the recording alone.
    viewer : mapping of str to Content
        Files below ``viewer/`` by name.

    Raises
    ------
    OSError
        If the port is taken.
    """

    daemon_threads = True

    def __init__(self, port: int, files: Mapping[str, Path], viewer: Mapping[str, Content]) -> None:
        self.files, self.viewer = files, viewer
        super().__init__((LOOPBACK, port), _Handler)

    @property
    def address(self) -> str:
        """Address of the page; without one, of the viewer with the recording in it."""
        root = f"http://{LOOPBACK}:{self.server_port}"
        if "report.html" in self.files:
            return f"{root}/report.html?replay"
        recording = quote(f"{root}/{next(iter(self.files))}", safe="")
        return f"{root}/viewer/?url={recording}&hide_welcome_screen=1&persist=0&theme=dark"

    def knows(self, host: str | None) -> bool:
        """Return whether a request is meant for this server; a name that another site resolves to it is refused."""
        return host in (f"{LOOPBACK}:{self.server_port}", f"localhost:{self.server_port}")


class _Handler(BaseHTTPRequestHandler):
    server: RunPageServer  # pyright: ignore[reportIncompatibleVariableOverride]
    protocol_version = "HTTP/1.1"

    def do_GET(self) -> None:
        self._answer()

    def do_HEAD(self) -> None:
        self._answer()

    def _answer(self) -> None:
        path = urlsplit(self.path).path.removeprefix("/")
        if not self.server.knows(self.headers.get("Host")):
            self._refuse(HTTPStatus.FORBIDDEN)
        elif path == "":
            self._head(HTTPStatus.FOUND, 0, {"Location": self.server.address})
        elif path in self.server.files:
            self._send_file(self.server.files[path])
        elif path.startswith("viewer/") and path.removeprefix("viewer/") in self.server.viewer:
            content = self.server.viewer[path.removeprefix("viewer/")]
            headers = {"Content-Type": content.kind, "Content-Security-Policy": _VIEWER_POLICY}
            self._head(HTTPStatus.OK, len(content.body), headers)
            if self.command == "GET":
                self.wfile.write(content.body)
        else:
            self._refuse(HTTPStatus.NOT_FOUND)

    def _send_file(self, path: Path) -> None:
        try:
            source = path.open("rb")
        except OSError:
            self._refuse(HTTPStatus.NOT_FOUND)  # gone since the server was made
            return
        with source:
            kind = _TYPES.get(path.suffix, _BINARY)
            self._head(HTTPStatus.OK, path.stat().st_size, {"Content-Type": kind})
            if self.command == "GET":
                shutil.copyfileobj(source, self.wfile)

    def _refuse(self, status: HTTPStatus) -> None:
        text = f"{status.value} {status.phrase}\n".encode()
        self._head(status, len(text), {"Content-Type": "text/plain; charset=utf-8"})
        if self.command == "GET":
            self.wfile.write(text)

    def _head(self, status: HTTPStatus, length: int, headers: Mapping[str, str]) -> None:
        self.send_response(status)
        for name, value in {**_HEADERS, **headers, "Content-Length": str(length)}.items():
            self.send_header(name, value)
        self.end_headers()

    def log_message(self, format: str, *args: Any) -> None:
        """Do not log requests: the command's output is for its user."""
