"""kill -9 right before any operation on files: earlier outputs stay whole, no final name ever holds half a file.
`EAID_KILLS=50` kills so often, in place of a few times. What may be left over is `.NAME.….part`, no file of a run."""

import contextlib
import ctypes
import os
import random
import re
import shutil
import signal
import sys
import time
from pathlib import Path

import pytest

from eaid.cli import main

KILLS = int(os.environ.get("EAID_KILLS", "2"))
LEFT_OVER = re.compile(r"\..+\.[0-9a-f]{12}\.part")
WATCHED = ("open", "os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.chmod", "tempfile.mkstemp", "tempfile.mkdtemp")
BECOME_REAPER = 36  # PR_SET_CHILD_SUBREAPER: what a killed command leaves becomes a child of its watcher

pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform != "linux", reason="forks and adopts orphans")]


def child(words, at, told):
    """Run a command that kills itself right before its `at`-th operation on files of this folder."""
    count, folder = 0, os.getcwd()

    def watch(event, given):
        nonlocal count
        if event not in WATCHED or not given or not isinstance(given[0], str | bytes | os.PathLike):
            return
        writes = event != "open" or (isinstance(given[2], int) and given[2] & (os.O_WRONLY | os.O_RDWR))
        if writes and os.path.abspath(os.fsdecode(given[0])).startswith(folder):
            count += 1
            if count == at:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(watch)
    code = main.run(words)
    os.write(told, str(count).encode())
    os._exit(code)


def ran(words, at=0):
    """Exit code of a command in a process of its own (−9: killed) and its operations; no process outlives it by 5 s."""
    read, write = os.pipe()
    if (watcher := os.fork()) == 0:
        ctypes.CDLL(None).prctl(BECOME_REAPER, 1, 0, 0, 0)
        if (pid := os.fork()) == 0:
            with contextlib.suppress(BaseException):
                child(words, at, write)
            os._exit(99)
        status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        with contextlib.suppress(ChildProcessError):
            for _ in range(500):
                if os.waitpid(-1, os.WNOHANG)[0] == 0:
                    time.sleep(0.01)
            status = 98
        os._exit(status % 256)
    os.close(write)
    with os.fdopen(read) as pipe:
        operations = int(pipe.read() or 0)
    status = os.waitstatus_to_exitcode(os.waitpid(watcher, 0)[1])
    return (-9 if status == 247 else status), operations


LINES = [
    "ingest GIVEN/logs -o data.h5", "fit GIVEN/data.h5 --model linear --ci bootstrap -o fit.json",
    "tune-rc GIVEN/fit.json -o gains.json", "report GIVEN/fit.json GIVEN/gains.json -o page",
    "simulate GIVEN/fit.json --gains GIVEN/gains.json --scenario steps -o replay.h5",
    "synth --levels 30,60 --repeats 1 --seed 7 -o synth.h5", "plan GIVEN/fit.json --no-check -o plan.csv",
    "synth --levels 30,60 --repeats 2 --seed 7 --rate-hz 20 --hold 5 -o folder",
]  # fmt: skip
EARLIER = "synth --levels 20,50 --repeats 3 --seed 1 --rate-hz 20 --hold 5 -o folder"
"""A folder that the new one replaces whole; other outputs begin as the new ones with a line behind them."""


def whole(files):
    """Files that are not left over."""
    return {name: content for name, content in files.items() if not any(map(LEFT_OVER.fullmatch, Path(name).parts))}


@pytest.mark.parametrize("line", LINES)
def test_killed(line, made, tmp_path, monkeypatch, held):
    work, words = tmp_path / "work", [*line.replace("GIVEN", str(made)).split(), "-q", "--force"]
    work.mkdir()
    monkeypatch.chdir(work)
    status, operations = ran(words)
    new, earlier = held(work), {name: content + b"\n# earlier\n" for name, content in held(work).items()}
    assert status == 0 and new
    if "-o folder" in line:
        shutil.rmtree("folder")
        assert ran(EARLIER.split())[0] == 0
        earlier = held(work)
    for at in random.Random(line).sample(range(1, operations + 1), min(KILLS, operations)):
        for item in work.iterdir():
            shutil.rmtree(item) if item.is_dir() else item.unlink()
        for name, content in earlier.items():
            (work / name).parent.mkdir(parents=True, exist_ok=True)
            (work / name).write_bytes(content)
        assert ran(words, at)[0] == -9
        found = whole(held(work))
        assert all(content in (earlier.get(name), new.get(name)) for name, content in found.items())
        assert set(earlier) & set(new) <= set(found) and ("-o folder" not in line or found in (earlier, new))
    assert ran(words)[0] == 0  # on top of what the last kill left
    assert whole(held(work)) == new
