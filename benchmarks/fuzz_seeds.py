"""Valid files that the fuzzing of readers starts from: several of each format, small, each of another shape."""

import gzip
import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests" / "logs"))
import logs_written as made  # noqa: E402  the formats that the tests write too

HEADER = "time_s,duty_pct,torque_nm\n"
DATASET_ROWS = 60


def seeds(name: str, folder: Path) -> Iterator[Path]:
    """Small valid files for a reader, written into a folder."""
    t, duty, torque = (values[170:230] for values in made.step(300))
    made_by = globals()[f"_{name}"](folder, t, duty, torque)
    for i, data in enumerate(made_by):
        path = folder / f"seed-{name}-{i}"
        if isinstance(data, Path):
            data.replace(path)
        else:
            path.write_bytes(data if isinstance(data, bytes) else data.encode())
        yield path


def _text(folder: Path, t: Any, duty: Any, torque: Any) -> Iterator[str | bytes]:
    del folder
    rows = "".join(f"{a:.4f},{b:g},{c:.6f}\n" for a, b, c in zip(t, duty, torque, strict=True))
    text = HEADER + rows
    yield text
    yield "# made by hand, rate: 200 Hz\n# level: 60\n" + text
    yield text.replace(",", ";").replace(".", ",").encode("latin-1")
    yield text.replace(",", "\t").replace("time_s", "Zeit [ms]").encode("utf-16")
    yield rows.replace(",", "  ")
    lines = "".join(f'"{i}","2024-05-01 12:00:{a:09.6f}","{b:g}","{1e3 * c:,.3f}"\n'
                    for i, (a, b, c) in enumerate(zip(t, duty, torque, strict=True)))  # fmt: skip
    yield 'index,"Time stamp","Duty","Load cell"\n,,"%","g"\n' + lines
    yield "Operator;Smith\nSampling rate;200 Hz\n\nVoltage;Torque\nV;mNm\n" + "".join(
        f"{b:g};{1e3 * c:.5e}\r\n" for b, c in zip(duty, torque, strict=True)
    )


def _gzip(folder: Path, *step: Any) -> Iterator[bytes]:
    for text in _text(folder, *step):
        yield gzip.compress(text if isinstance(text, bytes) else text.encode(), mtime=0)
    yield gzip.compress(HEADER.encode(), mtime=0) + gzip.compress(b"0.1,0,0\n" * 40, mtime=0)


def _lvm(folder: Path, *step: Any) -> Iterator[str | bytes]:
    del folder, step
    top = (
        "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t{0}\nMulti_Headings\t{1}\n"
        "X_Columns\t{2}\nTime_Pref\tRelative\nDate\t2024/05/01\nTime\t12:00:00,5\n***End_of_Header***\n\t\n"
    )
    head = (
        "Channels\t2\t\nSamples\t20\t20\nDate\t2024/05/01\t2024/05/01\nTime\t12:00:{0}\t12:00:{0}\n"
        "Y_Unit_Label\tVolts\tNm\nX_Dimension\tTime\tTime\nX0\t0\t0\nDelta_X\t0{1}01\t0{1}01\n***End_of_Header***\t\t\n"
    )
    one = "".join(f"{i / 100:.6f}\t{i % 5}\t{i / 7:.6f}\t\n" for i in range(20))
    multi = "".join(f"{i / 100:.6f}\t{i % 5}\t{i / 100:.6f}\t{i / 7:.6f}\n" for i in range(20))
    none = "".join(f"\t{i % 5}\t{i / 7:.6f}\tnote {i}\n" for i in range(20))
    body = "X_Value\tDuty\tTorque\tComment\n"
    yield top.format(".", "No", "One") + head.format("01.5", ".") + body + one
    yield top.format(".", "Yes", "One") + (head.format("01.5", ".") + body + one + "\t\n") * 3
    yield top.format(".", "No", "Multi") + head.format("01", ".") + body.replace("Torque", "X_Value\tTorque") + multi
    comma = (top + head.replace("0{1}", "0,") + body).format(",", "No", "No") + none.replace(".", ",")
    yield comma.encode("cp1252")
    special = "***Start_Special***\nanything at all\n***End_Special***\n"
    yield (
        top.format(".", "No", "No").replace("Tab", "Comma").replace("\t", ",")
        + special
        + (head.format("02", ".") + body + none).replace("\t", ",")
    )
    for path in sorted((ROOT / "../shared/realdata/formats").glob("*.lvm")):
        yield path.read_bytes()


