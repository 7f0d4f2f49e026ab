"""`python -m benchmarks.fuzz_readers [READER …] [--seconds 600]`: coverage-guided fuzzing of every reader (atheris).

Each reader runs in a process of its own on valid files (`fuzz_seeds`), mutated: at first its reading, then all its
columns. Findings, whose inputs are kept: whatever comes out besides a refusal; more than 5 s of processor time or 120 s
in all; more memory than `FLOOR` and four times the file; a number that differs from what `fuzz_oracles` reads. Where
the process ends (a finding too), another goes on from the corpus until the time is over.
"""

import argparse
import faulthandler
import gzip
import itertools
import json
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
FORMS = {
    "text": "text", "gzip": "text", "lvm": "lvm.read_lvm", "mat": "mat.read_mat", "hdf5": "hdf5.read_hdf5",
    "dataset": "", "tdms": "tdms.read_tdms", "parquet": "parquet.read_parquet", "mdf": "mdf.read_mdf",
    "ros1": "ros.read_ros", "mcap": "ros.read_ros", "sqlite": "ros.read_ros", "manifest": "", "results": "",
}  # fmt: skip
"""Target → its reader in `eaid.logs.foreign`, or text; empty where it is no reader of foreign logs."""
LIBRARIES = {
    "tdms": ("nptdms.tdms",), "mdf": ("asammdf.blocks.mdf_v4", "asammdf.blocks.mdf_v3", "asammdf"),
    "parquet": ("pyarrow.parquet",), "mat": ("scipy.io.matlab",), "hdf5": ("h5py",), "dataset": ("h5py",),
    "results": ("h5py", "eaid.report.results"), "manifest": ("tomllib", "eaid.cli.inputs"),
    "text": ("eaid.cli.inputs",), "gzip": ("eaid.cli.inputs",),
    **dict.fromkeys(("ros1", "mcap", "sqlite"), (
        "rosbags.rosbag1.reader", "rosbags.rosbag2.storage_mcap", "rosbags.rosbag2.storage_sqlite3", "rosbags.typesys",
    )),
}  # fmt: skip
"""What is imported under instrumentation besides eaid: parsers in Python guide the fuzzer."""
INSTRUMENTED = ["eaid", "nptdms", "asammdf", "rosbags", "tomllib", "scipy.io", "h5py", "pyarrow.parquet"]
TIMEOUT_S, SLOW_S, MEMORY_MB = 120, 5.0, 2048
FLOOR = 64 << 20
"""Memory that a reader may take whatever the size of its file [bytes]: buffers, caches, small arrays."""
WORDS = {
    "lvm": ("***End_of_Header***", "Multi_Headings", "X_Columns", "Separator", "Comment", "X_Value"),
    "text": ("NaN", "inf", "1e308", "0x10", "1_0", "#", "%", "//", "\\xef\\xbb\\xbf", "\\xff\\xfe", "time", "Hz", ";"),
    "manifest": ("schema", "[options]", "[[log]]", "nan", "inf", "1979-05-27", "0x10", "'''", "true", "file", "rate"),
    "results": ("NaN", "Infinity", "1e999", "null", "[[", "{}", "\\\\ud800", "schema", "friction", "nonlinear"),
    "mat": ("MI", "\\x0e\\x00\\x00\\x00", "\\x0f\\x00\\x00\\x00", "\\xff\\xff\\xff\\xff"),
    "sqlite": ("SQLite format 3", "CREATE TABLE", "WITHOUT ROWID", "UNION ALL"),
    "parquet": ("PAR1", "ARROW:schema"), "mdf": ("##DG", "##CG", "##CN", "##DZ", "##DT", "##HL", "##CC", "##SD"),
}  # fmt: skip
"""Words that a mutation may put into a file, as libFuzzer writes them."""


