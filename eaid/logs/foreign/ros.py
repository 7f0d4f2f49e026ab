"""ROS bags: version 1 (.bag), and version 2 as it lies in its folder (.db3, .mcap); numeric fields of all topics.

rosbags opens the containers and parses the message definitions in them; messages are taken apart by `rosmsg`, so that
no code made from a file is run. A message counts at the stamp of its header where that is within a minute of the bag's
own time, else at the bag's time.
"""

import math
import struct
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.logs.foreign.signals import Signal, tables_of_signals
from eaid.logs.table import Table

FORMATS = {
    "bool": "?", "byte": "B", "char": "B", "octet": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H",
    "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
MOST_ELEMENTS = 64
"""Elements of an array that become columns; longer arrays are pictures and scans, not logs."""
DEEPEST = 20
_TIMES = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")


Definitions = Mapping[str, Any]
"""Message type → (constants, fields), as rosbags parses them."""


class _Leaf(NamedTuple):
    path: str
    value: float | str
    blob: bool
    """True where it belongs to a long array."""


class _Reader:
    """Walks one message."""

    def __init__(self, definitions: Definitions, raw: bytes, ros1: bool) -> None:
        self.definitions = definitions
        self.ros1 = ros1
        if ros1:
            self.raw, self.order = raw, "<"
        else:
            if len(raw) < 4 or raw[0] != 0 or raw[1] not in (0, 1):
                raise ValueError("a message is not plain CDR")
            self.raw, self.order = raw[4:], "<" if raw[1] else ">"
        self.at = 0
        self.leaves = 0

    def fields(self, name: str) -> list[tuple[str, Any]]:
        """Fields of a type, name and description each; raises ValueError where it is not defined."""
        if name in _TIMES:
            return [("sec", (1, ("int32", 0))), ("nanosec", (1, ("uint32", 0)))]
        if name not in self.definitions:
            raise ValueError(f"message type {name} is not defined")
        return list(self.definitions[name][1])

    def number(self, kind: str) -> float:
        """Next number; CDR aligns it to its size."""
        form = FORMATS[kind]
        size = struct.calcsize(form)
        if not self.ros1:
            self.at += -self.at % size
        (value,) = struct.unpack_from(self.order + form, self.raw, self.at)
        self.at += size
        return float(value)

    def length(self) -> int:
        """Next count of elements or bytes; raises ValueError where the message is too short for it."""
        count = int(self.number("uint32"))
        if count > len(self.raw) - self.at:
            raise ValueError("a message is cut short")
        return count

    def text(self) -> str:
        """Next string."""
        count = self.length()
        found = self.raw[self.at : self.at + count]
        self.at += count
        return found.rstrip(b"\0").decode("utf-8", errors="replace")

    def walk(self, path: str, kind: Any, depth: int = 0, blob: bool = False) -> Iterator[_Leaf]:
        """Every leaf behind one field, in the order of the bytes."""
        node, what = int(kind[0]), kind[1]
        if depth > DEEPEST:
            raise ValueError("a message definition holds itself")
        if node == 1:  # base type
            name = what[0]
            if name == "string":
                yield _Leaf(path, self.text(), blob)
            elif name in FORMATS:
                yield _Leaf(path, self.number(name), blob)
            else:
                raise ValueError(f"fields of type {name} cannot be read")
        elif node == 2:  # a type by name
            for field, inner in self.fields(what):
                yield from self.walk(f"{path}.{field}" if path else field, inner, depth + 1, blob)
        else:  # array, sequence
            inner, count = what
            if node == 4:
                count = self.length()
            base = inner[1][0] if int(inner[0]) == 1 else ""
            if base in FORMATS and (count > MOST_ELEMENTS or base in ("uint8", "byte", "octet", "char")):
                size = struct.calcsize(FORMATS[base])
                if count and not self.ros1:
                    self.at += -self.at % size
                self.at += size * count
                return
            if count > len(self.raw):
                raise ValueError("an array is longer than its message")
            for i in range(count):
                yield from self.walk(f"{path}[{i}]", inner, depth + 1, blob or count > MOST_ELEMENTS)


@dataclass(frozen=True)
class Layout:
    """Numeric fields of a topic, as its first message has them."""

    definitions: Definitions
    msgtype: str
    ros1: bool
    places: Mapping[str, str]
    """Field as shown → its path in the message."""
    stamp_ns: int | None
    """Stamp in the header of the first message [ns]; None where it has none."""

    def value(self, raw: bytes, field: str) -> tuple[int | None, float]:
        """Stamp of the header [ns] and one field of a message; NaN where this message does not have the field."""
        wanted, found = self.places[field], math.nan
        sec = nanosec = None
        for leaf in _Reader(self.definitions, raw, self.ros1).walk("", (2, self.msgtype)):
            if leaf.path == wanted and not isinstance(leaf.value, str):
                found = leaf.value
                if self.stamp_ns is None or nanosec is not None:
                    break
            elif leaf.path == "header.stamp.sec":
                sec = leaf.value
            elif leaf.path == "header.stamp.nanosec":
                nanosec = leaf.value
        return _stamp(sec, nanosec), found


def _stamp(sec: float | str | None, nanosec: float | str | None) -> int | None:
    if not isinstance(sec, float) or not isinstance(nanosec, float) or not sec > 0:
        return None
    return int(sec) * 1_000_000_000 + int(nanosec)


def layout_of(definitions: Definitions, msgtype: str, raw: bytes, ros1: bool) -> Layout:
    """Numeric fields of a topic by its first message; raises ValueError where the message does not fit its type."""
    leaves = list(_Reader(definitions, raw, ros1).walk("", (2, msgtype)))
    values = {leaf.path: leaf.value for leaf in leaves}
    places: dict[str, str] = {}
    for leaf in leaves:
        if isinstance(leaf.value, str) or leaf.blob or leaf.path.startswith("header."):
            continue
        head, bracket, rest = leaf.path.rpartition("[")
        joint = values.get(f"name[{rest}") if bracket and "." not in head else None
        places[f"{head}[{joint}]" if isinstance(joint, str) and joint else leaf.path] = leaf.path
    stamp = _stamp(values.get("header.stamp.sec"), values.get("header.stamp.nanosec"))
    return Layout(definitions, msgtype, ros1, places, stamp)


NEAR_NS = 60_000_000_000
UNITS = {"torque": "N·m", "force": "N"}
"""Units of geometry_msgs/Wrench, which every ROS message keeps."""


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """The reader of rosbags that fits the first bytes, open."""
    with path.open("rb") as raw:
        head = raw.read(16)
    reader: Any
    if head.startswith(b"#ROSBAG"):
        from rosbags.rosbag1.reader import Reader

        reader = Reader(path)
    elif head.startswith(b"\x89MCAP"):
        from rosbags.rosbag2.storage_mcap import McapReader

        reader = McapReader(path)
    else:
        from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

        reader = Sqlite3Reader(path)
    reader.open()
    try:
        yield reader
    finally:
        reader.close()


def read_ros(path: Path, source: str) -> list[Table]:
    """Tables of a ROS bag; raises DataError where no topic in it holds numbers."""
    signals: list[Signal] = []
    unknown: set[str] = set()
    with _opened(path) as reader:
        big = path.stat().st_size
        for connection in sorted(reader.connections, key=lambda one: (one.topic, one.id)):
            if connection.msgcount > big:
                raise DataError(f"{source}: {connection.topic} claims more messages than the file has bytes")
            first = next(_messages(reader, connection), None)
            if first is None:
                continue
            stamp, raw = first
            try:
                layout = layout_of(_definitions(connection), connection.msgtype, raw, ros1=_is_ros1(reader))
            except (ValueError, struct.error, AssertionError, RecursionError):
                unknown.add(f"{connection.topic} ({connection.msgtype})")
                continue
            by_header = layout.stamp_ns is not None and abs(layout.stamp_ns - stamp) < NEAR_NS
            topic = connection.topic.strip("/")
            for field in layout.places:
                name = topic if list(layout.places) == ["data"] else f"{topic}/{field}"
                signals.append(
                    Signal(
                        name, _unit(connection.msgtype, field), str(connection.id), connection.id,
                        partial(_signal, path, source, (connection.id, connection.topic), layout, field, by_header),
                    )
                )  # fmt: skip
    if not signals:
        more = f" that can be read ({', '.join(sorted(unknown)[:6])} cannot)" if unknown else ""
        raise DataError(f"{source}: no topic in it holds numbers{more}; export the topics as CSV")
    return tables_of_signals(source, signals)


def _unit(msgtype: str, field: str) -> str:
    if not msgtype.startswith("geometry_msgs/msg/Wrench"):
        return ""
    return next((unit for word, unit in UNITS.items() if word in field.split(".")), "")


def _is_ros1(reader: Any) -> bool:
    return "rosbag1" in type(reader).__module__


def _messages(reader: Any, connection: Any) -> Iterator[tuple[int, bytes]]:
    for _, stamp, raw in reader.messages([connection]):
        yield int(stamp), bytes(raw)


def _definitions(connection: Any) -> Definitions:
    """Message definitions behind a topic: those in the bag, else the standard ones; ValueError where they are wrong."""
    from rosbags import typesys
    from rosbags.interfaces.typing import Typesdict

    form, text = connection.msgdef.format.name, connection.msgdef.data
    if form not in ("MSG", "IDL"):
        return typesys.get_typestore(typesys.Stores.ROS2_HUMBLE).fielddefs
    try:
        if form == "MSG":
            return typesys.get_types_from_msg(text, connection.msgtype)
        types: Typesdict = {}
        for part in text.split("=" * 80 + "\n"):
            idl = part.partition("\n")[2] if part.startswith("IDL: ") else part
            if idl.strip():
                types.update(typesys.get_types_from_idl(idl))
        return types
    except typesys.TypesysError as fault:
        raise ValueError(str(fault)) from None


def _signal(
    path: Path, source: str, which: tuple[int, str], layout: Layout, field: str, by_header: bool
) -> tuple[Array, Array]:
    stamps: list[int] = []
    values: list[float] = []
    with _opened(path) as reader:
        connection = next(one for one in reader.connections if (one.id, one.topic) == which)
        start = int(reader.start_time if _is_ros1(reader) else reader.metadata.start_time)
        for stamp, raw in _messages(reader, connection):
            at, value = layout.value(raw, field)
            stamps.append((at if by_header and at is not None else stamp) - start)
            values.append(value)
        if len(values) != connection.msgcount:
            raise DataError(
                f"{source}: {connection.topic} has {len(values)} messages where the bag counts "
                f"{connection.msgcount}; copy it again"
            )
    return np.array(stamps, dtype=np.int64) / 1e9, np.array(values, dtype=np.float64)
