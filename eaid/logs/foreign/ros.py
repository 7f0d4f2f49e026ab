"""ROS bags: version 1 (.bag), and version 2 as it lies in its folder (.db3, .mcap); numeric fields of all topics.

rosbags opens the containers and parses the message definitions in them; messages are taken apart by `rosmsg`, so that
no code made from a file is run. A message counts at the stamp of its header where that is within a minute of the bag's
own time, else at the bag's time.
"""

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.logs.foreign.rosmsg import Definitions, Layout, layout_of
from eaid.logs.foreign.signals import Signal, tables_of_signals
from eaid.logs.table import Table

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