class Watch:
    """Tells findings once a place, keeps their inputs, and measures the memory of each try."""

    def __init__(self, name: str, kept: Path) -> None:
        self.name, self.kept = name, kept
        self.seen: set[str] = set()
        self.most = FLOOR

    def found(self, where: str, what: str, data: bytes) -> None:
        """A finding: kept and told where its place is new."""
        if where in self.seen:
            return
        self.seen.add(where)
        path = self.kept / f"finding-{self.name}-{os.getpid()}-{len(self.seen)}"
        path.write_bytes(data)
        print(f"FINDING {self.name}: {where}: {what[:200]} ({path})", file=sys.stderr, flush=True)

    def fault(self, fault: BaseException, data: bytes) -> None:
        """What came out besides a refusal."""
        last = traceback.extract_tb(fault.__traceback__)[-1]
        own = [one for one in traceback.extract_tb(fault.__traceback__) if "/eaid/" in one.filename]
        where = f"{type(fault).__name__} at {Path(last.filename).name}:{last.lineno}"
        self.found(where, f"{fault} from {own[-1].filename}:{own[-1].lineno}" if own else str(fault), data)

    def begin(self) -> None:
        """Set the high-water mark of the memory to what is in use."""
        Path("/proc/self/clear_refs").write_text("5")
        self.before, self.clock = _memory("VmRSS"), time.process_time()

    def end(self, data: bytes) -> None:
        """A finding where the try took more memory or time than it may."""
        taken, spent = _memory("VmHWM") - self.before, time.process_time() - self.clock
        if taken > self.most + 4 * len(data):
            self.most = 2 * taken
            self.found(f"memory {taken >> 20} MB", f"on a file of {len(data):,} bytes", data)
        if spent > SLOW_S:
            self.found("slow", f"{spent:.1f} s of processor time", data)


def _memory(what: str) -> int:
    status = Path("/proc/self/status").read_text()
    return int(status.partition(what + ":")[2].split(None, 1)[0]) << 10


def target(name: str, watch: Watch) -> Callable[[bytes], None]:
    """One try on bytes: read as the format that they are seeds of, then load every column."""
    import pkgutil
    from importlib import import_module

    import eaid.logs

    readers = [f"eaid.logs.{module.name}" for module in pkgutil.iter_modules(eaid.logs.__path__)]
    for module in (*LIBRARIES.get(name, ()), *readers):
        import_module(module)
    from eaid.logs.options import ReadOptions

    from eaid.errors import EaidError
    from eaid.logs.read import read_what_can_be

    folder = Path(tempfile.mkdtemp(prefix="fuzz"))
    path = folder / ("dataset.toml" if name == "manifest" else "log")
    if name == "manifest":
        (folder / "a.csv").write_text("time_s,duty_pct,torque_nm\n" + "".join(f"{i},{i // 9},{i}\n" for i in range(30)))
    oracle: Callable[[bytes, Any], str] | None
    from benchmarks import fuzz_oracles

    oracle = fuzz_oracles.ORACLES.get(name)
    read = reader(FORMS[name]) if FORMS[name] else None

    turn = itertools.count()

    def tried() -> Any:
        if read is not None:
            answer = _loaded(read, path) if FORMS[name] == "text" else _refused_or(read, path)
            if name in ("text", "gzip") and next(turn) % 4 == 0:  # steps take longer to find than numbers to read
                _to_steps(path)
            return answer
        if name == "dataset":
            return read_what_can_be([path], ReadOptions())
        if name == "manifest":
            return _to_steps(folder)
        from eaid.report.read import read_results

        return read_results([path])

    def once(data: bytes) -> None:
        path.write_bytes(data)
        watch.begin()
        try:
            answer = tried()
        except EaidError:
            answer = None
        except Exception as fault:  # whatever it is, it is a finding
            answer = None
            watch.fault(fault, data)
        watch.end(data)
        if answer is not None and oracle is not None and (wrong := oracle(data, answer)):
            watch.found(f"wrong number {wrong[:30]}", wrong, data)

    return once


def _to_steps(path: Path) -> Any:
    from eaid.cli import console
    from eaid.cli.inputs import runs_from

    console.warn = lambda *_: None  # type: ignore[assignment]
    return runs_from([path])


def reader(name: str) -> Callable[[Path, str], list[Any]]:
    """The function that reads a format, in this process, so that coverage and memory are seen."""
    from eaid.logs.foreign.answer import reader_of
    from eaid.logs.text import read_text

    return read_text if name == "text" else reader_of(name)


def _loaded(read: Callable[[Path, str], list[Any]], path: Path) -> list[tuple[Any, Any]]:
    """Tables of a file, each with all its columns."""
    return [(table, table.load(range(len(table.columns)))) for table in read(path, "log")]


def _refused_or(read: Callable[[Path, str], list[Any]], path: Path) -> list[tuple[Any, Any]]:
    """The same; whatever a library raises is a refusal, as the isolated reader makes it one."""
    from eaid.errors import DataError

    try:
        return _loaded(read, path)
    except Exception as fault:
        raise DataError(f"log: {fault}") from None


def _mutated_inside(data: bytes, most: int, seed: int) -> bytes:
    """A gzip mutated as it stands, or what is in it."""
    import atheris

    if seed % 4:
        try:
            return gzip.compress(atheris.Mutate(gzip.decompress(data), 5 * most), 1, mtime=0)
        except (OSError, EOFError, ValueError, gzip.zlib.error):  # type: ignore[attr-defined]
            pass
    return bytes(atheris.Mutate(data, most))


