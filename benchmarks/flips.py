"""`python -m benchmarks.flips [COUNT]`: one bit changed in a log of each format: refused, without effect, or taken?

Formats without a checksum cannot tell a changed number from a right one; the share of such changes is what a copy of
the log by a means with checksums of its own (and the fingerprint in `dataset.toml`) protects against.
"""

import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from eaid.logs.options import ReadOptions

from benchmarks.fuzz_readers import FORMS, reader_of
from benchmarks.fuzz_seeds import made
from eaid.logs.read import read_what_can_be

KINDS = ("text", "gzip", "lvm", "mat", "mat packed", "hdf5", "hdf5 packed", "dataset", "tdms", "parquet",
         "parquet with checksums", "mdf", "mdf packed", "ros1", "ros1 bz2", "mcap", "mcap zstd", "sqlite")  # fmt: skip


def write(kind: str, path: Path) -> None:
    """One step of 3 s at 200 Hz in a format, by the library that is usual for it."""
    t, duty, torque = made.step()
    name, _, way = kind.partition(" ")
    if name in ("text", "gzip", "lvm", "hdf5", "dataset", "mat"):
        _plain(name, way, path, t, duty, torque)
    elif kind == "parquet with checksums":
        import pyarrow as pa
        import pyarrow.parquet as pq

        pq.write_table(pa.table({"time_s": t, "duty_pct": duty, "torque_nm": torque}), path, write_page_checksum=True)
    elif kind == "mdf packed":
        from asammdf import MDF

        made.mdf(path, t, duty, torque)
        with MDF(path.open("rb")) as file:
            file.save(str(path.with_suffix(".mf4")), overwrite=True, compression=1)
        path.with_suffix(".mf4").replace(path)
    elif name in ("mcap", "sqlite"):
        made.ros2(path, t, duty, torque, storage="sqlite3" if name == "sqlite" else "mcap", compress=bool(way))
    elif name == "ros1":
        made.ros1(path, t, duty, torque, compress=way.upper() or None)
    else:
        getattr(made, name)(path, t, duty, torque)


def _plain(name: str, way: str, path: Path, t: Any, duty: Any, torque: Any) -> None:
    import gzip

    from benchmarks.fuzz_seeds import dataset_runs

    rows = "".join(f"{a:.4f},{b:g},{c:.6f}\n" for a, b, c in zip(t, duty, torque, strict=True))
    if name == "lvm":
        top = "LabVIEW Measurement\nSeparator\tTab\nDecimal_Separator\t.\nX_Columns\tOne\n***End_of_Header***\n"
        head = "Channels\t2\nX_Dimension\tTime\n***End_of_Header***\nX_Value\tDuty\tTorque\tComment\n"
        path.write_text(top + head + rows.replace(",", "\t"))
    elif name == "mat":
        from scipy.io import savemat

        columns = {"time": t, "duty": duty, "torque": torque}
        savemat(path, columns, appendmat=False, do_compression=bool(way))
    elif name == "hdf5":
        import h5py

        with h5py.File(path, "w") as file:
            for key, values in {"time": t, "duty": duty, "torque": torque}.items():
                file.create_dataset(key, data=values, **({"compression": "gzip"} if way else {}))
    elif name == "dataset":
        from eaid.apparatus import Apparatus
        from eaid.logs.dataset import write_dataset

        write_dataset(path, dataset_runs(), kind="clutch", apparatus=Apparatus(), force=True)
    else:
        text = ("time_s,duty_pct,torque_nm\n" + rows).encode()
        path.write_bytes(gzip.compress(text, mtime=0) if name == "gzip" else text)


def read(kind: str, path: Path) -> Any:
    """All numbers in a file, as bytes; None where it is refused."""
    try:
        if kind == "dataset":
            runs, faults = read_what_can_be([path], ReadOptions())
            numbers = [(run.time_s.tobytes(), run.input.tobytes(), run.output.tobytes(), run.level) for run in runs]
            return None if faults else numbers
        found = []
        for table in reader_of(FORMS[kind.partition(" ")[0]])(path, "log"):
            cells = table.load(range(len(table.columns)))
            if cells.bad:
                return None
            found.append((table.columns, table.units, [np.asarray(values).tobytes() for values in cells.values]))
        return found
    except Exception:  # what a library raises is a refusal
        return None


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    path = Path(tempfile.mkdtemp()) / "log"
    for kind in KINDS:
        path.unlink(missing_ok=True)
        write(kind, path)
        data, whole = path.read_bytes(), read(kind, path)
        if whole is None:
            raise SystemExit(f"{kind}: the unchanged file is refused")
        told = {"refused": 0, "same": 0, "other": 0}
        tries = min(count, 30) if kind.startswith("mdf") else count  # a process for every try
        for k in range(tries):
            at = (2 * k + 1) * len(data) // (2 * tries)
            path.write_bytes(data[:at] + bytes([data[at] ^ (1 << k % 8)]) + data[at + 1 :])
            found = read(kind, path)
            told["refused" if found is None else "same" if found == whole else "other"] += 1
        print(
            f"{kind}: {len(data):,} bytes, " + ", ".join(f"{n / tries:.0%} {word}" for word, n in told.items()),
            flush=True,
        )


if __name__ == "__main__":
    main()
