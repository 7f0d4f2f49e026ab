"""When a ROS message counts: at the stamp of its header, where that is within a minute of the bag's own time."""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from logs_written import tables

COUNT, BAG_NS = 5, 1_700_000_000_000_000_000


def bag(path: Path, stamp_ns: Callable[[int], int]) -> Path:
    """A torque every 10 ms of the bag's time; `stamp_ns`: the stamp in the header of each message."""
    pytest.importorskip("rosbags")
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    names = ("geometry_msgs/msg/WrenchStamped", "geometry_msgs/msg/Wrench", "geometry_msgs/msg/Vector3",
             "std_msgs/msg/Header", "builtin_interfaces/msg/Time")  # fmt: skip
    stamped, wrench, vector, header, time = (store.types[name] for name in names)
    with Writer(path) as file:
        topic = file.add_connection("/ft", names[0], typestore=store)
        for i in range(COUNT):
            ns = stamp_ns(i)
            head = header(seq=i, stamp=time(sec=ns // 10**9, nanosec=ns % 10**9), frame_id="")
            message = stamped(head, wrench(force=vector(0.0, 0.0, 1.0), torque=vector(0.0, 0.0, float(i))))
            file.write(topic, BAG_NS + i * 10_000_000, store.serialize_ros1(message, names[0]))
    return path


@pytest.mark.parametrize(
    ("offset_s", "first_s", "apart_s"),
    [
        (0, 0.0, 0.02), (-59, -59.0, 0.02), (59, 59.0, 0.02),  # by the headers, 20 ms apart
        (60, 0.0, 0.01), (-61, 0.0, 0.01), (-1_699_999_990, 0.0, 0.01),  # another clock: by the bag
    ],
)  # fmt: skip
def test_a_header_counts_within_a_minute_of_the_bag(
    offset_s: int, first_s: float, apart_s: float, tmp_path: Path
) -> None:
    (sheet,) = tables(bag(tmp_path / "a.bag", lambda i: BAG_NS + offset_s * 10**9 + i * 20_000_000))
    assert sheet.columns == ("time", *(f"ft/wrench.{kind}.{axis}" for kind in ("force", "torque") for axis in "xyz"))
    assert sheet.units == ("s", *["N"] * 3, *["N·m"] * 3)
    torque, time = sheet.load([6, 0]).values
    np.testing.assert_allclose(time, first_s + apart_s * np.arange(COUNT), atol=1e-9)
    assert torque.tolist() == list(range(COUNT))


def test_a_message_without_a_stamp_counts_at_the_time_of_the_bag(tmp_path: Path) -> None:
    """Of a topic whose first message has one."""
    (sheet,) = tables(bag(tmp_path / "a.bag", lambda i: 0 if i == 2 else BAG_NS + i * 20_000_000))
    np.testing.assert_allclose(sheet.load([6, 0]).values[1], [0, 0.02, 0.02, 0.06, 0.08], atol=1e-9)