def _mat(folder: Path, t: Any, duty: Any, torque: Any) -> Iterator[bytes]:
    from scipy.io import savemat
    from scipy.sparse import csc_matrix

    signals = np.zeros((1, 2), dtype=[("values", object), ("label", object), ("dimensions", object)])
    signals[0, 0] = (duty.reshape(-1, 1), "duty", 1.0)
    signals[0, 1] = (torque.reshape(-1, 1), "torque", 1.0)
    cell = np.empty((1, 2), dtype=object)
    cell[0, 0], cell[0, 1] = "torque", torque[:5]
    shapes: list[dict[str, Any]] = [
        {"time": t, "torque": torque, "duty": duty.astype("i2")},
        {"log": np.stack([t, duty, torque])},
        {"log": np.stack([t, duty, torque], axis=1).astype("f4"), "K": np.eye(3)},
        {"s": {"time": t, "y": duty, "deep": {"time": t, "torque": torque}}, "note": "by hand"},
        {"out": {"time": t.reshape(-1, 1), "signals": signals, "blockName": "scope"}},
        {"c": cell, "z": torque[:20] + 1j, "on": duty > 0, "e": np.zeros((0, 3)), "sp": csc_matrix(np.eye(20)), "t": t},
        {"many": np.ones((20, 2, 2)), "u8": duty.astype("u1"), "u64": duty.astype("u8"), "text": ["ab", "cd"]},
    ]
    path = folder / "making.mat"
    for k, columns in enumerate(shapes):
        for packed in (False, True):
            savemat(path, columns, do_compression=packed, long_field_names=True)
            yield path.read_bytes()
        if k < 3:
            savemat(path, columns, format="4")
            yield path.read_bytes()


def _hdf5(folder: Path, t: Any, duty: Any, torque: Any) -> Iterator[bytes]:
    import h5py

    path = folder / "making.h5"
    for latest in (False, True):
        with h5py.File(path, "w", libver="latest" if latest else None) as file:
            for k, extra in enumerate(({}, {"compression": "gzip", "shuffle": True}, {"compression": "lzf"},
                                       {"chunks": (7,), "fletcher32": True})):  # fmt: skip
                group = file.create_group(f"run{k}/inner")
                for name, values in {"time": t, "duty": duty.astype(">i2"), "torque": torque.astype("f4")}.items():
                    group.create_dataset(name, data=values, **extra).attrs["unit"] = "s"
            file["matrix"] = np.stack([t, duty, torque])
            file["matrix"].attrs["columns"] = ["time", "duty", "torque"]
            file["again"] = h5py.SoftLink("/matrix")
        yield path.read_bytes()
        with h5py.File(path, "w", libver="latest" if latest else None) as file:
            table = np.zeros(40, dtype=[("time", "f8"), ("torque", "f4"), ("on", "?"), ("name", "S5")])
            table["time"], table["torque"] = t[:40], torque[:40]
            file["table"] = table
            file["words"] = np.array(["one", "two" * 9, ""], dtype=h5py.string_dtype())
            file["ragged"] = np.array([np.arange(3), np.arange(5)], dtype=object).astype(h5py.vlen_dtype("i4"))
            file["kind"] = np.array([0, 1], dtype=h5py.enum_dtype({"rise": 0, "fall": 1}))
            file["grows"] = t
            file.create_dataset("open", data=torque, maxshape=(None,), chunks=(16,), compression="gzip")
            file.attrs.update(text="x" * 40, words=["a", "b"], number=np.float32(3), compound=table[:2])
            file["table"].attrs["ref"] = file.ref
        yield path.read_bytes()
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in {"time": t, "torque": torque, "note": np.array([104, 105], "u2")}.items():
            file[name] = values.reshape(1, -1)
            file[name].attrs["MATLAB_class"] = np.bytes_("char" if name == "note" else "double")
        inside = file.create_group("s")
        inside.attrs["MATLAB_class"] = np.bytes_("struct")
        inside["time"], inside["y"] = t, duty
    yield b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + path.read_bytes()[128:]


def dataset_runs() -> Sequence[Any]:
    """The runs of the first seed of `dataset`, which a reader gives back bit for bit or refuses."""
    from eaid.findings import finding
    from eaid.logs.run import Run

    t, duty, torque = (values[170 : 170 + DATASET_ROWS] for values in made.step(300))
    return [
        Run(
            name=f"level-{60 + k}", time_s=t, input=duty, output=torque * (k + 1), input_unit="%", output_unit="N·m",
            source="a.csv", sha256="0" * 64, level=60.0 + k, repeat=1, step_s=1.0, baseline=0.01,
            findings=(finding("rows-dropped", "a", dropped=1, count=9),),
        )
        for k in range(3)
    ]  # fmt: skip


