# SPDX-License-Identifier: MIT
"""Bags (MCAP) as NumPy arrays.  The schemas of the messages come from the bag itself; a bag that
was not ended needs `anlos bag recover` first."""
import heapq
import importlib
import mmap
import os
import struct
import zlib
from typing import Any, Callable, Iterator, NamedTuple, Optional, Union

import numpy

_MAGIC = b"\x89MCAP0\r\n"
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _CHUNK_INDEX, _STATISTICS = 2, 3, 4, 5, 6, 8, 11
_TENSORS = {"FLOAT32": numpy.dtype("<f4"), "COMPLEX64": numpy.dtype("<c8")}
_SHUFFLED = {3: 0.0, 4: 2.0**15, 5: 2.0**23, 6: 2.0**31}  # steps in 1.0
_FOOTER_SIZE = 1 + 8 + 20 + len(_MAGIC)


def _need(module: str, package: str):
    try:
        return importlib.import_module(module)
    except ImportError as e:
        raise ImportError(f"anlos needs {module} here (Debian: {package})") from e


class _Reader:
    """Numbers and texts of a record, one after the other."""

    def __init__(self, data):
        self.data, self.at = data, 0

    def take(self, n: int):
        if n > len(self.data) - self.at:
            raise ValueError("a record is cut off: the bag is damaged; see anlos bag check")
        self.at += n
        return self.data[self.at - n:self.at]

    def numbers(self, layout: str):
        layout = "<" + layout
        return struct.unpack(layout, self.take(struct.calcsize(layout)))

    def text(self) -> str:
        return bytes(self.take(*self.numbers("I"))).decode()

    def map(self, key: Callable, value: Callable) -> dict:
        inner = _Reader(self.take(*self.numbers("I")))
        out = {}
        while inner.at < len(inner.data):
            k = key(inner)
            out[k] = value(inner)
        return out

    def records(self) -> Iterator[tuple[int, "_Reader"]]:
        while self.at < len(self.data):
            code, size = self.numbers("BQ")
            yield code, _Reader(self.take(size))


class _Chunk(NamedTuple):
    start_ns: int
    at: int
    size: int
    channels: frozenset


class _Channel(NamedTuple):
    topic: str
    node: str
    epoch: str  # which start of that node
    captured: bool
    message: Any  # the protobuf class


class Record:
    """A message, or one in another, by its fields' names (msgs/*.proto); pass_ for pass.

    Tensors are arrays of their shape, numbers that repeat are arrays, Vec3 is an array of three
    (None where it is absent), several are [n][3], enumerations are their names, other messages
    that repeat are lists.  `content` is the protobuf message itself, or the
    bytes of a message that another program wrote in another encoding."""

    def __init__(self, content):
        self.content = content

    def __getattr__(self, name: str) -> Any:
        content = self.__dict__["content"]
        if isinstance(content, bytes):
            raise AttributeError("the message is not of protobuf: its bytes are in content")
        field = content.DESCRIPTOR.fields_by_name.get(name.rstrip("_"))
        if field is None:
            raise AttributeError(f"{content.DESCRIPTOR.name} has no {name}; it has "
                                 + ", ".join(content.DESCRIPTOR.fields_by_name))
        return _plain(content, field)

    def __dir__(self):
        fields = () if isinstance(self.content, bytes) else self.content.DESCRIPTOR.fields_by_name
        return [*super().__dir__(), *fields]

    def __repr__(self):
        kind = "" if isinstance(self.content, bytes) else " " + self.content.DESCRIPTOR.name
        return f"<{type(self).__name__}{kind}>"


class Message(Record):
    """A message of a bag, with what its envelope said.  capture_ns is when its sound was taken,
    None where it is of none; publish_ns when it was sent (Unix time)."""

    def __init__(self, channel: _Channel, sequence: int, publish_ns: int, capture_ns: int,
                 content):
        super().__init__(content)
        self.topic: str = channel.topic
        self.node: str = channel.node
        self.sequence: int = sequence
        self.publish_ns: int = publish_ns
        self.capture_ns: Optional[int] = capture_ns if channel.captured else None


