# SPDX-License-Identifier: MIT
"""Headless Chromium, driven over its DevTools protocol on a pair of pipes: JSON with a zero
byte after each message.  Needs nothing but Python and Chromium."""

import base64
import json
import os
import select
import shutil
import subprocess
import tempfile
import time


class Failed(Exception):
    pass


def find():
    """The program's path, or None."""
    return shutil.which("chromium") or shutil.which("chromium-browser")


class Browser:
    """One page of a browser of its own, in a folder of its own."""

    def __init__(self, program):
        self.folder = tempfile.mkdtemp(prefix="anlos-chromium-")
        to_read, self.to = os.pipe()
        self.back, to_write = os.pipe()

        def arrange():  # the browser reads 3 and writes 4
            spare = os.dup(to_write), os.dup(to_read)
            os.dup2(spare[1], 3)
            os.dup2(spare[0], 4)

        self.process = subprocess.Popen(
            [program, "--headless=new", "--no-sandbox", "--disable-gpu",
             "--disable-dev-shm-usage", "--no-first-run", "--hide-scrollbars",
             "--disable-extensions", "--disable-background-networking",
             "--user-data-dir=" + self.folder, "--remote-debugging-pipe", "about:blank"],
            preexec_fn=arrange, close_fds=False,
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(to_read)
        os.close(to_write)
        self.held = b""
        self.number = 0
        self.session = None
        self.said = []  # errors of the page
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target,
                                 flatten=True)["sessionId"]
        for domain in "Page", "Runtime", "Log":
            self.call(domain + ".enable")

    def _next(self, deadline):
        while b"\0" not in self.held:
            left = deadline - time.monotonic()
            if left <= 0 or not select.select([self.back], [], [], left)[0]:
                raise Failed("the browser does not answer")
            data = os.read(self.back, 1 << 20)
            if not data:
                raise Failed("the browser has ended")
            self.held += data
        text, self.held = self.held.split(b"\0", 1)
        return json.loads(text)

    def call(self, method, **params):
        self.number += 1
        message = {"id": self.number, "method": method, "params": params}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.to, json.dumps(message).encode() + b"\0")
        deadline = time.monotonic() + 120
        while True:
            answer = self._next(deadline)
            self._listen(answer)
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise Failed("%s: %s" % (method, answer["error"]["message"]))
                return answer["result"]

    def _listen(self, event):
        params = event.get("params", {})
        if event.get("method") == "Runtime.exceptionThrown":
            details = params["exceptionDetails"]
            self.said.append(details.get("exception", {}).get("description")
                             or details["text"])
        elif (event.get("method") == "Log.entryAdded"
              and params["entry"]["level"] == "error"):
            self.said.append(params["entry"]["text"])

    def ask(self, script):
        """The value of a JavaScript expression in the page."""
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True,
                           awaitPromise=True)
        if "exceptionDetails" in answer:
            raise Failed("%s: %s" % (script, answer["exceptionDetails"]))
        return answer["result"].get("value")

    def wait(self, script, seconds=60):
        """Until the expression is true; its value."""
        deadline = time.monotonic() + seconds
        while True:
            value = self.ask(
                "new Promise(done => { const until = performance.now() + 500;"
                " const look = () => { const v = (() => { try { return (%s); }"
                " catch (e) { return null; } })();"
                " v || performance.now() > until ? done(v instanceof Node || v) : setTimeout(look, 15); };"
                " look(); })" % script)
            if value:
                return value
            if time.monotonic() > deadline:
                raise Failed("never came true: " + script)

    def size(self, width, height, dark=True, phone=False):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height,
                  deviceScaleFactor=2 if phone else 1, mobile=phone)
        self.call("Emulation.setEmulatedMedia", features=[
            {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}])
        self.ask("new Promise(f => requestAnimationFrame(() => requestAnimationFrame(f)))")

    def open(self, url):
        self.call("Page.navigate", url=url)
        self.wait("document.readyState === 'complete' && location.href !== 'about:blank'")

    def click(self, selector):
        """Again where the page has moved the element away meanwhile: between two of the
        three, press, release and the look, too."""
        for _ in range(10):
            x, y = self.ask(
                "(() => { const e = document.querySelector(%s); e.scrollIntoView("
                "{block: 'center'}); const b = e.getBoundingClientRect(); window.hit = false;"
                " e.addEventListener('click', () => { window.hit = true; }, { once: true });"
                " return [b.x + b.width / 2, b.y + b.height / 2]; })()"
                % json.dumps(selector))
            for kind in "mousePressed", "mouseReleased":
                self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left",
                          clickCount=1)
            if self.ask("hit"):
                return
        raise Failed("it cannot be clicked: " + selector)

    def press(self, key, code=None, **more):
        codes = {"Tab": 9, "ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39,
                 "ArrowDown": 40, "Home": 36, "End": 35, "Enter": 13, " ": 32}
        text = {"Enter": "\r", " ": " "}.get(key)
        extra = {"text": text} if text else {}
        for kind in "keyDown", "keyUp":
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=code or key,
                      windowsVirtualKeyCode=codes[key], **extra, **more)

    def picture(self, path, whole=False):
        data = self.call("Page.captureScreenshot", format="png",
                         captureBeyondViewport=whole)["data"]
        with open(path, "wb") as f:
            f.write(base64.b64decode(data))

    def close(self):
        self.process.terminate()
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        os.close(self.to)
        os.close(self.back)
        shutil.rmtree(self.folder, ignore_errors=True)
