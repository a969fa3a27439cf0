# SPDX-License-Identifier: MIT
"""The topics of a running system: what comes as the messages of a Bag, and what is sent.  Both go
through the program (`anlos topic echo --mcap`, `anlos topic pub`), which knows the bus."""
import collections
import json
import logging
import math
import os
import select
import shutil
import struct
import subprocess
import threading
import time
from typing import Any, Iterator, Optional, Union

import numpy

from .bag import (_CHANNEL, _FOOTER, _MAGIC, _MESSAGE, _SCHEMA, Message, Record, _Channel,
                  _message, _Reader, _take_channel, _take_schema)

_log = logging.getLogger("anlos")
_TENSOR_TYPES = {"float32": "FLOAT32", "complex64": "COMPLEX64"}
_LAST_WORD_S = 0.05  # from there to its end
_EXACT = 1 << 53  # whole numbers beyond go as texts

Path = Union[str, os.PathLike]


def _program(path: Optional[Path]) -> str:
    found = os.fspath(path) if path else os.environ.get("ANLOS_PROGRAM") or shutil.which("anlos")
    if not found:
        raise FileNotFoundError("no program anlos on the PATH; name it with program= or "
                                "ANLOS_PROGRAM")
    return found


def run_program(program: Optional[Path], command: str, *words: str) -> None:
    """`anlos COMMAND ...` to its end; what it says of what is wrong is the exception's."""
    done = subprocess.run([_program(program), command, *words], stdout=subprocess.DEVNULL,
                          stderr=subprocess.PIPE, check=False)
    said = [line for line in done.stderr.decode(errors="replace").splitlines()
            if not line.startswith("Try '")]
    if done.returncode:
        text = said[-1] if said else f"anlos {command} ended with {done.returncode}"
        text = text.removeprefix(f"anlos {command}: ")
        raise ValueError(text) if done.returncode == 2 else RuntimeError(text)
    for line in said:
        _log.warning("%s", line)


class _Process:
    """`anlos topic ...` with pipes.  What it says on the way goes to the log of name anlos, the
    last of it into the exception."""

    def __init__(self, program: Optional[Path], run_dir: Optional[Path], *words: str):
        words = (_program(program), "topic", *words)
        if run_dir is not None:
            words += ("--run-dir", os.fspath(run_dir))
        self.popen = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE)
        self._said: collections.deque = collections.deque(maxlen=1)
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def _listen(self) -> None:
        for line in self.popen.stderr:
            text = line.decode(errors="replace").strip().removeprefix("anlos topic: ")
            if text.startswith("Try '"):
                continue
            self._said.append(text)
            # What it ends with, the exception says.
            if not select.select([self.popen.stderr], [], [], _LAST_WORD_S)[0]:
                _log.warning("%s", text)

    def failure(self) -> Exception:
        """Why it has ended."""
        code = self.popen.wait()
        self._listener.join()
        text = self._said[-1] if self._said else f"anlos topic ended with {code}"
        return ValueError(text) if code == 2 else RuntimeError(text)

    def end(self) -> None:
        for pipe in (self.popen.stdin, self.popen.stdout):
            try:
                pipe.close()
            except BrokenPipeError:
                pass
        self.popen.wait()
        self._listener.join()
        self.popen.stderr.close()

    def stop(self) -> None:
        self.popen.terminate()
        self.end()


class Subscription:
    """What comes on some topics, from now on: an iterator of Message; made by subscribe()."""

    def __init__(self, *topics: str, run_dir: Optional[Path] = None,
                 timeout_s: Optional[float] = None, wait: bool = False,
                 program: Optional[Path] = None):
        #: messages that did not come: gaps in the numbers of their senders
        self.lost: int = 0
        self.timeout_s = timeout_s
        self._schemas: dict[int, Any] = {}
        self._channels: dict[int, _Channel] = {}
        self._next: dict[tuple[str, str, str], int] = {}
        self._buffer = bytearray()
        self._process: Optional[_Process] = _Process(
            program, run_dir, "echo", *topics, "--mcap", *(["--wait"] if wait else []))
        self._fd = self._process.popen.stdout.fileno()
        self._take(len(_MAGIC), None)  # it listens now, or says why not

    def __iter__(self) -> Iterator[Message]:
        return self

    def __next__(self) -> Message:
        if self._process is None:
            raise StopIteration
        end_s = None if self.timeout_s is None else time.monotonic() + self.timeout_s
        while True:
            # head and content together, so that what is late leaves nothing half taken
            size, = struct.unpack("<Q", self._look(9, end_s)[1:])
            code, r = next(_Reader(self._take(9 + size, end_s)).records())
            if code == _SCHEMA:
                _take_schema(r, self._schemas)
            elif code == _CHANNEL:
                _take_channel(r, self._schemas, self._channels)
            elif code == _MESSAGE:
                return self._message(r)
            elif code == _FOOTER:
                raise self._failed()

    def _message(self, r: _Reader) -> Message:
        number, sequence, publish_ns, capture_ns = r.numbers("HIQQ")
        channel = self._channels[number]
        source = channel.topic, channel.node, channel.epoch
        self.lost += max(0, sequence - self._next.get(source, sequence))
        self._next[source] = sequence + 1
        return _message(channel, sequence, publish_ns, capture_ns,
                        bytes(r.take(len(r.data) - r.at)))

    def _look(self, n: int, end_s: Optional[float]) -> bytes:
        while len(self._buffer) < n:
            left_s = None if end_s is None else max(0.0, end_s - time.monotonic())
            if not select.select([self._fd], [], [], left_s)[0]:
                raise TimeoutError(f"no message for {self.timeout_s} s")
            data = os.read(self._fd, 1 << 20)
            if not data:
                raise self._failed()
            self._buffer += data
        return bytes(self._buffer[:n])

    def _take(self, n: int, end_s: Optional[float]) -> bytes:
        data = self._look(n, end_s)
        del self._buffer[:n]
        return data

    def _failed(self) -> Exception:
        process, self._process = self._process, None
        why = process.failure()
        process.end()
        return why

    def close(self) -> None:
        """Ends it; nothing more comes then."""
        process, self._process = self._process, None
        if process:
            process.stop()

    def __enter__(self) -> "Subscription":
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def __del__(self):
        if getattr(self, "_process", None):
            self.close()


