"""Reading 30 logs of 40,000 rows × 4 columns (32 MB), and what data.h5 costs in size and time."""

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from time import process_time

import h5py
import numpy as np
import pandas as pd

from benchmarks.table import Row, paired_medians
from eaid.files import sha256_of
from eaid.logs.read import read_runs
from eaid.steps.cut_runs import StepOptions, cut_runs

FILES, ROWS = 30, 40_000


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
        plain = [np.loadtxt(path, delimiter=",", skiprows=1) for path in paths]
        same = all(
            np.array_equal(run.time_s, log[:, 0])
            and np.array_equal(run.input, log[:, 1])
            and np.array_equal(run.output, log[:, 2])
            for run, log in zip(runs, plain, strict=True)
        )
        others = {
            "pandas.read_csv": lambda path: pd.read_csv(path),
            "pandas.read_csv, and hashlib's SHA-256": lambda path: (pd.read_csv(path), sha256_of(path)),
        }
        for other, script in others.items():
            used, their_s = paired_medians(
                lambda: read_runs(paths), lambda script=script: [script(path) for path in paths], 7, process_time
            )  # fmt: skip
            yield Row(
                f"read {FILES} × {ROWS:,} × 4 CSV, processor time",
                "read_runs (checked, with SHA-256)",
                used,
                other,
                their_s,
                "no slower",
                their_s >= used and same,
                "same bits" if same else "BITS DIFFER",
            )
        ours, other_s = paired_medians(lambda: read_runs(paths), lambda: [pd.read_csv(path) for path in paths], 7)
        yield Row(
            f"read {FILES} × {ROWS:,} × 4 CSV, by the clock",
            "read_runs (two files at a time)",
            ours,
            "pandas.read_csv",
            other_s,
            "no slower",
            other_s >= ours and same,
        )

        from eaid.apparatus import Apparatus
        from eaid.logs.dataset import write_dataset

        steps, _ = cut_runs(runs, StepOptions())
        packed, raw = folder / "data.h5", folder / "raw.h5"
        write_dataset(packed, steps, kind="clutch", apparatus=Apparatus())
        with h5py.File(packed) as source, h5py.File(raw, "w") as target:
            _copy_raw(source, target)

        def load(path: Path) -> None:
            with h5py.File(path) as file:
                for run in file["runs"].values():
                    for column in run.values():
                        column[...]

        share = packed.stat().st_size / raw.stat().st_size
        size = f"{100 * share:.0f} % of the raw size"
        ours, other = paired_medians(lambda: read_runs([packed]), lambda: read_runs([raw]), 9)
        yield Row(
            "read data.h5 with eaid, rows checked, with sha256",
            "data.h5 as eaid writes it",
            ours,
            "the same uncompressed",
            other,
            "≤ 1.3 × the time, ≤ half the size",
            ours <= 1.3 * other and share <= 0.5,
            size,
        )
        ours, other = paired_medians(lambda: load(packed), lambda: load(raw), 9)
        yield Row(
            "load every column of data.h5 with bare h5py",
            "data.h5 as eaid writes it",
            ours,
            "the same uncompressed",
            other,
            "≤ 1.3 × the time",
            ours <= 1.3 * other,
            size,
        )


def _copy_raw(source: h5py.Group, target: h5py.Group) -> None:
    for key, value in source.attrs.items():
        target.attrs[key] = value
    for name, item in source.items():
        if isinstance(item, h5py.Dataset):
            target.create_dataset(name, data=item[...])
        else:
            _copy_raw(item, target.create_group(name))


if __name__ == "__main__":
    for row in rows():
        print(row.what, row.ratio, row.bar, row.met, row.accuracy, file=sys.stdout)