def _take_schema(r: _Reader, schemas: dict[int, Any]) -> None:
    """A schema's protobuf class by its number; None: of another encoding."""
    number, = r.numbers("H")
    name, encoding, data = r.text(), r.text(), bytes(r.take(*r.numbers("I")))
    schemas[number] = None
    if encoding != "protobuf":
        return
    files = _need("google.protobuf.descriptor_pb2", "python3-protobuf").FileDescriptorSet()
    pool = _need("google.protobuf.descriptor_pool", "python3-protobuf").DescriptorPool()
    factory = _need("google.protobuf.message_factory", "python3-protobuf")
    files.ParseFromString(data)
    for f in files.file:
        pool.AddSerializedFile(f.SerializeToString())
    kind = pool.FindMessageTypeByName(name)
    schemas[number] = (factory.GetMessageClass(kind) if hasattr(factory, "GetMessageClass")
                       else factory.MessageFactory(pool).GetPrototype(kind))


def _take_channel(r: _Reader, schemas: dict[int, Any], channels: dict[int, _Channel]) -> str:
    number, schema = r.numbers("HH")
    topic, _ = r.text(), r.text()
    notes = r.map(_Reader.text, _Reader.text)
    channels[number] = _Channel(topic, notes.get("node", ""), notes.get("epoch_ns", ""),
                                notes.get("capture") == "publish_time", schemas.get(schema))
    return topic


def _message(channel: _Channel, sequence: int, publish_ns: int, capture_ns: int,
             content: bytes) -> Message:
    return Message(channel, sequence, publish_ns, capture_ns,
                   channel.message.FromString(content) if channel.message else content)


def _unshuffled(data: bytes, steps: float) -> numpy.ndarray:
    """msgs/shuffle.h: byte 0 of all elements, then byte 1, 2, 3; of whole numbers, zigzag, of
    which `steps` are 1.0, or of the bits of a float, the sign last (steps 0)."""
    u = numpy.frombuffer(data, numpy.uint8).reshape(4, -1).T.copy().view("<u4")[:, 0]
    if not steps:
        return (u >> 1 | u << 31).view("<f4")
    whole = (u >> 1).view("<i4") ^ -(u & 1).astype("<i4")
    return whole.astype("<f4") / numpy.float32(steps)


def _tensor(t) -> Optional[numpy.ndarray]:
    if t.type in _SHUFFLED:  # by number: the bag may have the schema of before
        return _unshuffled(t.data, _SHUFFLED[t.type]).reshape(tuple(t.shape))
    kind = _TENSORS.get(t.DESCRIPTOR.enum_types_by_name["Type"].values_by_number[t.type].name)
    return None if kind is None else numpy.frombuffer(t.data, kind).reshape(tuple(t.shape))


def _one(field, value):
    if field.message_type is None:
        return field.enum_type.values_by_number[value].name if field.enum_type else value
    if field.message_type.full_name == "anlos.Tensor":
        return _tensor(value)
    return numpy.array([value.x, value.y, value.z]) if _is_vec3(field) else Record(value)


def _is_vec3(field) -> bool:
    return field.message_type is not None and field.message_type.full_name == "anlos.Vec3"


def _plain(content, field):
    value = getattr(content, field.name)
    if field.label == field.LABEL_REPEATED:
        if _is_vec3(field):
            return numpy.array([(v.x, v.y, v.z) for v in value]).reshape(-1, 3)
        return ([_one(field, v) for v in value] if field.message_type or field.enum_type
                else numpy.array(value, dtype=_column_type(field)))
    if field.message_type and not content.HasField(field.name):
        return None
    return _one(field, value)


def _column_type(field) -> Any:
    return {field.CPPTYPE_DOUBLE: "f8", field.CPPTYPE_FLOAT: "f8", field.CPPTYPE_BOOL: "?",
            field.CPPTYPE_INT32: "i8", field.CPPTYPE_INT64: "i8", field.CPPTYPE_UINT32: "u8",
            field.CPPTYPE_UINT64: "u8"}.get(field.cpp_type, object)


