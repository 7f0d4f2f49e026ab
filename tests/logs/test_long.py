"""Long logs: read piece by piece, kept on disk; the same steps as short ones, every bad cell in its own row.

Memory and time at full size (1 GB, a day at 1 kHz) are measured by `python -m benchmarks.size`.
"""

import gzip
import mmap
from pathlib import Path

import numpy as np
import pytest

from eaid.cli.inputs import runs_from
from eaid.cli.main import run
from eaid.errors import DataError
from eaid.logs import longtext, read, spool, text
from eaid.logs.dataset import write_dataset
from eaid.logs.options import ReadOptions
from eaid.logs.read import read_runs
from eaid.logs.spool import on_disk

ROWS = 30_000


@pytest.fixture
def long_from_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Everything counts as long, in small pieces."""
    monkeypatch.setattr(spool, "LONG", 1000)
    monkeypatch.setattr("eaid.logs.dataset.LONG", 1000)
    monkeypatch.setattr(spool, "PIECE", 777)
    monkeypatch.setattr(text, "LONG_BYTES", 1000)
    monkeypatch.setattr(longtext, "PIECE_BYTES", 5000)


def lines(noise: float = 0.01) -> list[str]:
    t = np.arange(ROWS) / 1000.0
    u = np.where((t >= 5) & (t < 20), 50, 0)
    rise = np.where(t >= 5, 1 - np.exp(-(t - 5).clip(0) / 0.5), 0) * np.where(t >= 20, np.exp(-(t - 20).clip(0)), 1)
    y = 2 * rise + 0.1 + noise * np.random.default_rng(1).normal(size=ROWS)
    return ["time_ms,duty_pct,torque_nm"] + [f"{1000 * a:.0f},{b},{c:.7f}" for a, b, c in zip(t, u, y, strict=True)]


def write(path: Path, rows: list[str], packed: bool = False) -> Path:
    content = ("\n".join(rows) + "\n").encode()
    path.write_bytes(gzip.compress(content) if packed else content)
    return path


@pytest.mark.parametrize("packed", [False, True], ids=["plain", "gzip"])
def test_a_long_log_gives_the_same_steps(tmp_path: Path, request: pytest.FixtureRequest, packed: bool) -> None:
    log = write(tmp_path / "a.csv", lines(), packed)
    _, short = runs_from([log])
    request.getfixturevalue("long_from_here")
    runs, long = runs_from([log])
    assert isinstance(spool_of(runs[0].output), np.memmap)
    for one, other in zip((*short.levels, *short.releases), (*long.levels, *long.releases), strict=True):
        np.testing.assert_array_equal(one.time_s, other.time_s)
        np.testing.assert_allclose(one.runs, other.runs, rtol=0, atol=1e-12)  # the mean of pieces rounds apart
    for a, b in zip(short.runs, long.runs, strict=True):
        assert (a.name, a.level, a.step_s, a.samples, a.warnings) == (b.name, b.level, b.step_s, b.samples, b.warnings)


def spool_of(array: np.ndarray) -> object:
    while not isinstance(array, np.memmap) and array.base is not None:
        array = array.base
    return array


@pytest.mark.usefixtures("long_from_here")
def test_from_a_dataset_too(tmp_path: Path) -> None:
    log = write(tmp_path / "a.csv", lines())
    runs, of_log = runs_from([log])
    write_dataset(tmp_path / "d.h5", runs, kind="clutch", apparatus=of_log.apparatus)
    _, of_dataset = runs_from([tmp_path / "d.h5"])
    for one, other in zip((*of_log.levels, *of_log.releases), (*of_dataset.levels, *of_dataset.releases), strict=True):
        np.testing.assert_array_equal(one.runs, other.runs)
    assert of_log.runs == of_dataset.runs


@pytest.mark.usefixtures("long_from_here")
def test_a_large_dataset_goes_to_the_disk_directly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    runs, stepset = runs_from([write(tmp_path / "a.csv", lines())])
    write_dataset(tmp_path / "memory.h5", runs, kind="clutch", apparatus=stepset.apparatus)
    monkeypatch.setattr("eaid.files.IN_MEMORY", 0)
    for name in ("a.h5", "b.h5"):
        write_dataset(tmp_path / name, runs, kind="clutch", apparatus=stepset.apparatus)
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()
    np.testing.assert_array_equal(
        runs_from([tmp_path / "a.h5"])[1].levels[0].runs, runs_from([tmp_path / "memory.h5"])[1].levels[0].runs
    )
    monkeypatch.setattr("shutil.disk_usage", lambda _: type("", (), {"free": 1000})())
    with pytest.raises(Exception, match=r"takes up to 1 MB, and 0 MB are free; make room, or choose another output="):
        write_dataset(tmp_path / "c.h5", runs, kind="clutch", apparatus=stepset.apparatus)
    assert not (tmp_path / "c.h5").exists()


@pytest.mark.usefixtures("long_from_here")
def test_bad_cells_are_told_by_their_own_row(tmp_path: Path) -> None:
    rows = lines()
    rows[17_000] = "16999,50"
    rows[23_456] = "23455,0,high"
    rows.insert(9_000, "# a pause\n")  # one comment and one blank line shift what follows by two
    log = write(tmp_path / "a.csv", rows)
    with pytest.raises(DataError) as caught:
        read_runs([log])
    assert [said.split(": ")[1].split(";")[0] for said in caught.value.sentences] == [
        "row 17003 has 2 cells, unlike the others",
        "row 23459, column torque_nm, holds 'high', which is no number",
    ]
    (run,) = read_runs([log], ReadOptions(repair=True))
    assert run.notes == ("--repair dropped 2 of 30000 rows",)
    assert len(run.time_s) == ROWS - 2


@pytest.mark.usefixtures("long_from_here")
def test_a_falling_time_across_pieces(tmp_path: Path) -> None:
    rows = lines()
    del rows[20_001]
    rows.insert(20_300, lines()[20_001])
    with pytest.raises(DataError, match=r"time falls at row 20301 \(20 s after 20\.299 s\)"):
        read_runs([write(tmp_path / "a.csv", rows)])


@pytest.mark.usefixtures("long_from_here")
def test_progress_is_told(tmp_path: Path) -> None:
    heard: list[float] = []
    read_runs([write(tmp_path / "a.csv", lines())], ReadOptions(tell=lambda _, share: heard.append(share)))
    assert heard == sorted(heard)
    assert heard[-1] == 1.0
    assert len(heard) > 50


@pytest.mark.usefixtures("long_from_here")
def test_a_cut_off_gzip_is_told(tmp_path: Path) -> None:
    log = write(tmp_path / "a.csv.gz", lines(), packed=True)
    log.write_bytes(log.read_bytes()[:-1000])
    with pytest.raises(DataError, match="is no whole gzip file"):
        read_runs([log])


def test_many_runs_give_the_same_from_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the memory is full of other runs, columns lie on disk: bit for bit the same dataset."""
    logs = tmp_path / "logs"
    assert run(["synth", "--levels", "20,50", "--repeats", "3", "--rate", "100", "-q", "-o", str(logs)]) == 0
    assert run(["ingest", str(logs), "-q", "-o", str(tmp_path / "memory.h5")]) == 0
    monkeypatch.setattr(read, "IN_MEMORY", 100_000)
    runs = read_runs([logs])
    mapped = [is_mapped(one.output) for one in runs]
    assert 1 <= sum(mapped) < len(mapped)
    assert all(
        is_mapped(one.time_s) and not one.time_s.flags.writeable for one, on in zip(runs, mapped, strict=True) if on
    )
    assert run(["ingest", str(logs), "-q", "-o", str(tmp_path / "disk.h5")]) == 0
    assert (tmp_path / "disk.h5").read_bytes() == (tmp_path / "memory.h5").read_bytes()


def is_mapped(values: np.ndarray) -> bool:
    while isinstance(values, np.ndarray) and values.base is not None:
        values = values.base
    return isinstance(values, mmap.mmap)


def test_columns_that_take_no_memory_take_no_disk() -> None:
    none = np.broadcast_to(np.float64(np.nan), 1000)
    kept = on_disk(np.arange(1000.0), none, np.empty(0))
    assert kept[1] is none and kept[2].size == 0
    np.testing.assert_array_equal(kept[0], np.arange(1000.0))
    assert on_disk(none)[0] is none
