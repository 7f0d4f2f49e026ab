"""Faults, made for real: full disk, read-only folder, vanished input, Ctrl-C, two writers, damaged files.

Whatever happens, an earlier output is whole, the final name never holds half a file, and the user gets a sentence.
kill -9 has a file of its own, test_killed.py.
"""

import contextlib
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest

from eaid.cli.inputs import runs_from
from eaid.cli.main import run
from eaid.errors import EaidError
from eaid.logs.dataset import write_dataset

ROOT_USER = hasattr(os, "geteuid") and os.geteuid() == 0
EAID = [sys.executable, "-m", "eaid"]


def write_logs(folder: Path, rows: int = 3000, offset: float = 0.0) -> Path:
    folder.mkdir()
    t = np.arange(rows) / 100.0
    for level in (20, 40, 60, 80, 100):
        u = np.where(t >= 5, level, 0.0)
        noise = 0.01 * np.random.default_rng(level).normal(size=rows)
        y = offset + np.where(
            t >= 5, 0.04 * level * (1 - 0.85 * np.exp(-(t - 5) / 0.5) - 0.15 * np.exp(-(t - 5) / 4)), 0
        )
        np.savetxt(
            folder / f"u{level:03d}.csv", np.c_[t, u, y + noise], fmt="%.8f", delimiter=",",
            header="time_s,duty_pct,torque_nm", comments="",
        )  # fmt: skip
    return folder


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_logs(tmp_path_factory.mktemp("faults") / "logs")


@pytest.fixture(scope="module")
def results(logs: Path) -> Path:
    """One result of each command, made once."""
    folder = logs.parent
    for arguments in (
        ["ingest", str(logs), "-o", str(folder / "data.h5")],
        ["fit", str(folder / "data.h5"), "--model", "linear,nonlinear", "--ci", "none", "-o", str(folder / "fit.json")],
        ["tune-rc", str(folder / "fit.json"), "-o", str(folder / "gains.json")],
    ):
        assert run([*arguments, "-q"]) == 0, arguments
    return folder


COMMANDS: dict[str, tuple[list[str], str]] = {
    "ingest": (["ingest", "{logs}"], "data.h5"),
    "fit": (["fit", "{results}/data.h5", "--ci", "none", "--model", "linear", "--levels", "60,80"], "fit.json"),
    "tune-rc": (["tune-rc", "{results}/fit.json"], "gains.json"),
    "simulate": (
        ["simulate", "{results}/fit.json", "--gains", "{results}/gains.json", "--scenario", "steps"], "replay.h5",
    ),
    "synth": (["synth", "--levels", "20,60", "--repeats", "1"], "synth.h5"),
    "plan": (["plan", "{results}/fit.json", "--no-check"], "plan.csv"),
    "report": (["report", "{results}/gains.json"], "report"),
}  # fmt: skip


def arguments_of(command: str, logs: Path, results: Path, output: Path) -> list[str]:
    given, _ = COMMANDS[command]
    filled = [part.replace("{logs}", str(logs)).replace("{results}", str(results)) for part in given]
    return [*filled, "-q", "--force", "-o", str(output)]


@contextlib.contextmanager
def small_disk(folder: Path, kilobytes: int) -> Iterator[Path]:
    """A disk of its own with so much room; skipped where it cannot be mounted."""
    folder.mkdir()
    mount = shutil.which("mount")
    if not ROOT_USER or mount is None:
        pytest.skip("only root can mount a small disk")
    made = subprocess.run([mount, "-t", "tmpfs", "-o", f"size={kilobytes}k", "none", str(folder)], check=False)
    if made.returncode:
        pytest.skip("a small disk cannot be mounted here")
    try:
        yield folder
    finally:
        subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.parametrize("command", COMMANDS)
