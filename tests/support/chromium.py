"""Chromium by its debugging port: text, keys, uploads, screenshots, and the addresses that a page asked for."""

import base64
import json
import shutil
import subprocess
import tempfile
import time
import urllib.request
from pathlib import Path

OPTIONS = ("--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--remote-debugging-port=0")


class Chromium:
    """A browser with one tab on an address."""

    def __init__(self, url, *, width=1400, height=900):
        from websockets.sync.client import connect

        self._folder, self._number, self._events = Path(tempfile.mkdtemp()), 0, []
        self._process = subprocess.Popen([shutil.which("chromium"), *OPTIONS, f"--user-data-dir={self._folder}", "about:blank"],
                                         stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        port = self._wait_for(lambda: (self._folder / "DevToolsActivePort").read_text().split()[0])
        pages = self._wait_for(lambda: json.load(urllib.request.urlopen(f"http://127.0.0.1:{port}/json")))
        self._socket = connect(next(page for page in pages if page["type"] == "page")["webSocketDebuggerUrl"], max_size=None)
        self._call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600)
        self._call("Network.enable")
        self._call("Page.navigate", url=url)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._process.terminate()
        self._process.wait()
        shutil.rmtree(self._folder, ignore_errors=True)

    @property
    def text(self):
        """What the page shows as text."""
        return self.evaluate("document.body ? document.body.innerText : ''") or ""

    @property
    def asked_for(self):
        """Addresses that the page asked for."""
        return [one["params"]["request"]["url"] for one in self._events if one["method"] == "Network.requestWillBeSent"]

    def evaluate(self, script):
        """The value of a line of JavaScript."""
        return self._call("Runtime.evaluate", expression=script, returnByValue=True)["result"].get("value")

    def click(self, label):
        """Click the button with a label."""
        self.evaluate(f"[...document.querySelectorAll('button')].find(one => one.innerText.startsWith({label!r})).click()")

    def upload(self, path):
        """Give a file to the page's first field for files."""
        root = self._call("DOM.getDocument", depth=-1)["root"]["nodeId"]
        field = self._call("DOM.querySelectorAll", nodeId=root, selector="input[type=file]")["nodeIds"][0]
        self._call("DOM.setFileInputFiles", files=[str(path)], nodeId=field)

    def key(self, letter):
        """Press and release a letter's key."""
        for kind in ("keyDown", "keyUp"):
            self._call("Input.dispatchKeyEvent", type=kind, key=letter.lower(), code=f"Key{letter.upper()}",
                       windowsVirtualKeyCode=ord(letter.upper()))

    def screenshot(self):
        """The page as PNG."""
        return base64.b64decode(self._call("Page.captureScreenshot")["data"])

    def wait_for_text(self, words, *, tries=300):
        """Wait until the page shows words."""
        for _ in range(tries):
            if words in self.text:
                return
            time.sleep(0.1)
        raise AssertionError(f"{words!r} did not come; the page shows:\n{self.text}")

    def _call(self, method, **values):
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": values}))
        while (answer := json.loads(self._socket.recv(timeout=60))).get("id") != self._number:
            self._events.append(answer)
        return answer["result"]

    @staticmethod
    def _wait_for(found):
        for _ in range(300):
            try:
                return found()
            except (OSError, IndexError):
                time.sleep(0.1)
        raise AssertionError("Chromium does not answer")