def child(name: str, seconds: int, folder: Path) -> None:
    """Fuzz one reader in this process (atheris does not return)."""
    import atheris

    watch = Watch(name, folder)
    with atheris.instrument_imports(include=INSTRUMENTED):
        once = target(name, watch)
    corpus = folder / f"corpus-{name}"
    if not corpus.is_dir():
        from benchmarks.fuzz_seeds import seeds

        corpus.mkdir()
        for seed in seeds(name, folder):
            once(seed.read_bytes())  # warm: what the readers import and keep is no memory of a try
            seed.replace(corpus / seed.name)
        watch.seen.clear()
    else:
        for seed in sorted(corpus.glob("seed-*"))[:30]:
            once(seed.read_bytes())
    watch.most = FLOOR
    words = folder / f"{name}.dict"
    words.write_text("".join('"' + word.replace('"', '\\"') + '"\n' for word in WORDS.get(name, ("time", "log"))))
    arguments = [
        sys.argv[0], str(corpus), f"-max_total_time={seconds}", f"-timeout={TIMEOUT_S}", f"-rss_limit_mb={MEMORY_MB}",
        f"-artifact_prefix={folder}/{name}-", "-max_len=60000", "-print_final_stats=1", "-len_control=0",
        f"-dict={words}",
    ]  # fmt: skip
    faulthandler.dump_traceback_later(seconds + 3 * TIMEOUT_S, exit=True)  # a hang that libFuzzer does not see
    atheris.Setup(arguments, once, **({"custom_mutator": _mutated_inside} if name == "gzip" else {}))
    atheris.Fuzz()


def campaign(name: str, seconds: int, keep: Path) -> dict[str, Any]:
    """Fuzz one reader for so long, in as many processes as it takes."""
    start, tries, edges, peak, ended = time.monotonic(), 0, 0, 0, 0
    used = _processor_s()
    findings: list[str] = []
    while (left := seconds - (time.monotonic() - start)) > 2:
        settings = ("--child", "--seconds", str(max(1, int(left))), "--keep", str(keep))
        with (keep / f"{name}.log").open("ab+") as log:
            at = log.seek(0, os.SEEK_END)
            done = subprocess.run(
                [sys.executable, "-m", "benchmarks.fuzz_readers", name, *settings],
                cwd=ROOT, env={**os.environ, "OMP_NUM_THREADS": "1"}, stdout=subprocess.DEVNULL, stderr=log,
                check=False,
            )  # fmt: skip
            log.seek(at)
            lines = log.read().decode(errors="replace").splitlines()
        told = "\n".join(lines)
        tries += max([int(n) for n in re.findall(r"(?m)^(?:stat::number_of_executed_units: +|#)(\d+)", told)] or [0])
        edges = max([edges, *(int(n) for n in re.findall(r"\bcov: (\d+)", told))])
        peak = max([peak, *(int(n) for n in re.findall(r"peak_rss_mb: +(\d+)", told))])
        findings += [line for line in lines if line.startswith("FINDING") and line not in findings]
        if done.returncode:
            ended += 1
            told_why = [line for line in lines if "SUMMARY" in line or "ERROR: " in line or "artifact" in line]
            findings += [f"ENDED {name} ({done.returncode}): {' | '.join(told_why)[:300] or lines[-3:]}"]
            if ended > 40:
                break
    spent = time.monotonic() - start
    return {
        "reader": name, "seconds": round(spent), "processor_s": round(_processor_s() - used), "tries": tries,
        "edges": edges, "peak_mb": peak, "ended": ended, "findings": findings,
    }  # fmt: skip


def _processor_s() -> float:
    """Processor time of all processes that have ended [s]."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("readers", nargs="*", default=list(FORMS))
    parser.add_argument("--seconds", type=int, default=600)
    parser.add_argument("--keep", type=Path, default=Path(tempfile.gettempdir()) / "eaid-fuzz")
    parser.add_argument("--child", action="store_true")
    given = parser.parse_args()
    given.keep.mkdir(exist_ok=True, parents=True)
    if given.child:
        child(given.readers[0], given.seconds, given.keep)
        return
    for name in given.readers:
        row = campaign(name, given.seconds, given.keep)
        with (given.keep / "table.jsonl").open("a") as table:
            table.write(json.dumps(row) + "\n")
        told = "{reader}: {seconds} s ({processor_s} s of processor time), {tries} inputs, {edges} edges, "
        print((told + "peak {peak_mb} MB, ended {ended} times").format(**row))
        print("".join(f"  {line}\n" for line in row["findings"]), end="", flush=True)


if __name__ == "__main__":
    main()
