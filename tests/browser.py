"""A headless Chromium or Chrome, driven over a pipe with the DevTools protocol."""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
from pathlib import Path
from types import TracebackType
from typing import Any, Self

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
OPTIONS = (
    "--headless",
    "--no-sandbox",  # the only pages opened are our own; root has no sandbox
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-quic",
    "--hide-scrollbars",
    "--remote-debugging-pipe",
)


def find_browser() -> str | None:
    """The browser that CHROME names, or one of the usual names; None if there is none.

    A browser that CHROME names and that is absent is an error: who asks for it wants no skip.
    """
    if asked := os.environ.get("CHROME"):
        actual = shutil.which(asked)
        assert actual, f"CHROME={asked}: no such program"
        return actual
    return next((path for name in NAMES if (path := shutil.which(name))), None)


class Browser:
    """One tab of a browser.  Messages end in a zero byte; see chromedevtools.github.io."""

    def __init__(self, program: str, profile: Path) -> None:
        to_browser, self._out = os.pipe()
        in_, from_browser = os.pipe()
        self._in = os.fdopen(in_, "rb", buffering=0)
        command = [program, *OPTIONS, f"--user-data-dir={profile}", "about:blank"]
        # The browser reads from descriptor 3 and writes to 4, whatever their numbers here.
        ends = f'exec "$@" 3<&{to_browser} 4>&{from_browser}'
        self._process = subprocess.Popen(
            ["bash", "-c", ends, "bash", *command],
            pass_fds=(to_browser, from_browser),
            stderr=subprocess.DEVNULL,
        )
        os.close(to_browser)
        os.close(from_browser)
        self._rest = b""
        self._count = 0
        self._session: str | None = None
        self.events: list[dict[str, Any]] = []
        target = self.do("Target.createTarget", url="about:blank")["targetId"]
        attached = self.do("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Network", "Log", "Runtime", "Audits"):
            self.do(f"{domain}.enable")
        self.do("Page.setLifecycleEventsEnabled", enabled=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        os.close(self._out)  # the end of the commands ends the browser
        try:
            self._process.wait(timeout=20)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._in.close()

    def do(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a command and return its result; events on the way are kept."""
        self._count += 1
        message = {"id": self._count, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        while (answer := self._read()).get("id") != self._count:
            self.events.append(answer)
        assert "error" not in answer, (method, answer)
        result: dict[str, Any] = answer["result"]
        return result

    def _read(self) -> dict[str, Any]:
        """The next message of the browser."""
        while b"\0" not in self._rest:
            block = self._in.read(1 << 16)
            assert block, "the browser has ended"
            self._rest += block
        message, self._rest = self._rest.split(b"\0", 1)
        actual: dict[str, Any] = json.loads(message)
        return actual

    def open(
        self, page: Path, *, width: int = 1400, scheme: str = "light", media: str = "screen"
    ) -> None:
        """Open a file and wait until it is loaded; only its own events are kept."""
        self.do(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=900, deviceScaleFactor=1, mobile=False,
        )  # fmt: skip
        feature = {"name": "prefers-color-scheme", "value": scheme}
        self.do("Emulation.setEmulatedMedia", media=media, features=[feature])
        self.events.clear()
        loader = self.do("Page.navigate", url=page.as_uri())["loaderId"]
        while not any(_is_loaded(one, loader) for one in self.events):
            self.events.append(self._read())

    def value(self, expression: str) -> Any:
        """Value of an expression of JavaScript in the page."""
        answer = self.do("Runtime.evaluate", expression=expression, returnByValue=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def requests(self) -> list[str]:
        """Addresses the page has asked for, without those inside the page."""
        sent = [one for one in self.events if one["method"] == "Network.requestWillBeSent"]
        values = [one["params"]["request"]["url"] for one in sent]
        return [address for address in values if not address.startswith(("data:", "blob:"))]

    def complaints(self) -> list[dict[str, Any]]:
        """What the browser has to say: log, console, exceptions, and issues such as of the CSP."""
        kinds = (
            "Log.entryAdded",
            "Runtime.consoleAPICalled",
            "Runtime.exceptionThrown",
            "Audits.issueAdded",
        )
        return [one for one in self.events if one["method"] in kinds]

    def pdf(self) -> bytes:
        """The page printed, of the size that its style gives."""
        answer = self.do("Page.printToPDF", preferCSSPageSize=True, printBackground=True)
        return base64.b64decode(answer["data"])


def _is_loaded(event: dict[str, Any], loader: str) -> bool:
    """Whether an event is the end of this load, not of the page before."""
    params = event["params"]
    is_load = event["method"] == "Page.lifecycleEvent" and params["name"] == "load"
    return bool(is_load and params["loaderId"] == loader)