def _json(value: Any) -> Any:
    if isinstance(value, Record):
        if isinstance(value.content, bytes):
            raise TypeError("a message of another encoding than protobuf")
        return {f.name: _json(getattr(value, f.name)) for f in value.content.DESCRIPTOR.fields}
    if isinstance(value, numpy.ndarray):
        kind = _TENSOR_TYPES.get(value.dtype.name)
        if kind is None:
            return _json(value.tolist())
        flat = value.ravel()
        numbers = flat.view("f4").reshape(-1, 2) if kind == "COMPLEX64" else flat
        return {"type": kind, "shape": list(value.shape), "data": _json(numbers.tolist())}
    if isinstance(value, numpy.generic):
        return _json(value.item())
    if isinstance(value, dict):
        return {k: _json(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_json(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        if math.isnan(value):
            return None
        raise ValueError("infinity cannot be published")
    if isinstance(value, int) and abs(value) > _EXACT and not isinstance(value, bool):
        return str(value)
    return value


class Publisher:
    """One topic, to send on; made by publish()."""

    def __init__(self, topic: str, *, run_dir: Optional[Path] = None, wait: bool = False,
                 force: bool = False, name: Optional[str] = None,
                 program: Optional[Path] = None):
        self.topic = topic
        words = ["pub", topic, "-", "--print"]
        words += ["--wait"] * wait + ["--force"] * force
        self._how = program, run_dir, *words, *(["--from", name] if name else [])
        self._process: Optional[_Process] = _Process(*self._how)
        self._closed = False

    def send(self, message: Union[Record, dict, None] = None, *,
             capture_ns: Optional[int] = None, **fields) -> int:
        """Sends the message, or one of these fields; what is left out has its default.  float32
        and complex64 arrays are tensors, others numbers or places; NaN stays NaN.  capture_ns:
        when it was measured, where that is not now.  When it was sent (Unix time, ns).

        ValueError: not of the topic's schema, or not permitted; RuntimeError: nothing is
        running, say.  The next message starts anew then."""
        if self._closed:
            raise ValueError("the publisher is closed")
        content = {**_json({} if message is None else message), **_json(fields)}
        line = {"topic": self.topic, "content": content}
        if capture_ns is not None:
            line["capture_ns"] = int(capture_ns)
        if self._process is None:
            self._process = _Process(*self._how)
        pipes = self._process.popen
        try:
            pipes.stdin.write(json.dumps(line, allow_nan=False).encode() + b"\n")
            pipes.stdin.flush()
            answer = pipes.stdout.readline()
        except BrokenPipeError:
            answer = b""
        if not answer:
            process, self._process = self._process, None
            why = process.failure()
            process.end()
            raise why
        return json.loads(answer)["publish_ns"]

    def close(self) -> None:
        """What was sent is out then."""
        process, self._process, self._closed = self._process, None, True
        if process:
            process.end()

    def __enter__(self) -> "Publisher":
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def __del__(self):
        if getattr(self, "_process", None):
            self.close()


def subscribe(*topics: str, run_dir: Optional[Path] = None, timeout_s: Optional[float] = None,
              wait: bool = False, program: Optional[Path] = None) -> Subscription:
    """What a running system says, from now on, as the messages of a Bag.

        with anlos.subscribe("detections", "ego") as live:
            for m in live:
                print(m.topic, m.publish_ns)

    run_dir: of the system, as of `anlos topic --run-dir`.  timeout_s: TimeoutError when nothing
    comes for so long; it may go on after that.  wait: also when nothing is running yet, else
    RuntimeError.  No such topic: ValueError.  What got lost is counted in `lost`.  program: anlos,
    if not on the PATH or in ANLOS_PROGRAM.  Needs python3-protobuf."""
    return Subscription(*topics, run_dir=run_dir, timeout_s=timeout_s, wait=wait, program=program)


def publish(topic: str, *, run_dir: Optional[Path] = None, wait: bool = False,
            force: bool = False, name: Optional[str] = None,
            program: Optional[Path] = None) -> Publisher:
    """To say something to a running system.

        with anlos.publish("ego") as ego:
            ego.send(speed_m_s=1.5, yaw_rate_rad_s=0.0, valid=True)

    Topics from outside are ego, ambient and wall/given, while no process can runs, and
    stage/manual; force and name are --force and --from of `anlos topic pub`."""
    return Publisher(topic, run_dir=run_dir, wait=wait, force=force, name=name, program=program)
