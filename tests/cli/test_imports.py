"""No command imports what it does not use: each runs in a process of its own, which then looks at `sys.modules`."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

DRAWING = {"matplotlib", "bokeh", "jinja2"}
TABLES = {"pandas", "pyarrow", "polars"}
MACHINE = {"numba"}
CODE = """
import json, sys
from eaid.cli.main import run
code = run(json.loads(sys.argv[1]))
print("\\n" + json.dumps([code, sorted(sys.modules)]))
"""


def loaded(where: Path, *arguments: str) -> set[str]:
    """Names of the modules that a command has imported when it ends."""
    done = subprocess.run(
        [sys.executable, "-c", CODE, json.dumps(arguments)], cwd=where, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    code, modules = json.loads(done.stdout.splitlines()[-1])
    assert code == 0, done.stderr
    return set(modules)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset of four levels, a few small CSV logs, a fit and gains."""
    where = tmp_path_factory.mktemp("imports")
    synth = ("synth", "-q", "--levels", "25,50,75,100", "--repeats", "2", "--noise-nm", "0.01")
    loaded(where, *synth, "-o", "data.h5")
    loaded(where, *synth, "-o", "logs")
    loaded(where, "fit", "-q", "data.h5")
    loaded(where, "tune-rc", "-q", "fit.json")
    return where


@pytest.mark.parametrize(
    ("arguments", "forbidden"),
    [
        (("--help",), {"numpy", "h5py", "scipy"} | TABLES | DRAWING | MACHINE),
        (("fit", "--help"), {"numpy", "h5py", "scipy"} | TABLES | DRAWING | MACHINE),
        (("ingest", "-q", "data.h5", "-o", "again.h5"), DRAWING | MACHINE),
        (("fit", "-q", "data.h5", "-o", "f.json"), TABLES | DRAWING | MACHINE),
        (("fit", "-q", "logs", "-o", "g.json"), {"pandas"} | DRAWING | MACHINE),
        (("tune-rc", "-q", "fit.json", "-o", "k.json"), DRAWING),
        (("simulate", "-q", "fit.json", "--gains", "gains.json"), DRAWING),
        (("plan", "-q", "fit.json", "--want", "Ts=20,tau1=40,tau2=80"), DRAWING | MACHINE),
        (("synth", "-q", "-o", "more.h5", "--levels", "50", "--repeats", "1"), DRAWING),
        (("report", "-q", "fit.json", "-o", "page"), MACHINE),
    ],
    ids=lambda value: " ".join(value[:3]) if isinstance(value, tuple) else "",
)
def test_a_command_imports_only_what_it_uses(folder: Path, arguments: tuple[str, ...], forbidden: set[str]) -> None:
    assert loaded(folder, *arguments) & forbidden == set()


def test_what_is_looked_for_would_be_found(folder: Path) -> None:
    """The names above are those that `sys.modules` has where a command does use them."""
    assert {"numpy", "h5py", "scipy"} <= loaded(folder, "fit", "-q", "data.h5", "-o", "h.json")
    assert loaded(folder, "report", "-q", "fit.json", "-o", "drawn") >= DRAWING
