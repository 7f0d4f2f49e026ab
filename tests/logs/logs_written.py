"""One step as text, as a DataFrame, and in every format that takes a library of its own, written by those libraries."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

RATE = 200
T = np.arange(300) / 100.0
U = np.where(T >= 1.0, 60.0, 0.0)
Y = np.round(np.where(T >= 1.0, -1.5 * np.expm1(-(T - 1.0) / 0.3), 0.0) + 0.01 * np.sin(50 * T), 6)


def frame(names: str, *values: Any, units: dict[str, str] | None = None) -> pd.DataFrame:
    """Columns under the names that stand between bars."""
    made = pd.DataFrame(dict(zip(names.split("|"), values, strict=True)))
    made.attrs["units"] = units or {}
    return made


def text(header: str | None, *columns: Any, between: str = ",", end: str = "\n") -> str:
    """A table whose cells are texts or numbers; the names of its header stand apart by commas."""
    rows = [between.join(x if isinstance(x, str) else f"{x:.15g}" for x in row) for row in zip(*columns, strict=True)]
    return end.join([*([header.replace(",", between)] if header else []), *rows]) + end


def later(write: Callable[..., Any]) -> Callable[..., Callable[[Path], Any]]:
    """A function that writes a file, called now with all but its path."""
    return lambda *what, **how: lambda path: write(path, *what, **how)


@later
def changed(path: Path, write: Callable[[Path], Any], change: Callable[[bytearray], Any]) -> None:
    """A file of which some bytes are changed."""
    write(path)
    data = bytearray(path.read_bytes())
    change(data)
    path.write_bytes(data)


def step(count: int = 600) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time [s], duty [%] and torque [N·m] of one step at 1 s; numbers with all their digits."""
    t = np.arange(count) / RATE
    duty = np.where(t >= 1, 60.0, 0.0)
    torque = np.where(t >= 1, 2.0 * -np.expm1(-(t - 1) / 0.3), 0.0) + 1e-3 * np.sin(1e4 * t)
    return t, duty, torque


def tdms_of(path: Path, *channels: tuple[str, str, Any, dict[str, Any]]) -> Path:
    """Channels by group, name, values and properties."""
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(str(path)) as file:
        file.write_segment([ChannelObject(*channel) for channel in channels])
    return path


def tdms(path: Path, t: Any, duty: Any, torque: Any) -> Path:
    """Two waveform channels, torque in mN·m."""
    rate = {"wf_increment": round(float(t[1] - t[0]), 9), "wf_start_offset": float(t[0]), "wf_samples": len(t)}
    duty_, torque_ = (rate | {"unit_string": unit} for unit in ("%", "mN·m"))
    return tdms_of(path, ("Log", "Duty", duty, duty_), ("Log", "Torque", torque * 1e3, torque_))


def mdf_of(path: Path, *groups: list[dict[str, Any]], version: str = "4.10") -> Path:
    """Groups of signals, each the arguments of asammdf's `Signal`."""
    from asammdf import MDF, Signal

    file = MDF(version=version)
    for signals in groups:
        file.append([Signal(**signal) for signal in signals])
    saved = file.save(str(path.with_suffix(".mf4" if version[0] == "4" else ".mdf")), overwrite=True)
    file.close()
    os.replace(saved, path)
    return path


def mdf(path: Path, t: Any, duty: Any, torque: Any, version: str = "4.10") -> Path:
    """Two channels of one group, torque as counts of 0.1 mN·m."""
    counts = {"samples": np.round(torque * 1e4).astype("i4"), "conversion": {"a": 1e-4, "b": 0.0}, "unit": "Nm"}
    first = {"samples": duty, "timestamps": t, "name": "duty", "unit": "%"}
    return mdf_of(path, [first, counts | {"timestamps": t, "name": "torque"}], version=version)


def _write_messages(file: Any, store: Any, t: Any, duty: Any, torque: Any, ros1: bool, ahead_s: int = 0) -> None:
    """A seldom Float64 command, and a WrenchStamped at the full rate whose receipt is late by up to 2 ms; the clock of
    its header is ahead."""
    names = {"/clutch/duty": "std_msgs/msg/Float64", "/ft": "geometry_msgs/msg/WrenchStamped"}
    number, stamped, wrench, vector, header, time = (
        store.types[name]
        for name in (*names.values(), "geometry_msgs/msg/Wrench", "geometry_msgs/msg/Vector3", "std_msgs/msg/Header",
                     "builtin_interfaces/msg/Time")
    )  # fmt: skip
    pack, seq = (store.serialize_ros1, {"seq": 0}) if ros1 else (store.serialize_cdr, {})
    messages = []
    for i, at in enumerate(t.tolist()):
        ns = 1_700_000_000_000_000_000 + round(at * 1e9)
        if i == 0 or duty[i] != duty[i - 1] or i % 10 == 0:  # a command comes when it changes, else seldom
            messages.append((ns, "/clutch/duty", number(float(duty[i]))))
        head = header(stamp=time(sec=ns // 10**9 + ahead_s, nanosec=ns % 10**9), frame_id="clutch", **seq)
        both = wrench(force=vector(0.0, 0.0, 1.0), torque=vector(0.0, 0.0, float(torque[i])))
        messages.append((ns + i % 3 * 1_000_000, "/ft", stamped(head, both)))
    topics = {topic: file.add_connection(topic, name, typestore=store) for topic, name in names.items()}
    for ns, topic, message in sorted(messages, key=lambda one: one[0]):
        file.write(topics[topic], ns, pack(message, names[topic]))


def ros1(path: Path, t: Any, duty: Any, torque: Any, compress: str | None = None, ahead_s: int = 0) -> Path:
    """A version 1 bag."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    path.unlink(missing_ok=True)
    file = Writer(path)
    if compress:
        file.set_compression(Writer.CompressionFormat[compress])
    with file:
        _write_messages(file, get_typestore(Stores.ROS1_NOETIC), t, duty, torque, True, ahead_s)
    return path


def ros2(path: Path, t: Any, duty: Any, torque: Any, storage: str = "mcap", compress: bool = False) -> Path:
    """The storage file of a version 2 bag (`mcap` or `sqlite3`)."""
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    folder = path.with_suffix(".folder")
    shutil.rmtree(folder, ignore_errors=True)
    file = Writer(folder, version=9, storage_plugin=StoragePlugin[storage.upper()])
    if compress:
        file.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with file:
        _write_messages(file, get_typestore(Stores.ROS2_HUMBLE), t, duty, torque, False)
    (inside,) = [p for p in folder.iterdir() if p.suffix in (".mcap", ".db3")]
    shutil.move(inside, path)
    shutil.rmtree(folder)
    return path