def test_full_disk(command: str, logs: Path, results: Path, tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", 8) as disk:
        output = earlier = disk / COMMANDS[command][1]
        if command == "report":
            (output / "figures").mkdir(parents=True)
            earlier = output / "report.html"
        earlier.write_bytes(b"earlier")
        (disk / "filler").write_bytes(bytes(3000))  # two pages are left: too little for any result
        if command in ("tune-rc", "fit", "plan"):  # small results: leave them no page at all
            with contextlib.suppress(OSError):
                (disk / "more").write_bytes(bytes(8192))
        done = subprocess.run(
            [*EAID, *arguments_of(command, logs, results, output)], capture_output=True, text=True, check=False
        )
        assert done.returncode == 2, done.stderr
        assert done.stderr == (
            f"error: {earlier}: cannot be written (No space left on device); make room, or choose another --output\n"
        )
        assert earlier.read_bytes() == b"earlier"
        assert not [item for item in disk.rglob("*") if item.name.endswith(".part")]


def test_read_only_folder(logs: Path, tmp_path: Path) -> None:
    folder = tmp_path / "locked"
    folder.mkdir()
    if ROOT_USER:
        with small_disk(tmp_path / "disk", 512) as disk:
            subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
            done = subprocess.run(
                [*EAID, "ingest", str(logs), "-q", "-o", str(disk / "d.h5")],
                capture_output=True,
                text=True,
                check=False,
            )
            said = f"error: {disk / 'd.h5'}: cannot be written (Read-only file system)"
            said += "; choose another folder with --output\n"
            assert (done.returncode, done.stderr) == (2, said)
        return
    folder.chmod(0o500)
    done = subprocess.run(
        [*EAID, "ingest", str(logs), "-q", "-o", str(folder / "d.h5")], capture_output=True, text=True, check=False
    )
    said = f"error: {folder / 'd.h5'}: cannot be written (Permission denied); choose another folder with --output\n"
    assert (done.returncode, done.stderr) == (2, said)


def test_vanished_input(
    logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A log that goes away between the listing of its folder and its reading."""
    mine = tmp_path / "logs"
    shutil.copytree(logs, mine)
    from eaid import reading

    listed = reading.files_of

    def then_gone(paths: list[Path], tell: Callable[[str], None]) -> list[Path]:
        found = listed(paths, tell)
        (mine / "u040.csv").unlink()
        return found

    monkeypatch.setattr(reading, "files_of", then_gone)
    assert run(["ingest", str(mine), "-q", "-o", str(tmp_path / "d.h5")]) == 3
    assert capsys.readouterr().err == f"error: {mine / 'u040.csv'}: no such file or folder; check the path\n"
    assert not (tmp_path / "d.h5").exists()


def test_what_is_no_plain_file_is_refused_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    os.mkfifo(tmp_path / "pipe.csv")
    assert run(["ingest", str(tmp_path / "pipe.csv"), "-q", "-o", str(tmp_path / "d.h5")]) == 3
    assert run(["ingest", "/dev/zero", "-q", "-o", str(tmp_path / "d.h5")]) == 3
    assert capsys.readouterr().err.count("is no plain file; give a log or a folder of logs") == 2


@pytest.mark.skipif(ROOT_USER, reason="root reads everything")
def test_unreadable_input(logs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.csv"
    shutil.copy(logs / "u020.csv", path)
    path.chmod(0)
    assert run(["ingest", str(path), "-q", "-o", str(tmp_path / "d.h5")]) == 3
    assert capsys.readouterr().err == f"error: {path}: cannot be read (Permission denied); check the file\n"


def test_ctrl_c_while_reading(tmp_path: Path) -> None:
    path = tmp_path / "long.csv"
    row = b"%.3f,50,1.23456\n"
    with path.open("wb") as file:
        file.write(b"time_s,duty_pct,torque_nm\n0,0,0\n")
        file.write(b"".join(row % (k / 1000) for k in range(1, 600_000)))
        file.write(b"600,50,x\n")  # sends it the careful way, which takes seconds
    (tmp_path / "d.h5").write_bytes(b"earlier")
    (tmp_path / "short.csv").write_bytes(b"time_s,duty_pct,torque_nm\n0,0,0\n")
    process = subprocess.Popen(
        [*EAID, "ingest", str(path), str(tmp_path / "short.csv"), "--force", "-o", str(tmp_path / "d.h5")],
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    assert process.stderr.readline() == "reading logs: 2 to do\n"
    time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=30)
    assert (process.returncode, said) == (130, "error: interrupted; nothing half-written is left\n")
    assert (tmp_path / "d.h5").read_bytes() == b"earlier"
    assert sorted(item.name for item in tmp_path.iterdir()) == ["d.h5", "long.csv", "short.csv"]


def test_two_writers_do_not_mix(logs: Path, tmp_path: Path) -> None:
    other = write_logs(tmp_path / "other", offset=0.5)
    whole = []
    for number, folder in enumerate((logs, other)):
        assert run(["ingest", str(folder), "-q", "-o", str(tmp_path / f"{number}.h5")]) == 0
        whole.append((tmp_path / f"{number}.h5").read_bytes())
    output = tmp_path / "d.h5"
    for _ in range(2):
        both = [
            subprocess.Popen([*EAID, "ingest", str(folder), "-q", "--force", "-o", str(output)])
            for folder in (logs, other)
        ]
        assert [process.wait() for process in both] == [0, 0]
        assert output.read_bytes() in whole


def test_damaged_datasets_are_detected(results: Path, tmp_path: Path) -> None:
    """A bit turned anywhere: the same steps, or a sentence; never other numbers in silence."""
    whole = bytearray((results / "data.h5").read_bytes())
    _, truth = runs_from([results / "data.h5"])
    chance = random.Random(11)
    refused = 0
    path = tmp_path / "d.h5"
    for _ in range(60):
        damaged = whole.copy()
        damaged[chance.randrange(len(whole))] ^= 1 << chance.randrange(8)
        path.write_bytes(damaged)
        try:
            _, found = runs_from([path])
        except EaidError as fault:
            refused += all(sentence.startswith(str(path)) for sentence in fault.sentences)
            continue
        for one, other in zip(truth.levels, found.levels, strict=True):
            np.testing.assert_array_equal(one.runs, other.runs)
            np.testing.assert_array_equal(one.time_s, other.time_s)
        assert truth.runs == found.runs
    assert refused > 40


@pytest.mark.parametrize("version", ["eaid/data/0", "eaid/data/2"])
def test_other_schema_versions_are_refused_by_name(
    version: str, results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "d.h5"
    shutil.copy(results / "data.h5", path)
    with h5py.File(path, "a") as file:
        file.attrs["schema"] = version
        del file.attrs["digest"]  # which such a version would have made itself
    assert run(["fit", str(path), "-o", str(tmp_path / "fit.json")]) == 3
    assert f"its schema is '{version}', and this eaid reads 'eaid/data/1'" in capsys.readouterr().err


def test_names_cannot_leave_the_output_folder(logs: Path, tmp_path: Path) -> None:
    runs, stepset = runs_from([logs])
    from dataclasses import replace

    odd = [replace(runs[0], name="../../out"), replace(runs[1], name="/etc/x"), replace(runs[2], name="a/b")]
    write_dataset(tmp_path / "d.h5", odd, kind="clutch", apparatus=stepset.apparatus)
    with h5py.File(tmp_path / "d.h5") as file:
        assert sorted(file["runs"]) == [".._.._out", "_etc_x", "a_b"]
    assert [item.name for item in tmp_path.iterdir()] == ["d.h5"]
