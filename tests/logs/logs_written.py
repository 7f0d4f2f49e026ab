"""One step log in every format that needs a library of its own, written by those libraries."""

import numpy as np

from eaid.logs.foreign.answer import reader_of
from eaid.logs.formats import format_of
from eaid.logs.text import read_text

RATE = 200


def tables(path):
    """Tables of a log, read in this process."""
    reader = format_of(path.read_bytes()[:4096]).reader
    if not reader:
        return read_text(path, path.name)
    return reader_of(reader)(path, path.name)


def step(count=600):
    """Time [s], duty [%] and torque [N·m] of one step at 1 s; numbers with all their digits."""
    t = np.arange(count) / RATE
    duty = np.where(t >= 1, 60.0, 0.0)
    torque = np.where(t >= 1, 2.0 * -np.expm1(-(t - 1) / 0.3), 0.0) + 1e-3 * np.sin(1e4 * t)
    return t, duty, torque


def tdms(path, t, duty, torque, group="Log"):
    """Two waveform channels, torque in mN·m."""
    from nptdms import ChannelObject, TdmsWriter

    rate = {"wf_increment": 1 / RATE, "wf_start_offset": float(t[0]), "wf_samples": len(t)}
    with TdmsWriter(str(path)) as file:
        file.write_segment(
            [
                ChannelObject(group, "Duty", duty, {**rate, "unit_string": "%"}),
                ChannelObject(group, "Torque", torque * 1e3, {**rate, "unit_string": "mN·m"}),
            ]
        )
    return path


def parquet(path, t, duty, torque):
    """Three columns, torque in mN·m."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    schema = pa.schema(
        [
            pa.field("time", "double", metadata={"unit": "s"}),
            pa.field("duty", "double", metadata={"unit": "%"}),
            pa.field("torque", "double", metadata={"unit": "mN·m"}),
        ]
    )
    pq.write_table(pa.table([t, duty, torque * 1e3], schema=schema), path)
    return path


def mdf(path, t, duty, torque, version="4.10"):
    """Two channels of one group, torque as counts of 0.1 mN·m."""
    import os

    from asammdf import MDF, Signal

    file = MDF(version=version)
    file.append(
        [
            Signal(duty, t, name="duty", unit="%"),
            Signal(np.round(torque * 1e4).astype("i4"), t, name="torque", unit="Nm", conversion={"a": 1e-4, "b": 0.0}),
        ]
    )
    saved = file.save(str(path.with_suffix(".mf4" if version[0] == "4" else ".mdf")), overwrite=True)
    file.close()
    os.replace(saved, path)
    return path


def _messages(store, t, duty, torque, ros1):
    float64 = store.types["std_msgs/msg/Float64"]
    wrench = store.types["geometry_msgs/msg/WrenchStamped"]
    vector = store.types["geometry_msgs/msg/Vector3"]
    header = store.types["std_msgs/msg/Header"]
    time = store.types["builtin_interfaces/msg/Time"]
    seq = {"seq": 0} if ros1 else {}
    pack = store.serialize_ros1 if ros1 else store.serialize_cdr
    for i, at in enumerate(t.tolist()):
        ns = 1_700_000_000_000_000_000 + round(at * 1e9)
        if i == 0 or duty[i] != duty[i - 1] or i % 10 == 0:  # a command comes when it changes, else seldom
            yield "/clutch/duty", ns, pack(float64(float(duty[i])), "std_msgs/msg/Float64")
        stamp = header(stamp=time(sec=ns // 10**9, nanosec=ns % 10**9), frame_id="clutch", **seq)
        force = store.types["geometry_msgs/msg/Wrench"](
            force=vector(0.0, 0.0, 1.0), torque=vector(0.0, 0.0, float(torque[i]))
        )
        # the receipt is late, by up to 2 ms: the header is right
        yield "/ft", ns + i % 3 * 1_000_000, pack(wrench(stamp, force), "geometry_msgs/msg/WrenchStamped")


def ros1(path, t, duty, torque, compress=None):
    """A version 1 bag: a seldom Float64 command and a WrenchStamped at the full rate."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    path.unlink(missing_ok=True)
    file = Writer(path)
    if compress:
        file.set_compression(Writer.CompressionFormat[compress])
    with file:
        topics = {
            "/clutch/duty": file.add_connection("/clutch/duty", "std_msgs/msg/Float64", typestore=store),
            "/ft": file.add_connection("/ft", "geometry_msgs/msg/WrenchStamped", typestore=store),
        }
        for topic, ns, raw in sorted(_messages(store, t, duty, torque, True), key=lambda m: m[1]):
            file.write(topics[topic], ns, raw)
    return path


def ros2(path, t, duty, torque, storage="mcap", compress=False):
    """The storage file of a version 2 bag (`mcap` or `sqlite3`)."""
    import shutil

    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    folder = path.with_suffix(".folder")
    shutil.rmtree(folder, ignore_errors=True)
    file = Writer(folder, version=9, storage_plugin=StoragePlugin[storage.upper()])
    if compress:
        file.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with file:
        topics = {
            "/clutch/duty": file.add_connection("/clutch/duty", "std_msgs/msg/Float64", typestore=store),
            "/ft": file.add_connection("/ft", "geometry_msgs/msg/WrenchStamped", typestore=store),
        }
        for topic, ns, raw in sorted(_messages(store, t, duty, torque, False), key=lambda m: m[1]):
            file.write(topics[topic], ns, raw)
    (inside,) = [p for p in folder.iterdir() if p.suffix in (".mcap", ".db3")]
    shutil.move(inside, path)
    shutil.rmtree(folder)
    return path
