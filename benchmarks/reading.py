"""Reading 30 logs of 40,000 rows × 4 columns (32 MB), and what data.h5 costs in size and time."""

import tempfile
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter, process_time

import h5py
import numpy as np
import pandas as pd

import eaid
from benchmarks.table import Row, paired_medians
from eaid.files import sha256_of
from eaid.logs.read import read_runs

FILES, ROWS, RUNS = 30, 40_000, 7


def write_logs(folder: Path) -> list[Path]:
    """30 CSV logs with a fourth column that eaid does not need; torque and time to the digits of a rig."""
    rng = np.random.default_rng(0)
    t = np.arange(ROWS) / 1000
    paths = []
    for k in range(FILES):
        duty = np.where(t >= 10, 10.0 * (1 + k // 3), 0.0)
        torque = np.where(t >= 10, 0.04 * duty * -np.expm1(-(t - 10) / 0.5), 0.0) + 0.01 * rng.standard_normal(ROWS)
        path = folder / f"run{k:02d}.csv"
        rows = np.column_stack([t, duty, torque, 10 + 0.1 * rng.standard_normal(ROWS)])
        np.savetxt(
            path, rows, delimiter=",", header="time_s,duty_pct,torque_nm,rotor_rpm", comments="",
            fmt=["%.3f", "%g", "%.6f", "%.6f"],
        )  # fmt: skip
        paths.append(path)
    return paths


def rows() -> Iterator[Row]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        paths = write_logs(folder)
        runs = read_runs(paths)
        plain = [np.loadtxt(path, delimiter=",", skiprows=1, usecols=(0, 1, 2)) for path in paths]
        same = all(
            np.array_equal(np.column_stack([run.time_s, run.input, run.output]), log)
            for run, log in zip(runs, plain, strict=True)
        )
        for other, script, clock in (
            ("pandas.read_csv", pd.read_csv, process_time),
            ("pandas.read_csv, and hashlib's SHA-256", lambda path: (pd.read_csv(path), sha256_of(path)), process_time),
            ("pandas.read_csv, by the clock", pd.read_csv, perf_counter),
        ):
            used, their_s = paired_medians(
                lambda: read_runs(paths), lambda script=script: [script(path) for path in paths], RUNS, clock
            )  # fmt: skip
            yield Row(
                f"read {FILES} × {ROWS:,} × 4 CSV", "read_runs (checked, with SHA-256)", used, other, their_s,
                "no slower", their_s >= used and same, "same bits" if same else "BITS DIFFER",
            )  # fmt: skip

        packed, raw = folder / "data.h5", folder / "raw.h5"
        eaid.read(paths).save(packed)
        with h5py.File(packed) as source, h5py.File(raw, "w") as target:
            copy_raw(source, target)

        def load(path: Path) -> None:
            with h5py.File(path) as file:
                for run in file["runs"].values():
                    for column in run.values():
                        column[...]

        share = packed.stat().st_size / raw.stat().st_size
        for what, call, small in (
            ("read data.h5 with eaid, rows checked, with SHA-256", lambda path: read_runs([path]), share <= 0.5),
            ("load every column of data.h5 with bare h5py", load, True),
        ):
            ours, other = paired_medians(lambda call=call: call(packed), lambda call=call: call(raw), RUNS)
            yield Row(
                what, "data.h5 as eaid writes it", ours, "the same uncompressed", other,
                "≤ 1.3 × the time, ≤ half the size", ours <= 1.3 * other and small,
                f"{100 * share:.0f} % of the raw size",
            )  # fmt: skip


def copy_raw(source: h5py.Group, target: h5py.Group) -> None:
    for key, value in source.attrs.items():
        target.attrs[key] = value
    for name, item in source.items():
        if isinstance(item, h5py.Dataset):
            target.create_dataset(name, data=item[...])
        else:
            copy_raw(item, target.create_group(name))