def _dataset(folder: Path, t: Any, duty: Any, torque: Any) -> Iterator[bytes]:
    import h5py

    from eaid.apparatus import Apparatus
    from eaid.logs.dataset import write_dataset

    path = folder / "making.h5"
    write_dataset(path, dataset_runs(), kind="clutch", apparatus=Apparatus(), force=True)
    yield path.read_bytes()
    for bare in (False, True):
        with h5py.File(path, "w") as file:
            group = file.create_group("runs/a")
            group.update({"time_s": t, "input": duty, "torque_nm": torque})
            file.attrs["schema"] = "eaid/data/1"
            if not bare:
                file.attrs.update(kind="friction-force", input_unit="N", apparatus=json.dumps({"surfaces": 2}))
                group.attrs.update(
                    level=60.0, repeat=1, step_s=1.0, baseline_nm=0.0, source="a", sha256="0", findings="[]"
                )
                group.create_dataset("reference_nm", data=torque, chunks=(16,), fletcher32=True)
        yield path.read_bytes()


def _tdms(folder: Path, t: Any, duty: Any, torque: Any) -> Iterator[bytes]:
    from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

    path = folder / "making.tdms"
    yield made.tdms(path, t, duty, torque).read_bytes()
    rate = {
        "wf_increment": 0.005,
        "wf_start_offset": 0.5,
        "wf_start_time": np.datetime64("2024-05-01T12:00:00.5", "us"),
    }
    counts = (torque * 1e4).astype("i2")
    scales = {
        "NI_Scaling_Status": "unscaled", "NI_Number_Of_Scales": 2, "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": 1e-4, "NI_Scale[0]_Linear_Y_Intercept": 0.1,
        "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF, "NI_Scale[1]_Scale_Type": "Polynomial",
        "NI_Scale[1]_Polynomial_Coefficients_Size": 2, "NI_Scale[1]_Polynomial_Coefficients[0]": 0.5,
        "NI_Scale[1]_Polynomial_Coefficients[1]": 2.0, "NI_Scale[1]_Polynomial_Input_Source": 0,
    }  # fmt: skip
    stamps = np.datetime64("2024-05-01T12:00:00", "us") + np.arange(len(t)) * np.timedelta64(5, "ms")
    for version in (4712, 4713):
        with TdmsWriter(str(path), version=version) as file:
            for k in range(3):  # the second segment is as the first, the third has a channel more
                file.write_segment(
                    [
                        RootObject({"level": 60.0, "synthetic": "yes", "n": 3, "on": True}),
                        GroupObject("Log", {"note": "by hand"}),
                        ChannelObject("Log", "Duty", duty, {**rate, "unit_string": "%"}),
                        ChannelObject("Log", "Torque", counts, {**rate, **scales, "unit_string": "Nm"}),
                        *([ChannelObject("Log", "More", torque.astype("f4"), rate)] if k == 2 else []),
                    ]
                )
        yield path.read_bytes()
    with TdmsWriter(str(path)) as file:
        file.write_segment(
            [
                ChannelObject("Vectors", "time", stamps), ChannelObject("Vectors", "torque", torque),
                ChannelObject("Vectors", "on", duty > 0), ChannelObject("Vectors", "note", ["a", "bc"] * (len(t) // 2)),
                ChannelObject("Vectors", "u1", duty.astype("u1")), ChannelObject("Vectors", "u8", duty.astype("u8")),
            ]
        )  # fmt: skip
    yield path.read_bytes()
    for real in sorted((ROOT / "../shared/realdata/formats").glob("*.tdms")):
        yield real.read_bytes()


def _parquet(folder: Path, t: Any, duty: Any, torque: Any) -> Iterator[bytes]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = folder / "making.parquet"
    yield made.parquet(path, t, duty, torque).read_bytes()
    gaps = [None if i % 9 == 0 else float(v) for i, v in enumerate(torque)]
    table = pa.table({
        "stamp": pa.array((1_700_000_000_000_000 + t * 1e6).astype("i8"), pa.timestamp("us")),
        "duty": pa.array(duty.astype("i4")), "torque": pa.array(gaps), "on": pa.array(duty > 0),
        "fixed": pa.array([round(float(v), 3) for v in torque]).cast(pa.decimal128(10, 3), safe=False),
        "gone": pa.array((t * 1e9).astype("i8"), pa.duration("ns")),
        "word": pa.array(["ab", None, "c"] * (len(t) // 3)), "list": pa.array([[1, 2]] * len(t)),
    })  # fmt: skip
    numbers = table.select(["duty", "torque"])
    ways: list[tuple[Any, dict[str, Any]]] = [
        (table, {"compression": "none"}),
        (table, {"compression": "snappy", "row_group_size": 25, "write_page_index": True, "write_page_checksum": True}),
        (table, {"compression": "zstd", "data_page_version": "2.0", "data_page_size": 64, "store_schema": False}),
        (numbers, {"compression": "gzip", "use_dictionary": False, "column_encoding": {
            "duty": "DELTA_BINARY_PACKED", "torque": "BYTE_STREAM_SPLIT"}}),
        (numbers, {"compression": "lz4", "use_dictionary": ["duty"], "version": "1.0"}),
        (numbers, {"compression": "brotli", "use_dictionary": False, "write_statistics": False}),
    ]  # fmt: skip
    for content, how in ways:
        pq.write_table(content, path, **how)
        yield path.read_bytes()


def _mdf(folder: Path, t: Any, duty: Any, torque: Any) -> Iterator[bytes]:
    from asammdf import MDF, Signal

    path = folder / "making"
    yield made.mdf(path, t, duty, torque).read_bytes()
    yield made.mdf(path, t, duty, torque, version="3.30").read_bytes()
    counts = np.round(torque * 1e4).astype("i2")
    words = {f"val_{i}": i for i in range(2)} | {f"text_{i}": f"gear {i}".encode() for i in range(2)}
    table = {f"raw_{i}": 1e3 * i for i in range(3)} | {f"phys_{i}": 2.0 * i for i in range(3)} | {"interpolation": 1}
    ways = (("4.10", 0), ("4.10", 1), ("4.20", 2), ("4.00", 0), ("3.30", 0), ("2.14", 0))
    for version, packed in ways:
        file = MDF(version=version)
        file.append([
            Signal(duty, t, name="duty", unit="%", comment="as commanded"),
            Signal(counts, t, name="torque", unit="Nm", conversion={"a": 1e-4, "b": 0.0}),
            Signal(counts, t, name="rational", conversion={f"P{i}": float(i in (2, 6)) for i in range(1, 7)}),
            Signal(counts, t, name="table", conversion=table),
        ])  # fmt: skip
        file.append([
            Signal((duty > 0).astype("u1"), t, name="gear", conversion=words),
            Signal(torque.astype(">f4"), t, name="big", unit="Nm"),
        ])  # fmt: skip
        if version >= "4":
            file.append([Signal(torque, t, name="gaps", invalidation_bits=(duty > 0).astype(bool))])
            file.append([Signal(np.array([b"ab", b"cd"] * (len(t) // 2)), t, name="word", encoding="latin-1")])
        target = path.with_suffix(".mf4" if version >= "4" else ".mdf")
        saved = file.save(str(target), overwrite=True, compression=packed)
        file.close()
        yield Path(saved).read_bytes()


def _bag(folder: Path, storage: str, packed: str | None, t: Any, duty: Any, torque: Any) -> bytes:
    """A bag of joint states, arrays and texts besides the topics of the tests."""
    import shutil

    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if storage == "ros1" else Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg("uint8 LIMIT=3\nstring word\nfloat32[3] three\nLine[] lines\n" + "=" * 80
                                      + "\nMSG: lab/Line\nint16 count\nbool on\ntime at\n".replace(
                                          "time at", "time at" if storage == "ros1" else "builtin_interfaces/Time at"),
                                      "lab/msg/Own"))  # fmt: skip
    path = folder / f"making-{storage}"
    shutil.rmtree(path, ignore_errors=True)
    path.unlink(missing_ok=True) if path.is_file() else None
    if storage == "ros1":
        from rosbags.rosbag1 import Writer as Writer1

        file: Any = Writer1(path)
        if packed:
            file.set_compression(Writer1.CompressionFormat[packed])
    else:
        from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

        file = Writer(path, version=9, storage_plugin=StoragePlugin[storage.upper()])
        if packed:
            file.set_compression(CompressionMode[packed], CompressionFormat.ZSTD)
    ros1 = storage == "ros1"
    pack = store.serialize_ros1 if ros1 else store.serialize_cdr
    kinds = {"/joints": "sensor_msgs/msg/JointState", "/own": "lab/msg/Own", "/many": "std_msgs/msg/Float64MultiArray",
             "/duty": "std_msgs/msg/Float64", "/word": "std_msgs/msg/String"}  # fmt: skip
    kind = {topic: store.types[name] for topic, name in kinds.items()}
    time = store.types["builtin_interfaces/msg/Time"]
    layout = store.types["std_msgs/msg/MultiArrayLayout"]
    seq = {"seq": 0} if ros1 else {}
    with file:
        topics = {topic: file.add_connection(topic, name, typestore=store) for topic, name in kinds.items()}
        for i, at in enumerate(t.tolist()):
            ns = 1_700_000_000_000_000_000 + round(at * 1e9)
            stamp = time(sec=ns // 10**9, nanosec=ns % 10**9)
            header = store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="a", **seq)
            two, none = np.array([duty[i], torque[i]]), np.zeros(0)
            lines = [store.types["lab/msg/Line"](count=k, on=True, at=stamp) for k in range(2)]
            said = {
                "/joints": kind["/joints"](header, ["hip", "knee"], two, none, two),
                "/own": kind["/own"]("x" * (i % 3), np.arange(3, dtype="f4"), lines),
                "/many": kind["/many"](layout([], 0), two), "/duty": kind["/duty"](float(duty[i])),
                "/word": kind["/word"]("go"),
            }  # fmt: skip
            for topic, message in said.items():
                if i % 4 == 0 or topic == "/joints":
                    file.write(topics[topic], ns, pack(message, kinds[topic]))
    if ros1:
        return path.read_bytes()
    (inside,) = [one for one in path.iterdir() if one.suffix in (".mcap", ".db3")]
    return inside.read_bytes()


def _ros1(folder: Path, *step: Any) -> Iterator[bytes]:
    for packed in (None, "BZ2", "LZ4"):
        yield made.ros1(folder / "making", *step, compress=packed).read_bytes()
        yield _bag(folder, "ros1", packed, *step)


def _mcap(folder: Path, *step: Any) -> Iterator[bytes]:
    for packed in (False, True):
        yield made.ros2(folder / "making", *step, compress=packed).read_bytes()
        yield _bag(folder, "mcap", "STORAGE" if packed else None, *step)


def _sqlite(folder: Path, *step: Any) -> Iterator[bytes]:
    yield made.ros2(folder / "making", *step, storage="sqlite3").read_bytes()
    yield _bag(folder, "sqlite3", None, *step)
    yield _bag(folder, "sqlite3", "MESSAGE", *step)


def _manifest(folder: Path, *step: Any) -> Iterator[str]:
    del folder, step
    logs = '[[log]]\nfile = "a.csv"\nsha256 = "00"\nrepeat = 1\nlevel = 60.0\nstep_s = 1.0\nuntil_s = 2.0\n'
    yield 'schema = "eaid/manifest/1"\n\n[options]\nkind = "clutch"\n\n' + logs
    yield (
        'schema = "eaid/manifest/1"\n[options]\ncolumns = "time=time_s,output=3"\nunits = "time=s"\n'
        'name_pattern = "{level}_"\nstep_at = 0.1\nuntil = 2\nrepair = true\nlevels = "10-90"\nbaseline = "auto"\n'
        'variable = "log"\nrate = 200.0\nrest = -5.0\napparatus = "surfaces=2"\njoin = true\n\n' + logs + logs
    )
    yield 'schema = "eaid/manifest/1"\nlog = [{ file = "a.csv", repeat = 2 }, { file = "a.csv" }]\noptions = {}\n'


def _results(folder: Path, t: Any, duty: Any, torque: Any) -> Iterator[bytes]:
    from eaid.replay.files import write_replay
    from eaid.results.metrics import Metrics
    from eaid.results.replay import Head, Record, Replay

    for name in ("gains.json", "friction-force.json", "fit.json"):
        content = json.loads((ROOT / "reports" / "demo" / name).read_text(encoding="utf-8"))
        yield json.dumps(_shorter(content)).encode()
    columns = {"time_s": t, "reference_nm": torque, "torque_nm": torque, "duty_pct": duty}
    records = {name: Record(columns, Metrics(rms_error_nm=0.1), {"band/low": torque[:9]}) for name in ("rc", "pi")}
    path = folder / "making.h5"
    write_replay(path, Replay(Head("sine"), records), force=True)
    yield path.read_bytes()
    import h5py

    with h5py.File(path, "r+") as file:
        del file.attrs["digest"]
    yield path.read_bytes()
    yield from _dataset(folder, t, duty, torque)


def _shorter(value: Any) -> Any:
    """A result with at most three items a list."""
    if isinstance(value, dict):
        return {key: _shorter(item) for key, item in value.items()}
    return [_shorter(item) for item in value[:4]] if isinstance(value, list) else value