class Bag:
    """A recording.

        bag = anlos.Bag("drive.mcap")
        bag.topics                                  # {"ping": 833, "ego": 1030, ...}
        for ping in bag.messages("ping"):
            ping.capture_ns, ping.speaker, ping.samples     # float32 [microphone][sample]
        ego = bag.table("ego")
        plot(ego["publish_ns"], ego["speed_m_s"])
        bag.table("detections", "detections")["position_m"]     # [n][3]

    Needs python3-protobuf, and python3-zstandard or python3-lz4 for bags that are packed so.
    What is no bag, or a damaged one, is a ValueError; an array is as long as its message."""

    def __init__(self, path: Union[str, os.PathLike]):
        self._schemas: dict[int, Any] = {}
        self._channels: dict[int, _Channel] = {}
        self._chunks: list[_Chunk] = []
        self._count: Optional[int] = None  # of all messages, where the bag says it
        self.path: str = os.fspath(path)
        #: how many messages there are of each topic
        self.topics: dict[str, int] = {}
        with open(path, "rb") as f:
            size = os.fstat(f.fileno()).st_size
            if size < len(_MAGIC) + _FOOTER_SIZE or f.read(len(_MAGIC)) != _MAGIC:
                raise ValueError(f"{self.path}: no bag (MCAP)")
            self._data = mmap.mmap(f.fileno(), 0, access=mmap.ACCESS_READ)
        footer = _Reader(self._data[-_FOOTER_SIZE:])
        code, length = footer.numbers("BQ")
        start, = footer.numbers("Q")
        if code != _FOOTER or length != 20 or self._data[-len(_MAGIC):] != _MAGIC:
            raise ValueError(f"{self.path}: the bag was not ended; anlos bag recover saves what "
                             "is in it")
        if not start or start > size - _FOOTER_SIZE:
            raise ValueError(f"{self.path}: the bag has no summary; anlos bag recover makes one")
        try:
            for code, r in _Reader(self._data[start:-_FOOTER_SIZE]).records():
                self._take(code, r)
        except KeyError as e:
            raise self._no_channels() from e
        if not self._chunks and self._count != 0:
            raise ValueError(f"{self.path}: the bag has no index; anlos bag recover makes one")
        if not all(c.channels <= self._channels.keys() for c in self._chunks):
            raise self._no_channels()
        self._chunks.sort(key=lambda c: (c.start_ns, c.at))

    def _no_channels(self) -> ValueError:
        return ValueError(f"{self.path}: the summary lacks channels; anlos bag recover makes one")

    def _damaged(self, what: str) -> ValueError:
        return ValueError(f"{self.path}: a {what} is damaged; see anlos bag check")

    def _take(self, code: int, r: _Reader) -> None:
        if code == _SCHEMA:
            _take_schema(r, self._schemas)
        elif code == _CHANNEL:
            self.topics.setdefault(_take_channel(r, self._schemas, self._channels), 0)
        elif code == _CHUNK_INDEX:
            begin, _, at, length = r.numbers("4Q")
            channels = r.map(lambda x: x.numbers("H")[0], lambda x: x.numbers("Q"))
            self._chunks.append(_Chunk(begin, at, length, frozenset(channels)))
        elif code == _STATISTICS:
            self._count = r.numbers("QHIIIIQQ")[0]
            counts = r.map(lambda x: x.numbers("H")[0], lambda x: x.numbers("Q")[0])
            for number, n in counts.items():
                self.topics[self._channels[number].topic] += n

    def _records_of(self, chunk: _Chunk) -> _Reader:
        code, r = next(_Reader(self._data[chunk.at:chunk.at + chunk.size]).records(), (0, None))
        if code != _CHUNK:
            raise self._damaged("summary")
        _, _, size, checksum = r.numbers("QQQI")
        how, plain = r.text(), bytes(r.take(*r.numbers("Q")))
        unpack = None
        if how == "zstd":
            zstd = _need("zstandard", "python3-zstandard").ZstdDecompressor()
            unpack = lambda: zstd.decompress(plain, max_output_size=size)
        elif how == "lz4":
            lz4 = _need("lz4.frame", "python3-lz4")
            unpack = lambda: lz4.decompress(plain)
        if unpack:
            try:
                plain = unpack()
            except Exception as e:  # each library has its own
                raise self._damaged("chunk") from e
        if len(plain) != size or (checksum and zlib.crc32(plain) != checksum):
            raise self._damaged("chunk")
        return _Reader(plain)

    def messages(self, *topics: str) -> Iterator[Message]:
        """The messages of these topics (all without any) in the order in which they were sent."""
        for t in topics:
            if t not in self.topics:
                raise KeyError(f"{self.path} has no topic {t}; it has " + ", ".join(self.topics))
        return self._messages({k: c for k, c in self._channels.items()
                               if not topics or c.topic in topics})

    def _messages(self, wanted: dict[int, _Channel]) -> Iterator[Message]:
        # Of a chunk that does not say so nobody knows what is in it.
        chunks = [c for c in self._chunks if not c.channels or c.channels & wanted.keys()]
        waiting: list = []  # (time, number, message), of chunks that overlap
        number = 0
        for i, chunk in enumerate(chunks):
            for code, r in self._records_of(chunk).records():
                if code != _MESSAGE:
                    continue
                channel, sequence, publish_ns, capture_ns = r.numbers("HIQQ")
                if channel not in self._channels:
                    raise self._no_channels()
                if channel in wanted:
                    heapq.heappush(waiting, (publish_ns, number, self._message(
                        wanted[channel], sequence, publish_ns, capture_ns, r)))
                    number += 1
            while waiting and (i + 1 == len(chunks) or waiting[0][0] < chunks[i + 1].start_ns):
                yield heapq.heappop(waiting)[2]

    def _message(self, channel, sequence, publish_ns, capture_ns, r) -> Message:
        content = bytes(r.take(len(r.data) - r.at))
        if not channel.message:
            return _message(channel, sequence, publish_ns, capture_ns, content)
        decode_error = _need("google.protobuf.message", "python3-protobuf").DecodeError
        try:
            return _message(channel, sequence, publish_ns, capture_ns, content)
        except decode_error as e:
            raise self._damaged(f'message of "{channel.topic}"') from e

    def table(self, topic: str, each: Optional[str] = None) -> numpy.ndarray:
        """A structured array with a row for each message, or for each of those in its field
        `each`: publish_ns, capture_ns (0: of no sound), and its fields that are numbers, names or
        texts.  Vec3 and short rows of numbers are columns of more than one, NaN where there is
        none."""
        times, rows = [], []
        for m in self.messages(topic):
            inner = [m] if each is None else getattr(m, each)
            times += [(m.publish_ns, m.capture_ns or 0)] * len(inner)
            rows += [r.content for r in inner]
        columns = {"publish_ns": numpy.array([t[0] for t in times], dtype="i8"),
                   "capture_ns": numpy.array([t[1] for t in times], dtype="i8")}
        for field in rows[0].DESCRIPTOR.fields if rows else ():
            column = _column(rows, field)
            if column is not None:
                columns[field.name] = column
        out = numpy.empty(len(rows), [(k, c.dtype, c.shape[1:]) for k, c in columns.items()])
        for k, c in columns.items():
            out[k] = c
        return out


_LONGEST = 16  # of a row of numbers in a table


def _column(rows: list, field) -> Optional[numpy.ndarray]:
    if field.message_type is not None:
        if not _is_vec3(field) or field.label == field.LABEL_REPEATED:
            return None
        none = numpy.full(3, numpy.nan)
        at = [_plain(r, field) for r in rows]
        return numpy.array([none if a is None else a for a in at])
    if field.label != field.LABEL_REPEATED:
        kind = _column_type(field)
        values = [_one(field, getattr(r, field.name)) for r in rows]
        return numpy.array(values, dtype=None if kind is object else kind)
    lists = [getattr(r, field.name) for r in rows]
    longest = max(map(len, lists))
    if _column_type(field) is object or not 0 < longest <= _LONGEST:
        return None
    out = numpy.full((len(rows), longest), numpy.nan)
    for i, values in enumerate(lists):
        out[i, :len(values)] = values
    return out
