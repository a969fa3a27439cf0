#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Strangers at the view's web server, 16 at a time and of every kind: none of them costs
memory, and the page goes on for everybody else.

    test_view_hostile.py ANLOS"""

import os
import re
import signal
import socket
import struct
import sys
import tempfile
import threading

sys.dont_write_bytecode = True
from test_view_server import Refused, Socket, ask, check, connect, start  # beside this file

CLIENTS = 16
MOST_MB = 60  # of memory that view may ever have had
FOXGLOVE = {"Sec-WebSocket-Protocol": "foxglove.sdk.v1"}
SAID = 48 << 20  # bytes that each of them says, as far as it is listened to


def peak_mb(process):
    with open("/proc/%d/status" % process.pid) as status:
        return int(re.search(r"VmHWM:\s+(\d+) kB", status.read())[1]) / 1024


def pour(s, piece, most=SAID):
    """Until it is hung up on, or all is said."""
    said = 0
    try:
        while said < most:
            s.sendall(piece)
            said += len(piece)
    except OSError:  # a reset, a broken pipe, or nobody who reads
        pass
    return said


def head(opcode, size, final=True):
    return bytes([(0x80 if final else 0) | opcode, 0xff]) + struct.pack(">Q", size) + b"\0\0\0\0"


def socket_of(port, i):
    return Socket(port) if i % 2 else Socket(port, "/", **FOXGLOVE)


def announces_a_gigabyte(port, i):
    w = socket_of(port, i)
    w.s.sendall(head(1, 1 << 30))
    return w.s, pour(w.s, b"x" * 65536)


def never_ends_a_message(port, i):
    w = socket_of(port, i)
    w.s.sendall(head(1, 1000, final=False) + b"x" * 1000)
    return w.s, pour(w.s, head(0, 60000, final=False) + b"x" * 60000)


def never_ends_its_header(port, i):
    s = connect(port)
    s.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n")
    return s, pour(s, (b"X-%d: " % i) + b"y" * 60000 + (b"\r\n" if i % 2 else b""))


def never_ends_its_path(port, i):
    s = connect(port)
    s.sendall(b"GET /")
    return s, pour(s, b"z" * 65536)


def sends_a_body(port, i):
    s = connect(port)
    s.sendall(b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: %d\r\n\r\n" % (1 << 40))
    return s, pour(s, b"b" * 65536)


def pings_and_reads_nothing(port, i):
    w = socket_of(port, i)
    return w.s, pour(w.s, (b"\x89\xfd\0\0\0\0" + b"p" * 125) * 500, 4 << 20)


def all_at_once(port, act, n=CLIENTS):
    """What each of them has said, or None: it was not let in.  They stay connected."""
    said, open_ones, lock = [], [], threading.Lock()

    def run(i):
        try:
            s, n = act(port, i)
            with lock:
                said.append(n)
                open_ones.append(s)
        except (Refused, OSError):
            with lock:
                said.append(None)

    threads = [threading.Thread(target=run, args=(i,)) for i in range(n)]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    return said, open_ones


def the_page_is_there(port):
    check(ask(port, "GET /")[0] == 200, "the page can be had")
    s = Socket(port)
    s.until("hello")
    beats = [s.until("time") for _ in range(2)]
    check(beats[1]["now"] > beats[0]["now"], "and it is told of what goes on")
    s.close()


def none_of_them_costs_memory(process, port):
    before = peak_mb(process)
    for act in (announces_a_gigabyte, never_ends_a_message, never_ends_its_header,
                never_ends_its_path, sends_a_body, pings_and_reads_nothing):
        said, open_ones = all_at_once(port, act)
        print("%s: said %s MB, peak %.0f MB" % (
            act.__name__.replace("_", " "),
            ["-" if n is None else round(n / 1e6, 1) for n in said], peak_mb(process)))
        check(sum(n is not None for n in said) >= CLIENTS // 2,
              "%s: too few of them were let in: %s" % (act.__name__, said))
        check(peak_mb(process) < MOST_MB,
              "%s: %.0f MB instead of %.0f" % (act.__name__, peak_mb(process), before))
        for s in open_ones:
            s.close()
        the_page_is_there(port)


def a_frame_too_large_is_refused_unheard(port):
    for path, headers in ("/live", {}), ("/", FOXGLOVE):
        w = Socket(port, path, **headers)
        w.s.sendall(head(1, 1 << 30))
        opcode, data = 0, b""
        try:
            while opcode != 8:
                opcode, data = w.frame()
        except Refused:
            pass
        check(opcode == 8 and data[:2] == b"\x03\xf1", "%s: 1009, too large: %r" % (path, data))
        w.close()


def half_a_handshake_keeps_nobody_out(port):
    halves = []
    for i in range(200):
        s = connect(port)
        s.sendall(b"GET / HT" if i % 2 else b"")
        halves.append(s)
        if i % 50 == 49:
            the_page_is_there(port)
    for s in halves:
        s.close()


def main():
    # AddressSanitizer keeps what was freed, up to 256 MB of it: that would be measured.
    os.environ["ASAN_OPTIONS"] = ":".join(filter(None, (
        os.environ.get("ASAN_OPTIONS"), "quarantine_size_mb=0:thread_local_quarantine_size_kb=0")))
    run_dir = tempfile.mkdtemp(prefix="anlos-view-")
    view, port = start(sys.argv[1], run_dir)
    try:
        the_page_is_there(port)
        a_frame_too_large_is_refused_unheard(port)
        half_a_handshake_keeps_nobody_out(port)
        none_of_them_costs_memory(view, port)
        view.send_signal(signal.SIGTERM)
        check(view.wait(45) == 130, "it ends as ever")
    finally:
        view.kill()
        view.wait()
        view.stdout.close()
        os.rmdir(run_dir)


if __name__ == "__main__":
    main()
