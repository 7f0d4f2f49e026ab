"""The face of `eaid`: help, version, wrong usage, and what a failure looks like."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from eaid import __version__
from eaid.cli import main
from eaid.errors import DataError, GainsError, UsageError


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(["--version"]) == 0
    assert capsys.readouterr().out == f"eaid {__version__}\n"


@pytest.mark.parametrize("name", [name.replace("_", "-") for name in main.COMMANDS])
def test_every_command_explains_itself(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run([name, "--help"]) == 0
    assert "Usage:" in capsys.readouterr().out


def test_an_unknown_command_is_one_sentence_and_exit_2(capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(["fitt"]) == 2
    told = capsys.readouterr().err
    assert told.startswith("error: No such command 'fitt'") and told.count("\n") == 1


@pytest.mark.parametrize(("fault", "code"), [(UsageError, 2), (DataError, 3), (GainsError, 5)])
def test_each_refusal_is_told_sentence_by_sentence(
    fault: type[UsageError], code: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(**_: object) -> None:
        raise fault("a.csv: no step", "b.csv: no torque")

    monkeypatch.setattr(main, "app", refuse)
    assert main.run([]) == code
    assert capsys.readouterr().err == "error: a.csv: no step\nerror: b.csv: no torque\n"


@pytest.mark.parametrize(
    ("fault", "code", "says"),
    [
        (KeyboardInterrupt(), 130, "interrupted"),
        (OSError(28, "No space left on device", "fit.json"), 2, "fit.json: No space left on device"),
        (ZeroDivisionError("x"), 1, "a bug of eaid (ZeroDivisionError: x)"),
    ],
)
def test_no_failure_shows_a_traceback(
    fault: BaseException, code: int, says: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(**_: object) -> None:
        raise fault

    monkeypatch.setattr(main, "app", fail)
    monkeypatch.delenv("EAID_DEBUG", raising=False)
    assert main.run([]) == code
    assert says in capsys.readouterr().err


HEAVY = {"numpy", "scipy", "pandas", "h5py", "matplotlib", "numba", "jinja2", "plotly", "polars", "pyarrow"}


@pytest.mark.parametrize("name", ["", *(name.replace("_", "-") for name in main.COMMANDS)])
def test_help_imports_nothing_heavy(name: str) -> None:
    script = (
        "import sys; from eaid.cli.main import run; "
        f"run({[name, '--help'] if name else ['--help']!r}); "
        "print('LOADED', *sorted({m.split('.')[0] for m in sys.modules}))"
    )
    out = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    loaded = set(out.splitlines()[-1].split()[1:])
    assert "typer" in loaded
    assert loaded & HEAVY == set()


@pytest.mark.parametrize("after_s", [0.15, 0.3, 0.45])
def test_ctrl_c_is_answered_from_the_start(tmp_path: Path, after_s: float) -> None:
    """While things are imported too, where a library may make another failure of it."""
    process = subprocess.Popen(
        [sys.executable, "-m", "eaid", "synth", "-o", str(tmp_path / "d.h5")], stderr=subprocess.PIPE, text=True
    )
    time.sleep(after_s)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    if process.returncode == 0:
        assert (tmp_path / "d.h5").exists()  # a quick machine was done already
        return
    assert (process.returncode, said) == (130, "error: interrupted; nothing half-written is left\n")
    assert not (tmp_path / "d.h5").exists()


def test_a_library_that_turns_ctrl_c_into_its_own_failure(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(**_: object) -> int:
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raise ImportError("initialization failed") from None
        return 0

    monkeypatch.setattr(main, "app", interrupted)
    assert main.run([]) == 130
    assert capsys.readouterr().err == "error: interrupted; nothing half-written is left\n"
