"""ROS bags: version 1 (.bag), and version 2 as it lies in its folder (.db3, .mcap); numeric fields of all topics.

A message counts at the stamp of its header where that is within a minute of the bag's own time, else at the bag's time.
"""

import dataclasses
import math
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from eaid.arrays import Array
from eaid.errors import DataError
from eaid.logs.foreign.signals import Signal, tables_of_signals
from eaid.logs.table import Table

MOST_ELEMENTS = 64  # Elements of an array that become columns; longer arrays are pictures and scans, not logs
UNITS = {"torque": "N·m", "force": "N"}  # Units of geometry_msgs/Wrench, which every ROS message keeps


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
    from rosbags.serde import SerdeError
    from rosbags.typesys import TypesysError

    signals: list[Signal] = []
    unknown: set[str] = set()
    with _opened(path) as reader:
        big = path.stat().st_size
        for connection in sorted(reader.connections, key=lambda one: (one.topic, one.id)):
            if connection.msgcount > big:
                raise DataError(f"{source}: {connection.topic} claims more messages than the file has bytes")
            first = next(reader.messages([connection]), None)
            if first is None:
                continue
            try:
                parse = _parser(connection, is_ros1="rosbag1" in type(reader).__module__)
                message = parse(bytes(first[2]))
            except (TypesysError, SerdeError, KeyError, RecursionError, struct.error, AssertionError):
                unknown.add(f"{connection.topic} ({connection.msgtype})")
                continue
            stamp = _stamp(message)
            by_header = stamp is not None and abs(stamp - first[1]) < 60_000_000_000
            topic, places = connection.topic.strip("/"), _places(message)
            for field, place in places.items():
                name = topic if list(places) == ["data"] else f"{topic}/{field}"
                which = connection.id, connection.topic
                load = partial(_signal, path, source, which, parse, place, by_header)
                unit = _unit(connection.msgtype, field)
                signals.append(Signal(name, unit, str(connection.id), connection.id, load))
    if not signals:
        more = f" that can be read ({', '.join(sorted(unknown)[:6])} cannot)" if unknown else ""
        raise DataError(f"{source}: no topic in it holds numbers{more}; export the topics as CSV")
    return [dataclasses.replace(one, dropped=tuple(sorted(unknown))) for one in tables_of_signals(source, signals)]


def _parser(connection: Any, is_ros1: bool) -> Callable[[bytes], Any]:
    """What makes an object of a message, by the definitions in the bag, else by the standard ones."""
    from rosbags import typesys
    from rosbags.interfaces.typing import Typesdict

    form, text = connection.msgdef.format.name, connection.msgdef.data
    if form not in ("MSG", "IDL"):
        store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    else:
        types: Typesdict = typesys.get_types_from_msg(text, connection.msgtype) if form == "MSG" else {}
        for part in text.split("=" * 80 + "\n") if form == "IDL" else ():
            idl = part.partition("\n")[2] if part.startswith("IDL: ") else part
            if idl.strip():
                types.update(typesys.get_types_from_idl(idl))
        store = typesys.get_typestore(typesys.Stores.EMPTY)
        store.register(types)
    return partial(store.deserialize_ros1 if is_ros1 else store.deserialize_cdr, typename=connection.msgtype)


def _leaves(path: str, value: Any) -> Iterator[tuple[str, float | str]]:
    """Every number and string in a field, by its path."""
    if isinstance(value, np.ndarray):
        value = [] if value.dtype == np.uint8 else value.tolist()
    if dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            yield from _leaves(f"{path}.{field.name}" if path else field.name, getattr(value, field.name))
    elif isinstance(value, list):
        for i, each in enumerate(value if len(value) <= MOST_ELEMENTS else ()):
            yield from _leaves(f"{path}[{i}]", each)
    else:
        yield path, value if isinstance(value, str) else float(value)


def _places(message: Any) -> dict[str, str]:
    """Numeric fields of a message: their name, with that of a joint in place of its number → their path."""
    values = dict(_leaves("", message))
    places: dict[str, str] = {}
    for path, value in values.items():
        if isinstance(value, str) or path.startswith("header."):
            continue
        head, bracket, rest = path.rpartition("[")
        joint = values.get(f"name[{rest}") if bracket and "." not in head else None
        places[f"{head}[{joint}]" if isinstance(joint, str) and joint else path] = path
    return places


def _stamp(message: Any) -> int | None:
    """Stamp of the header [ns]; None where there is none."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    return stamp.sec * 1_000_000_000 + stamp.nanosec if stamp is not None and stamp.sec > 0 else None


def _unit(msgtype: str, field: str) -> str:
    if not msgtype.startswith("geometry_msgs/msg/Wrench"):
        return ""
    return next((unit for word, unit in UNITS.items() if word in field.split(".")), "")


def _signal(
    path: Path, source: str, which: tuple[int, str], parse: Callable[[bytes], Any], place: str, by_header: bool
) -> tuple[Array, Array]:
    """Time since the bag's start [s] and one field; NaN where a message does not have it."""
    stamps: list[int] = []
    values: list[float] = []
    with _opened(path) as reader:
        connection = next(one for one in reader.connections if (one.id, one.topic) == which)
        start = int(reader.start_time if hasattr(reader, "start_time") else reader.metadata.start_time)
        for _, at, raw in reader.messages([connection]):
            message = parse(bytes(raw))
            stamp = _stamp(message) if by_header else None
            stamps.append((at if stamp is None else stamp) - start)
            value = dict(_leaves("", message)).get(place, math.nan)
            values.append(value if isinstance(value, float) else math.nan)
        if len(values) != connection.msgcount:
            raise DataError(
                f"{source}: {connection.topic} has {len(values)} messages where the bag counts "
                f"{connection.msgcount}; copy it again"
            )
    return np.array(stamps, dtype=np.int64) / 1e9, np.array(values, dtype=np.float64)
