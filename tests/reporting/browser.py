"""A headless Chromium, spoken to over a pipe in its own protocol (Chrome DevTools): what it shows, asks for and complains of."""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

CHROMIUM = next((found for name in ("chromium", "chromium-browser", "google-chrome", "chrome") if (found := shutil.which(name))), None)
FLAGS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--hide-scrollbars", "--disable-component-update")
SOFTWARE_GL = (
    *(flag for flag in FLAGS if flag != "--disable-gpu"),
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)
"""For pages with WebGL, on machines without a graphics card."""
LAUNCH = """
import fcntl, os, sys
ends = [fcntl.fcntl(int(end), fcntl.F_DUPFD, 10) for end in sys.argv[1:3]]
for end, number in zip(ends, (3, 4)):
    os.dup2(end, number)
os.execv(sys.argv[3], sys.argv[3:])
"""
"""The protocol's pipe has fixed numbers: the browser reads from 3 and writes to 4."""
PATIENCE = 60.0
"""Seconds for anything it is asked."""


class Browser:
    """One page. `requests`: every address asked for. `complaints`: errors of the console, of scripts and of loading."""

    def __init__(self, profile: Path, *, width: int = 1280, height: int = 900, flags: Sequence[str] = FLAGS) -> None:
        assert CHROMIUM, "no Chromium"
        self.requests: list[str] = []
        self.complaints: list[str] = []
        self._asked, self._session, self._rest = 0, "", b""
        to_read, self._write = os.pipe()
        self._read, to_write = os.pipe()
        launch = [sys.executable, "-c", LAUNCH, str(to_read), str(to_write), CHROMIUM]
        command = [*launch, *flags, f"--user-data-dir={profile}", "--remote-debugging-pipe"]
        self._process = subprocess.Popen(command, pass_fds=(to_read, to_write), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(to_read)
        os.close(to_write)
        target = self._ask("Target.createTarget", url="about:blank")["targetId"]
        self._session = self._ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self._ask(f"{domain}.enable")
        self.resize(width, height)

    def open(self, path: Path) -> None:
        """Show a file and wait until it is loaded."""
        self._ask("Page.navigate", url=path.absolute().as_uri())
        self.wait("document.readyState === 'complete'")

    def evaluate(self, expression: str) -> Any:
        """The value of an expression in the page."""
        answer = self._ask("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True, userGesture=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait(self, condition: str) -> None:
        """Until an expression is true."""
        end = time.monotonic() + PATIENCE
        while not self.evaluate(condition):
            assert time.monotonic() < end, f"{condition} never came true"
            time.sleep(0.05)

    def press(self, key: str, *, text: str = "") -> None:
        """A key, down and up."""
        for kind in ("keyDown", "keyUp"):
            self._ask(
                "Input.dispatchKeyEvent",
                type=kind,
                key=key,
                code=key,
                text=text if kind == "keyDown" else "",
                windowsVirtualKeyCode=KEYS[key],
            )

    def resize(self, width: int, height: int) -> None:
        """The page's size in its own pixels."""
        self._ask("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def prefer(self, scheme: str) -> None:
        """light or dark."""
        self._ask("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def screenshot(self, path: Path) -> None:
        """What is in view, as PNG."""
        path.write_bytes(base64.b64decode(self._ask("Page.captureScreenshot", format="png")["data"]))

    def close(self) -> None:
        """End it."""
        os.close(self._write)
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        os.close(self._read)

    def _ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._asked += 1
        session = {"sessionId": self._session} if self._session else {}
        os.write(self._write, json.dumps({"id": self._asked, "method": method, "params": parameters, **session}).encode() + b"\0")
        while (message := self._next()).get("id") != self._asked:
            self._hear(message)
        assert "error" not in message, (method, message["error"])
        return message["result"]

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            data = os.read(self._read, 1 << 20)
            assert data, "Chromium is gone"
            self._rest += data
        message, _, self._rest = self._rest.partition(b"\0")
        return json.loads(message)

    def _hear(self, message: dict[str, Any]) -> None:
        facts = message.get("params", {})
        hear: dict[str, Callable[[], None]] = {
            "Network.requestWillBeSent": lambda: self.requests.append(facts["request"]["url"]),
            "Network.loadingFailed": lambda: self.complaints.append(facts["errorText"]),
            "Runtime.exceptionThrown": lambda: self.complaints.append(str(facts["exceptionDetails"])),
            "Runtime.consoleAPICalled": lambda: self.complaints.append(str(facts["args"])),
            "Log.entryAdded": lambda: self.complaints.append(facts["entry"]["text"]),
        }
        hear.get(message.get("method", ""), lambda: None)()


KEYS = {"Tab": 9, "Enter": 13, " ": 32}
