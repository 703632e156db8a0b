"""A Chromium without a display, driven over its debugging pipe: pictures with WebGL, and what its console says.

It draws by SwiftShader, in software, so that no graphics card is needed.
"""

from __future__ import annotations

import base64
import fcntl
import io
import json
import os
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from tests.reports.page.headless_page import browser

SIZE = (1400, 900)
PATIENCE = 300.0  # for drawing in software on a busy machine [s]
_FLAGS = (
    *("--headless=new", "--hide-scrollbars", "--no-first-run", "--disable-background-networking", "--disable-sync"),
    # Its sandbox does not start as root, as in a container; the page is our own.
    *("--disable-component-update", "--no-sandbox", "--disable-dev-shm-usage"),
    *("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
    *("--window-size={},{}".format(*SIZE), "--remote-debugging-pipe"),
)


class RefusedCallError(RuntimeError):
    """The browser does not do what it was asked, for example while a page takes another one's place."""


class Chromium:
    """A tab of a running Chromium.

    Attributes
    ----------
    complaints : list of str
        Errors and exceptions that the console was told, and requests that failed.
    requests : list of str
        Addresses that were asked for.
    """

    def __init__(self, to: int, back: int) -> None:
        self._to, self._back = to, back
        self._rest, self._count = b"", 0
        self._session: str | None = None
        self.complaints: list[str] = []
        self.requests: list[str] = []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call a method of the DevTools protocol and return its result."""
        self._count += 1
        message: dict[str, Any] = {"id": self._count, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._receive()
            if answer.get("id") == self._count:
                if "error" in answer:
                    raise RefusedCallError(f"{method}: {answer['error']['message']}")
                return answer["result"]
            self._listen(answer)

    def _receive(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            read = os.read(self._back, 1 << 20)
            if not read:
                raise RuntimeError("Chromium ended")
            self._rest += read
        message, _, self._rest = self._rest.partition(b"\0")
        return json.loads(message)

    def _listen(self, event: dict[str, Any]) -> None:
        method, said = event.get("method"), event.get("params", {})
        if method == "Network.requestWillBeSent":
            self.requests.append(said["request"]["url"])
        elif method == "Runtime.exceptionThrown":
            self.complaints.append(json.dumps(said["exceptionDetails"])[:600])
        elif method == "Runtime.consoleAPICalled" and said["type"] in ("error", "assert"):
            self.complaints.append(" ".join(str(part.get("value", part)) for part in said["args"])[:600])
        elif method == "Log.entryAdded" and said["entry"]["level"] == "error":
            self.complaints.append(f"{said['entry']['text']} ({said['entry'].get('url')})")

    def open(self, address: str) -> None:
        """Open an address; returns when the page is there."""
        self.call("Page.navigate", url=address)
        self.wait_for("document.readyState === 'complete' && location.protocol !== 'about:'")

    def evaluate(self, expression: str) -> Any:
        """Value of an expression of JavaScript in the page."""
        return self.call("Runtime.evaluate", expression=expression, returnByValue=True)["result"].get("value")

    def wait_for(self, expression: str) -> Any:
        """Value of an expression once it is true."""
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            with suppress(RefusedCallError):
                if value := self.evaluate(expression):
                    return value
            time.sleep(0.2)
        raise TimeoutError(f"{expression} does not become true; the console: {self.complaints}")

    def picture(self) -> np.ndarray:
        """The window's pixels, shape (rows, columns, 3)."""
        png = base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        return np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)


@contextmanager
def chromium(profile: Path) -> Iterator[Chromium]:
    """A running Chromium with a new profile in a folder."""
    program = browser()
    assert program is not None
    theirs, to = os.pipe()
    back, ours = os.pipe()
    # It reads from 3 and writes to 4, which may be taken here.
    ends = [fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 10) for end in (theirs, ours)]

    def connect() -> None:
        os.dup2(ends[0], 3)
        os.dup2(ends[1], 4)

    process = subprocess.Popen(
        [program, *_FLAGS, f"--user-data-dir={profile}", "about:blank"],
        preexec_fn=connect,
        pass_fds=(3, 4),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    for end in (*ends, theirs, ours):
        os.close(end)
    try:
        yield Chromium(to, back)
    finally:
        os.close(to)
        os.close(back)
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGTERM)
        process.wait()
