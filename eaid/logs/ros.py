"""ROS bags: version 1 (.bag), and version 2 as it lies in its folder (.db3, .mcap); numeric fields of all topics.

rosbags opens the containers and parses the message definitions in them; messages are taken apart by `rosmsg`, so that
no code made from a file is run. A message counts at the stamp of its header where that is within a minute of the bag's
own time, else at the bag's time. Chunks that unpack to more than `MOST_RATIO` times their size are refused.
"""

import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.logs.extras import damage_told, library
from eaid.logs.rosmsg import Definitions, Layout, layout_of
from eaid.logs.sheet import Sheet
from eaid.logs.signals import Signal, sheets_of_signals

WHAT = "ROS bag"
MOST_RATIO = 200
NEAR_NS = 60_000_000_000
UNITS = {"torque": "N·m", "force": "N"}
"""Units of geometry_msgs/Wrench, which every ROS message keeps."""


@contextmanager
def _opened(path: Path, source: str) -> Iterator[Any]:
    """The reader of rosbags that fits the first bytes, open."""
    with path.open("rb") as raw:
        head = raw.read(16)
    if head.startswith(b"#ROSBAG"):
        module = library("rosbags.rosbag1.reader", source, WHAT)
        module.decompressors.update(bz2=_unpack_bz2, lz4=_unpack_lz4)
        reader = module.Reader(path)
    elif head.startswith(b"\x89MCAP"):
        module = library("rosbags.rosbag2.storage_mcap", source, WHAT)
        module.DECOMPRESSORS.update(lz4=lambda data, _: _unpack_lz4(data), zstd=lambda data, _: _unpack_zstd(data))
        reader = module.McapReader(path)
    else:
        reader = library("rosbags.rosbag2.storage_sqlite3", source, WHAT).Sqlite3Reader(path)
    reader.open()
    try:
        yield reader
    finally:
        reader.close()


def _bounded(unpacker: Any, data: bytes, what: str) -> bytes:
    most = max(MOST_RATIO * len(data), 1 << 22)
    unpacked = bytes(unpacker.decompress(data, max_length=most))
    if not unpacker.eof:
        raise ValueError(f"a {what} chunk is cut short, or unpacks to more than {MOST_RATIO} times its size")
    return unpacked


def _unpack_bz2(data: bytes) -> bytes:
    import bz2

    return _bounded(bz2.BZ2Decompressor(), data, "bz2")


def _unpack_lz4(data: bytes) -> bytes:
    from importlib import import_module

    return _bounded(import_module("lz4.frame").LZ4FrameDecompressor(), data, "lz4")


def _unpack_zstd(data: bytes) -> bytes:
    import sys

    if sys.version_info >= (3, 14):
        from compression import zstd
    else:
        from backports import zstd
    return _bounded(zstd.ZstdDecompressor(), data, "zstd")


def read_ros(path: Path, source: str) -> list[Sheet]:
    """Sheets of a ROS bag; raises DataError where no topic in it holds numbers."""
    signals: list[Signal] = []
    unknown: set[str] = set()
    with damage_told(source, WHAT), _opened(path, source) as reader:
        big = path.stat().st_size
        for connection in sorted(reader.connections, key=lambda one: (one.topic, one.id)):
            if connection.msgcount > big:
                raise DataError(f"{source}: {connection.topic} claims more messages than the file has bytes")
            first = next(_messages(reader, connection), None)
            if first is None:
                continue
            stamp, raw = first
            try:
                layout = layout_of(_definitions(connection, source), connection.msgtype, raw, ros1=_is_ros1(reader))
            except (ValueError, struct.error, AssertionError, RecursionError):
                unknown.add(f"{connection.topic} ({connection.msgtype})")
                continue
            by_header = layout.stamp_ns is not None and abs(layout.stamp_ns - stamp) < NEAR_NS
            topic = connection.topic.strip("/")
            for field in layout.fields:
                name = topic if layout.fields == ("data",) else f"{topic}/{field}"
                signals.append(
                    Signal(
                        name, _unit(connection.msgtype, field), str(connection.id), connection.id,
                        _loader(path, source, (connection.id, connection.topic), layout, field, by_header),
                    )
                )  # fmt: skip
    if not signals:
        more = f" that can be read ({', '.join(sorted(unknown)[:6])} cannot)" if unknown else ""
        raise DataError(f"{source}: no topic in it holds numbers{more}; export the topics as CSV")
    return sheets_of_signals(source, signals)


def _unit(msgtype: str, field: str) -> str:
    if not msgtype.startswith("geometry_msgs/msg/Wrench"):
        return ""
    return next((unit for word, unit in UNITS.items() if word in field.split(".")), "")


def _is_ros1(reader: Any) -> bool:
    return "rosbag1" in type(reader).__module__


def _messages(reader: Any, connection: Any) -> Iterator[tuple[int, bytes]]:
    for _, stamp, raw in reader.messages([connection]):
        yield int(stamp), bytes(raw)


def _definitions(connection: Any, source: str) -> Definitions:
    """Message definitions behind a topic: those in the bag, else the standard ones; ValueError where they are wrong."""
    typesys = library("rosbags.typesys", source, WHAT)
    form, text = connection.msgdef.format.name, connection.msgdef.data
    if form not in ("MSG", "IDL"):
        return Definitions(typesys.get_typestore(typesys.Stores.ROS2_HUMBLE).fielddefs)
    try:
        if form == "MSG":
            return Definitions(typesys.get_types_from_msg(text, connection.msgtype))
        found: dict[str, Any] = {}
        for part in text.split("=" * 80 + "\n"):
            idl = part.partition("\n")[2] if part.startswith("IDL: ") else part
            if idl.strip():
                found.update(typesys.get_types_from_idl(idl))
        return Definitions(found)
    except typesys.TypesysError as fault:
        raise ValueError(str(fault)) from None


def _loader(
    path: Path, source: str, which: tuple[int, str], layout: Layout, field: str, by_header: bool
) -> Callable[[], tuple[Array, Array]]:
    def load() -> tuple[Array, Array]:
        stamps: list[int] = []
        values: list[float] = []
        with damage_told(source, WHAT), _opened(path, source) as reader:
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

    return load
