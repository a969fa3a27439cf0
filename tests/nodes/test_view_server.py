#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""What the view's web server lets in, and how it ends: HTTP and WebSocket by hand.

    test_view_server.py ANLOS"""

import base64
import json
import os
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time


def check(what, text):
    if not what:
        raise SystemExit("FAILED: " + text)


def start(anlos, run_dir, *more, log=None):
    p = subprocess.Popen([anlos, "view", "--port", "0", "--run-dir", run_dir, *more],
                         stdout=subprocess.PIPE, stderr=log, text=True)
    url = p.stdout.readline().strip()
    check(url.startswith("http://127.0.0.1:"), "it prints its address: " + url)
    return p, int(url.rstrip("/").rsplit(":", 1)[1])


def connect(port):
    s = socket.create_connection(("127.0.0.1", port), 30)
    s.settimeout(30)
    return s


def ask(port, request, **headers):
    """Status, head and body of the reply to a request; status 0: it hung up instead."""
    fields = {"Host": "127.0.0.1:%d" % port, **headers}
    with connect(port) as s:
        s.sendall((request + " HTTP/1.1\r\n" + "".join(
            "%s: %s\r\n" % f for f in fields.items()) + "\r\n").encode())
        answer = b""
        while True:
            data = s.recv(65536)
            if not data:
                break
            answer += data
    if not answer:
        return 0, "", b""
    head, _, body = answer.partition(b"\r\n\r\n")
    return int(head.split()[1]), head.decode(), body


class Refused(Exception):
    pass


class Socket:
    """A WebSocket client."""

    def __init__(self, port, path="/live", **headers):
        self.s = connect(port)
        fields = {"Host": "127.0.0.1:%d" % port, "Upgrade": "websocket",
                  "Connection": "Upgrade", "Sec-WebSocket-Version": "13",
                  "Sec-WebSocket-Key": base64.b64encode(os.urandom(16)).decode(),
                  **headers}
        self.s.sendall(("GET %s HTTP/1.1\r\n" % path + "".join(
            "%s: %s\r\n" % f for f in fields.items()) + "\r\n").encode())
        self.held = b""
        while b"\r\n\r\n" not in self.held:
            self.held += self._more()
        head, self.held = self.held.split(b"\r\n\r\n", 1)
        if b" 101 " not in head.split(b"\r\n")[0] + b" ":
            raise Refused(head.decode())

    def _more(self):
        try:
            data = self.s.recv(65536)
        except ConnectionResetError:
            data = b""
        if not data:
            raise Refused("closed")
        return data

    def _take(self, n):
        while len(self.held) < n:
            self.held += self._more()
        out, self.held = self.held[:n], self.held[n:]
        return out

    def frame(self):
        """Opcode and content of a message, of however many frames; or of a close."""
        opcode, content, last = 0, b"", False
        while not last:
            first, length = self._take(2)
            if length == 126:
                length = struct.unpack(">H", self._take(2))[0]
            elif length == 127:
                length = struct.unpack(">Q", self._take(8))[0]
            part = self._take(length)
            if first & 15 == 8:
                return 8, part
            if opcode and first & 8:  # a ping within it
                continue
            opcode, last = opcode or first & 15, first & 128
            content += part
        return opcode, content

    def until(self, kind):
        """The next text of that type."""
        while True:
            opcode, data = self.frame()
            if opcode == 8:
                raise Refused("closed")
            if opcode == 1 and json.loads(data)["type"] == kind:
                return json.loads(data)

    def send(self, data, opcode=1, claim=None):
        n = len(data) if claim is None else claim
        size = bytes([0x80 | n]) if n < 126 else (
            b"\xfe" + struct.pack(">H", n) if n < 65536 else b"\xff" + struct.pack(">Q", n))
        self.s.sendall(bytes([0x80 | opcode]) + size + b"\0\0\0\0" + data)

    def is_closed(self):
        """Before the next heartbeats have come twice."""
        beats = 0
        try:
            while beats < 3:
                opcode, data = self.frame()
                if opcode == 8:
                    return True
                beats += opcode == 1 and json.loads(data)["type"] == "time"
        except Refused:
            return True
        return False

    def close(self):
        self.s.close()


def is_refused(*arguments, **headers):
    try:
        Socket(*arguments, **headers).close()
    except Refused:
        return True
    return False


def pages_are_read_and_nothing_else(port):
    status, head, body = ask(port, "GET /")
    check(status == 200 and b"<!doctype html>" in body, "the page")
    check("default-src 'self'" in head and "nosniff" in head, "and its headers: " + head)
    status, head, body = ask(port, "HEAD /app.js")
    check(status == 200 and not body and "text/javascript" in head, "HEAD: " + head)
    for method in "POST", "PUT", "DELETE", "OPTIONS", "PATCH":
        check(ask(port, method + " /")[0] in (405, 411), method + " is refused")
    for path in ("/../../../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "/..\\..\\x",
                 "/app.js/", "//app.js/../x", "/index.html%00.css", "/nothing"):
        status, _, body = ask(port, "GET " + path)
        # What no path can be is hung up on instead.
        allowed = (0, 400, 404) if "%00" in path else (400, 404)
        check(status in allowed and b"root:" not in body,
              "%s is not found: %d" % (path, status))


def other_names_are_refused(port):
    for host in "evil.example", "evil.example:%d" % port, "127.0.0.1.evil.example", "":
        check(ask(port, "GET /", Host=host)[0] in (400, 403), "Host " + host)
        check(is_refused(port, Host=host), "a WebSocket of Host " + host)
    for host in "localhost:%d" % port, "127.0.0.1", "[::1]:%d" % port:
        check(ask(port, "GET /", Host=host)[0] == 200, "Host " + host)


def other_origins_are_refused(port):
    here = "127.0.0.1:%d" % port
    for origin in ("http://evil.example", "https://" + here, "null", "http://127.0.0.1:1",
                   "http://%s.evil.example" % here, ""):
        check(is_refused(port, Origin=origin), "Origin " + origin)
    for headers in {}, {"Origin": "http://" + here}:
        s = Socket(port, **headers)
        check(s.until("hello")["mode"] == "live", "a page of its own, or no browser")
        s.close()


def what_is_no_request_ends_the_connection(port):
    for data in (b"", b"x", b"[]", b"{}", b'{"slice": -1}', b'{"slice": "a"}',
                 b'{"seek": 1, "slice": 1}', b'{"slice": 1', b" " * 257, b"\0" * 100000,
                 b"[" * 200):
        s = Socket(port)
        s.until("hello")
        s.send(data)
        check(s.is_closed(), "%r ends it" % data[:20])
        s.close()
    s = Socket(port)
    s.send(b"{}", opcode=2)
    check(s.is_closed(), "a binary frame ends it")
    s.close()
    s = Socket(port)
    s.send(b"", claim=1 << 62)
    check(s.is_closed(), "a frame of 2^62 bytes ends it")
    s.close()
    s = Socket(port)
    s.send(b'{"slice": 3}')  # there is no image
    s.send(b'{"seek": 3}')  # there is no bag
    check(not s.is_closed(), "a request ends nothing")
    s.close()


def who_is_hung_up_on_is_logged(port, log):
    """Of several in a short time one line is enough, which counts the others."""
    deadline = time.monotonic() + 60
    while "to /live ended after" not in log() or "what it sent is no request" not in log():
        check(time.monotonic() < deadline, "it is logged: " + log())
        s = Socket(port)
        s.send(b"nonsense")
        check(s.is_closed(), "nonsense ends it")
        s.close()
    check("code 1001" not in log(), "a page that is closed is no loss: " + log())


def there_is_a_limit_to_pages(port):
    pages = []
    try:
        for _ in range(40):
            pages.append(Socket(port))
    except (Refused, socket.timeout):
        pass
    check(4 <= len(pages) < 40, "%d pages are let in" % len(pages))
    check(ask(port, "GET /")[0] == 200, "the page itself can always be had")
    for p in pages:
        p.close()
    deadline = time.monotonic() + 60
    while is_refused(port):
        check(time.monotonic() < deadline, "a place becomes free when a page is closed")


def a_client_that_does_not_read_keeps_nobody_waiting(port):
    deaf = socket.socket()
    deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
    deaf.connect(("127.0.0.1", port))
    deaf.sendall(b"GET /live HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\n"
                 b"Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                 b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n")
    s = Socket(port)
    beats = [s.until("time") for _ in range(3)]
    check(beats[-1]["now"] > beats[0]["now"], "the others go on")
    s.close()
    return deaf


def a_port_in_use_is_told(anlos, run_dir, port):
    p = subprocess.run([anlos, "view", "--port", str(port), "--run-dir", run_dir],
                       capture_output=True, text=True, timeout=60)
    check(p.returncode == 1 and "port %d of 127.0.0.1 is in use" % port in p.stderr
          and p.stderr.count("\n") == 1, "one line says so: " + p.stderr)


def a_page_saves_the_last_seconds_where_it_may(anlos):
    """Of a recorder that keeps them; and one that only reads asks for nothing."""
    folder = tempfile.mkdtemp(prefix="anlos-view-")
    saved = os.path.join(folder, "saved")
    recorder = subprocess.Popen(
        [anlos, "bag", "record", "--snapshot", saved, "--after-s", "0", "--run-dir", folder],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    views = []

    def told(s, wanted):
        deadline = time.monotonic() + 60
        while True:
            r = s.until("record")
            if not r.get("none") and wanted(r):
                return r
            check(time.monotonic() < deadline, "the recorder says %s" % r)

    try:
        reads, port = start(anlos, folder)
        views.append(reads)
        s = Socket(port)
        check(not told(s, lambda r: r["state"] == "keeps")["may_save"], "it only reads")
        s.send(b'{"save": true}')
        before = told(s, lambda r: True)
        check(told(s, lambda r: r["at"] > before["at"] + 1500)["saved"] == 0,
              "who only reads saves nothing")
        s.close()
        asks, port = start(anlos, folder, "--save")
        views.append(asks)
        s = Socket(port, Origin="http://127.0.0.1:%d" % port)
        check(told(s, lambda r: r["state"] == "keeps")["may_save"], "it may ask")
        s.send(b'{"save": true}')
        path = told(s, lambda r: r["saved"] == 1)["path"]
        check(path.startswith(saved) and path.endswith("_button.mcap"), path)
        s.close()
        info = subprocess.run([anlos, "bag", "info", path], capture_output=True, text=True,
                              timeout=60)
        check("anlos.snapshot.from = page" in info.stdout, info.stdout + info.stderr)
        check(is_refused(port, Origin="http://evil.example"), "another origin may not")
    finally:
        for p in (*views, recorder):
            p.send_signal(signal.SIGTERM)
            p.wait(60)
        shutil.rmtree(folder)


def it_explains_itself(anlos):
    def run(*arguments):
        return subprocess.run([anlos, "view", *arguments], capture_output=True, text=True,
                              timeout=60)
    check(run("--help").returncode == 0 and "usage: anlos view" in run("--help").stdout,
          "--help")
    for arguments in (("--port", "x"), ("--port", "70000"), ("--nonsense",), ("bag.mcap",),
                      ("--bag", "/nonexistent"), ("--address", "example.org"),
                      ("--bag", __file__)):
        p = run(*arguments)
        check(p.returncode == 2 and len(p.stderr) > 20 and p.stderr.count("\n") <= 2,
              "%s: %d, %s" % (arguments, p.returncode, p.stderr))


def main():
    anlos = sys.argv[1]
    run_dir = tempfile.mkdtemp(prefix="anlos-view-")
    lines = tempfile.TemporaryFile("w+")

    def log():
        lines.seek(0)
        return lines.read()

    view, port = start(anlos, run_dir, log=lines)
    try:
        pages_are_read_and_nothing_else(port)
        other_names_are_refused(port)
        other_origins_are_refused(port)
        what_is_no_request_ends_the_connection(port)
        who_is_hung_up_on_is_logged(port, log)
        there_is_a_limit_to_pages(port)
        a_port_in_use_is_told(anlos, run_dir, port)
        it_explains_itself(anlos)
        a_page_saves_the_last_seconds_where_it_may(anlos)
        deaf = a_client_that_does_not_read_keeps_nobody_waiting(port)
        pages = [Socket(port) for _ in range(5)]
        foxglove = Socket(port, "/", **{"Sec-WebSocket-Protocol": "foxglove.sdk.v1"})
        half = connect(port)
        half.sendall(b"GET / HT")  # it never goes on
        view.send_signal(signal.SIGTERM)
        code = view.wait(45)  # it waits for no client: a silent one is closed after 50 s
        check(code == 130, "exit code %d" % code)
        for s in (deaf, foxglove.s, half, *[p.s for p in pages]):
            s.close()
    finally:
        view.kill()
        view.wait()
        view.stdout.close()
        shutil.rmtree(run_dir, ignore_errors=True)


if __name__ == "__main__":
    main()
