"""Runs eaid commands in processes of their own and kills them; a script that tests/cli/test_killed.py talks to.

One line of JSON a command on stdin: `arguments`, `folder` (what is watched), and `at_operation` (SIGKILL right before
the n-th operation of the process on files in that folder) or `after_s`. One line back: `status` (−9: killed),
`operations` and `took_s` of a command that came to its end, `orphans` that are still there five seconds later. The
heavy libraries are imported once; every command is a fork, so that a kill costs no start-up.
"""

import contextlib
import ctypes
import json
import os
import signal
import sys
import time
from pathlib import Path
from typing import Any

WATCHED = ("open", "os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.chmod", "tempfile.mkstemp", "tempfile.mkdtemp")
BECOME_REAPER = 36  # PR_SET_CHILD_SUBREAPER: orphans of a killed command become children of this one


def warm() -> None:
    import h5py  # noqa: F401
    import matplotlib as mpl
    import numba  # noqa: F401
    import scipy.optimize
    import scipy.signal
    import scipy.stats  # noqa: F401

    mpl.use("Agg")
    import matplotlib.pyplot  # noqa: F401


class Watch:
    """Counts what the process does with files of a folder, and kills it at a given count."""

    def __init__(self, folder: str, at_operation: int | None) -> None:
        self.folder, self.at, self.count = folder, at_operation, 0

    def __call__(self, event: str, given: tuple[Any, ...]) -> None:
        if event not in WATCHED or not given or not isinstance(given[0], str | bytes | os.PathLike):
            return
        if event == "open" and not (isinstance(given[2], int) and given[2] & (os.O_WRONLY | os.O_RDWR)):
            return
        if not os.path.abspath(os.fsdecode(given[0])).startswith(self.folder):
            return
        self.count += 1
        if self.count == self.at:
            os.kill(os.getpid(), signal.SIGKILL)


def child(order: dict[str, Any], told: int) -> None:
    from eaid.cli.main import run

    silent = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1):
        os.dup2(silent, stream)
    errors = os.open(order["errors"], os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(errors, 2)
    os.chdir(order["folder"])
    watch = Watch(order["folder"], order.get("at_operation"))
    sys.addaudithook(watch)
    start = time.monotonic()
    code = run(order["arguments"])
    sys.stderr.flush()
    os.write(told, json.dumps({"operations": watch.count, "took_s": time.monotonic() - start}).encode())
    os._exit(code)


def orphans() -> int:
    """Processes that a killed command left and that did not end within five seconds."""
    with contextlib.suppress(ChildProcessError):
        for _ in range(500):
            if os.waitpid(-1, os.WNOHANG)[0] == 0:
                time.sleep(0.01)
        return 1
    return 0


def main() -> None:
    warm()
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(BECOME_REAPER, 1, 0, 0, 0)
    print("ready", flush=True)
    for line in sys.stdin:
        order = json.loads(line)
        Path(order["errors"]).unlink(missing_ok=True)
        read, write = os.pipe()
        pid = os.fork()
        if pid == 0:
            os.close(read)
            child(order, write)
        os.close(write)
        if order.get("after_s") is not None:
            time.sleep(order["after_s"])
            os.kill(pid, signal.SIGKILL)
        with os.fdopen(read, "rb") as pipe:
            told = json.loads(pipe.read() or b"{}") if order.get("after_s") is None else {}
        status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        print(json.dumps({"status": status, **told, "orphans": orphans()}), flush=True)


if __name__ == "__main__":
    main()
