"""Commands as processes: what they import, signals, pipes that close, full disks, two at a time."""

import itertools
import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

EAID = [sys.executable, "-m", "eaid"]
SHORT = ["synth", "--levels", "50", "--repeats", "1", "-q", "--force", "-o"]
INTERRUPTED = "error: interrupted; nothing half-written is left\n"
HEAVY = {"numpy", "scipy", "pandas", "h5py", "matplotlib", "numba", "jinja2", "bokeh", "polars"}
LOADED = """
import json, sys
from eaid.cli.main import run
codes = [run(words) for words in json.loads(sys.argv[1])]
print("\\n" + json.dumps([codes, sorted({name.split(".")[0] for name in sys.modules})]))
"""


def ran(*words, **more):
    return subprocess.run([*EAID, *map(str, words)], capture_output=True, text=True, check=False, **more)


def loaded(*commands):
    """Top-level modules that a process has imported when these commands have ended."""
    call = [sys.executable, "-c", LOADED, json.dumps(commands)]
    done = subprocess.run(call, capture_output=True, text=True, check=True)
    codes, modules = json.loads(done.stdout.splitlines()[-1])
    assert set(codes) == {0}, done.stderr
    return set(modules)


def test_help_and_version_import_nothing_heavy():
    names = ["ingest", "fit", "tune-rc", "simulate", "plan", "export", "report", "synth", "couple", "demo"]
    found = loaded([], ["--version"], *([name, "--help"] for name in names))
    assert "typer" in found and found & HEAVY == set()


TABLES, DRAWING = {"pandas", "polars"}, {"matplotlib", "bokeh", "jinja2"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "forbidden"),
    [
        ("ingest -q data.h5 -o again.h5", DRAWING | {"numba"}),
        ("fit -q data.h5 -o f.json", TABLES | DRAWING | {"numba"}),
        ("fit -q logs -o f.json", DRAWING | {"numba"}),
        ("tune-rc -q fit.json -o k.json", DRAWING),
        ("simulate -q fit.json --gains gains.json -o r.h5", DRAWING),
        ("plan -q fit.json --want Ts=20,tau1=40,tau2=80 --no-check -o p.csv", DRAWING),
        ("synth -q -o more.h5 --levels 50 --repeats 1", DRAWING),
        ("report -q fit.json -o page", {"numba"}),
    ],
)
def test_a_command_imports_only_what_it_uses(line, forbidden, rig):
    found = loaded(line.split())
    assert {"numpy", "msgspec"} <= found and found & forbidden == set()
    assert ("matplotlib" in found) == line.startswith("report")


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_at_any_moment(tmp_path, number):
    """While Python starts and finds the package, the words are Python's; from the command line on they are ours."""
    start = time.monotonic()
    assert ran(*SHORT, tmp_path / "whole.h5").returncode == 0
    took, chance, answered = time.monotonic() - start, random.Random(int(number)), 0
    for _ in range(8):
        output = tmp_path / "d.h5"
        output.unlink(missing_ok=True)
        process = subprocess.Popen([*EAID, *SHORT, str(output)], stderr=subprocess.PIPE, text=True)
        time.sleep(chance.uniform(0.02, 0.8 * took))
        process.send_signal(number)
        _, told = process.communicate(timeout=60)
        of_python = process.returncode in (1, -number) and "eaid/cli/main" not in told
        # where Ctrl-C broke off a text inside exec(), CPython ends itself with the signal: a shell shows 130 as well
        code = 130 if process.returncode == -signal.SIGINT else process.returncode
        assert (code, told) in ((130, INTERRUPTED), (0, "")) or of_python, told
        answered += told == INTERRUPTED
        if process.returncode == 0:
            assert output.read_bytes() == (tmp_path / "whole.h5").read_bytes()
        assert [item.name for item in tmp_path.iterdir() if item.name.startswith(".")] == []
    assert answered


@pytest.mark.slow
@pytest.mark.parametrize("line", ["--help", "synth --json --levels 50 --repeats 1 --force -o d.h5"])
@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_a_reader_that_goes_away_is_no_failure(line, stream, tmp_path):
    """`eaid … | head -c 1`: nothing is told, and the work is done."""
    read, write = os.pipe()
    os.close(read)
    other = {"stdout": "stderr", "stderr": "stdout"}[stream]
    streams = {stream: write, other: subprocess.PIPE}
    done = subprocess.run([*EAID, *line.split()], text=True, check=False, cwd=tmp_path, **streams)
    os.close(write)
    assert done.returncode == 0 and "Broken" not in (done.stderr or "") + (done.stdout or "")
    assert line.startswith("synth") == (tmp_path / "d.h5").exists()


@pytest.mark.slow
def test_streams_that_are_closed_full_or_know_few_letters(tmp_path):
    data = tmp_path / "d.h5"
    fit = f"fit {data} -o {tmp_path / 'f.json'} --force --ci none"
    lines = {f"{' '.join(SHORT)} {data}": 0, fit: 0, "fit no.csv": 3}
    for (line, code), redirect in itertools.product(lines.items(), (">&-", "2>&-", ">&- 2>&-")):
        words = f"exec {sys.executable} -m eaid {line} {redirect}"
        assert subprocess.run(["sh", "-c", words], capture_output=True, check=False).returncode == code
    for encoding in ("ascii", "cp1252"):
        few = {**os.environ, "PYTHONIOENCODING": encoding, "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "LC_ALL": "C"}
        for line, code in lines.items():
            assert subprocess.run([*EAID, *line.split()], env=few, capture_output=True, check=False).returncode == code
        helped = subprocess.run([*EAID, "--help"], env=few, capture_output=True, check=False)
        assert helped.returncode == 0 and "fit.json" in helped.stdout.decode(encoding)
    if Path("/dev/full").exists():
        with Path("/dev/full").open("w") as full:
            words = [*EAID, *SHORT, str(tmp_path / "d.h5"), "--json"]
            done = subprocess.run(words, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
        wanted = "error: what is printed cannot be written (No space left on device); make room, or send it elsewhere\n"
        assert (done.returncode, done.stderr) == (2, wanted)


@pytest.mark.slow
def test_the_threads_of_blas_change_no_byte(rig):
    for count in ("1", "2"):
        more = {"OPENBLAS_NUM_THREADS": count, "OMP_NUM_THREADS": count}
        assert ran("fit", "data.h5", "-o", f"{count}.json", "-q", env={**os.environ, **more}).returncode == 0
    assert (rig / "1.json").read_bytes() == (rig / "2.json").read_bytes()


def test_the_shell_completes_commands_and_options() -> None:
    for words, index, wanted in (("eaid tu", 1, "tune-rc"), ("eaid fit --hold", 2, "--hold-out")):
        typed = {"COMP_WORDS": words, "COMP_CWORD": str(index), "_EAID_COMPLETE": "complete_bash"}
        ran = subprocess.run([sys.executable, "-m", "eaid"], env=os.environ | typed, capture_output=True, text=True)
        assert ran.stdout.split() == [wanted]
