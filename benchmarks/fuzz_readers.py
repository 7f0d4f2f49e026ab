"""`python -m benchmarks.fuzz_readers [READER …] [--seconds 600]`: coverage-guided fuzzing of every reader (atheris).

Each reader runs in a process of its own on valid files, mutated: at first its reading, then all its columns. Whatever
comes out besides a refusal, a hang beyond 20 s and more than 1 GB of memory count as findings, whose inputs are kept.
"""

import argparse
import faulthandler
import os
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path

ROOT = Path(__file__).parent.parent
READERS = ("text", "gzip", "lvm", "mat", "hdf5", "dataset", "tdms", "parquet", "mdf", "ros1", "mcap", "sqlite")
TIMEOUT_S, MEMORY_MB = 20, 1024


def seeds(name: str, folder: Path) -> Iterator[Path]:
    """Small valid files of a format."""
    sys.path.insert(0, str(ROOT / "tests" / "logs"))
    import gzip

    import logs_written as made
    import numpy as np

    t, duty, torque = made.step(300)
    path = folder / f"seed-{name}"
    rows = [f"{a:.4f},{b:g},{c:.6f}" for a, b, c in zip(t[150:], duty[150:], torque[150:], strict=False)]
    text = "# made by hand\ntime_s,duty_pct,torque_nm\n" + "\n".join(rows) + "\n"
    if name == "text":
        path.write_text(text)
        for i, other in enumerate([text.replace(",", ";").replace(".", ","), text.replace(",", "\t")]):
            second = folder / f"seed-text-{i}"
            second.write_bytes(other.encode("utf-16" if i else "latin-1"))
            yield second
    elif name == "gzip":
        path.write_bytes(gzip.compress(text.encode()))
    elif name == "lvm":
        head = "Channels\t1\nY_Unit_Label\tNm\nX_Dimension\tTime\nX0\t0\nDelta_X\t0.01\n***End_of_Header***\n"
        body = "X_Value\tTorque\tComment\n" + "\n".join(f"{i / 100}\t{i}" for i in range(30)) + "\n\n"
        top = "LabVIEW Measurement\nSeparator\tTab\nDecimal_Separator\t.\nMulti_Headings\tYes\nX_Columns\tOne\n"
        path.write_text(top + "***End_of_Header***\n\n" + (head + body) * 2)
    elif name == "mat":
        from scipy.io import savemat

        savemat(path, {"time": t, "torque": torque, "s": {"time": t, "y": duty}}, appendmat=False)
        second = folder / "seed-mat-4"
        savemat(second, {"log": np.stack([t, duty, torque])}, appendmat=False, format="4")
        yield second
    elif name in ("hdf5", "dataset"):
        import h5py

        with h5py.File(path, "w") as file:
            group = file.create_group("runs/a") if name == "dataset" else file
            for key, values in {"time_s": t, "input": duty, "torque_nm": torque}.items():
                group.create_dataset(key, data=values, compression="gzip", shuffle=True)
            if name == "dataset":
                file.attrs.update(schema="eaid/data/1", kind="clutch", input_unit="%")
                group.attrs.update(level=60.0, repeat=1, step_s=1.0, baseline_nm=0.0, source="a", sha256="0")
            else:
                file["matrix"] = np.stack([t, duty, torque])
    elif name in ("mcap", "sqlite"):
        made.ros2(path, t, duty, torque, storage="sqlite3" if name == "sqlite" else "mcap")
    else:
        getattr(made, name)(path, t, duty, torque)
    yield path


def target(name: str, kept: Path) -> Callable[[bytes], None]:
    """One try on bytes: read as the format that they are seeds of, then load every column."""
    from eaid.errors import DataError, UsageError
    from eaid.logs import formats
    from eaid.logs.dataset import read_dataset

    form = {"gzip": "text", "hdf5": "HDF5 or MAT v7.3", "lvm": "LabVIEW LVM", "mat": "MAT v4 or v5", "tdms": "TDMS",
            "parquet": "Parquet", "mdf": "MDF"}.get(name, "ROS bag")  # fmt: skip
    form = "text" if name == "text" else form
    read = next(row.read for row in formats.FORMATS if row.name == form)
    path = Path(tempfile.mkdtemp(prefix="fuzz")) / "log"
    seen: set[str] = set()

    def once(data: bytes) -> None:
        path.write_bytes(data)
        try:
            if name == "dataset":
                read_dataset(path, "log", "0")
            else:
                for sheet in read(path, "log"):
                    sheet.load(range(len(sheet.columns)))
        except (DataError, UsageError):
            pass
        except Exception as fault:
            last = traceback.extract_tb(fault.__traceback__)[-1]
            where = f"{type(fault).__name__} at {Path(last.filename).name}:{last.lineno}"
            if where not in seen:
                seen.add(where)
                (kept / f"finding-{name}-{len(seen)}").write_bytes(data)
                print(f"FINDING {name}: {where}: {str(fault)[:200]}", file=sys.stderr, flush=True)

    return once


def child(name: str, seconds: int, folder: Path) -> None:
    """Fuzz one reader in this process (atheris does not return)."""
    import atheris

    with atheris.instrument_imports(include=["eaid", "nptdms", "asammdf", "rosbags"]):
        once = target(name, folder)
    corpus = folder / f"corpus-{name}"
    corpus.mkdir(exist_ok=True)
    for seed in seeds(name, folder):
        seed.replace(corpus / seed.name)
    arguments = [
        sys.argv[0], str(corpus), f"-max_total_time={seconds}", f"-timeout={TIMEOUT_S}", f"-rss_limit_mb={MEMORY_MB}",
        f"-artifact_prefix={folder}/{name}-", "-max_len=200000", "-print_final_stats=1", "-verbosity=1",
    ]  # fmt: skip
    faulthandler.dump_traceback_later(seconds + 3 * TIMEOUT_S, exit=True)  # a hang that libFuzzer does not see
    atheris.Setup(arguments, once)
    atheris.Fuzz()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("readers", nargs="*", default=READERS)
    parser.add_argument("--seconds", type=int, default=600)
    parser.add_argument("--keep", type=Path, default=Path(tempfile.gettempdir()) / "eaid-fuzz")
    parser.add_argument("--child", action="store_true")
    given = parser.parse_args()
    given.keep.mkdir(exist_ok=True, parents=True)
    if given.child:
        child(given.readers[0], given.seconds, given.keep)
        return
    for name in given.readers:
        start = time.monotonic()
        settings = ("--child", "--seconds", str(given.seconds), "--keep", str(given.keep))
        done = subprocess.run(
            [sys.executable, "-m", "benchmarks.fuzz_readers", name, *settings],
            cwd=ROOT, env={**os.environ, "OMP_NUM_THREADS": "1"}, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
            text=True, errors="replace", check=False,
        )  # fmt: skip
        lines = done.stderr.splitlines()
        found = [line for line in lines if line.startswith(("FINDING", "Timeout")) or "SUMMARY" in line]
        tries = next((line.split()[-1] for line in lines if "number_of_executed_units" in line), "?")
        peak = next((line.split()[-1] for line in lines if "peak_rss_mb" in line), "?")
        print(
            f"{name}: {time.monotonic() - start:.0f} s, {tries} inputs, peak {peak} MB, exit {done.returncode}, "
            f"{len(found)} findings",
            flush=True,
        )
        for line in found:
            print(f"  {line}", flush=True)
        if done.returncode:
            print("  " + "\n  ".join(lines[-40:]), flush=True)


if __name__ == "__main__":
    main()
