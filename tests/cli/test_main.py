"""The face of `eaid`: help, version, wrong usage, and what a failure looks like."""

import os
import random
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


INTERRUPTED = "error: interrupted; nothing half-written is left\n"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_at_any_moment(tmp_path: Path, number: int) -> None:
    """While Python starts and finds the package, the words are Python's own; from the command line on they are ours."""
    call = [sys.executable, "-m", "eaid", "synth", "--levels", "50", "--repeats", "1", "-q", "--force", "-o"]
    start = time.monotonic()
    assert subprocess.run([*call, str(tmp_path / "whole.h5")], check=False).returncode == 0
    took = time.monotonic() - start
    chance = random.Random(int(number))
    answered = 0
    for _ in range(8):
        output = tmp_path / "d.h5"
        output.unlink(missing_ok=True)
        process = subprocess.Popen([*call, str(output)], stderr=subprocess.PIPE, text=True)
        time.sleep(chance.uniform(0.02, 0.8 * took))
        process.send_signal(number)
        _, said = process.communicate(timeout=60)
        of_python = process.returncode in (1, -number) and "eaid/cli/main" not in said
        # where Ctrl-C broke off a text inside exec(), CPython ends itself with the signal: a shell shows 130 as well
        told = (130 if process.returncode == -signal.SIGINT else process.returncode, said)
        assert told in ((130, INTERRUPTED), (0, "")) or of_python, said
        answered += said == INTERRUPTED
        if process.returncode == 0:
            assert output.read_bytes() == (tmp_path / "whole.h5").read_bytes()
        assert [item.name for item in tmp_path.iterdir() if item.name.startswith(".")] == []
    assert answered


def test_nohup_is_kept(tmp_path: Path) -> None:
    script = "trap '' HUP; exec " + f"{sys.executable} -m eaid synth --levels 50 --repeats 1 -q -o {tmp_path / 'd.h5'}"
    process = subprocess.Popen(["sh", "-c", script], stderr=subprocess.PIPE, text=True)
    for _ in range(20):
        time.sleep(0.02)
        process.send_signal(signal.SIGHUP)
    _, said = process.communicate(timeout=60)
    assert (process.returncode, said) == (0, "")


@pytest.mark.parametrize("command", ["--help", "synth --json --levels 50 --repeats 1 --force -o {o}", "plan --help"])
def test_a_reader_that_goes_away_is_no_failure(tmp_path: Path, command: str) -> None:
    """`eaid … | head -c 1`, on stdout and on stderr: nothing is said, and the work is done."""
    given = command.format(o=tmp_path / "d.h5").split()
    for stream in ("stdout", "stderr"):
        (tmp_path / "d.h5").unlink(missing_ok=True)
        read, write = os.pipe()
        os.close(read)
        other = {"stdout": "stderr", "stderr": "stdout"}[stream]
        done = subprocess.run(
            [sys.executable, "-m", "eaid", *given], text=True, check=False, **{stream: write, other: subprocess.PIPE}
        )
        os.close(write)
        assert done.returncode == 0
        assert "Broken" not in (done.stderr or "") + (done.stdout or "")
        assert ("synth" in given) == (tmp_path / "d.h5").exists()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_a_full_disk_behind_stdout_is_told(tmp_path: Path) -> None:
    call = [sys.executable, "-m", "eaid", "synth", "--json", "-q", "--levels", "50", "-o", str(tmp_path / "d.h5")]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(call, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    said = "error: what is printed cannot be written (No space left on device); make room, or send it elsewhere\n"
    assert (done.returncode, done.stderr) == (2, said)


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


def test_a_command_that_is_mistyped_is_told_the_one_meant(capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(["simulat"]) == 2
    assert "simulate" in capsys.readouterr().err


def test_bare_eaid_prints_help_and_is_no_failure(capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run([]) == 0
    listed = capsys.readouterr().out
    assert all(name.replace("_", "-") in listed for name in main.COMMANDS)


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_is_there(shell: str) -> None:
    wanted = {**os.environ, "_EAID_COMPLETE": f"complete_{shell}", "COMP_WORDS": "eaid tu", "COMP_CWORD": "1"}
    wanted |= {"_TYPER_COMPLETE_ARGS": "eaid tu", "_TYPER_COMPLETE_FISH_ACTION": "get-args"}
    done = subprocess.run([sys.executable, "-m", "eaid"], env=wanted, capture_output=True, text=True, check=False)
    assert "tune-rc" in done.stdout


def test_streams_that_know_few_letters_or_are_closed(tmp_path: Path) -> None:
    script = "exec {python} -m eaid synth --levels 50 --repeats 1 --force -o {output} {redirect}"
    for encoding in ("ascii", "cp1252", "latin-1"):
        said = subprocess.run(
            [sys.executable, "-m", "eaid", "--help"],
            env={**os.environ, "PYTHONIOENCODING": encoding, "PYTHONUTF8": "0"}, capture_output=True, check=False,
        )  # fmt: skip
        assert said.returncode == 0
        assert b"fit.json" in said.stdout
    for redirect in (">&-", "2>&-", ">&- 2>&-"):
        words = script.format(python=sys.executable, output=tmp_path / "d.h5", redirect=redirect)
        assert subprocess.run(["sh", "-c", words], capture_output=True, check=False).returncode == 0
        assert (tmp_path / "d.h5").exists()


def test_an_interrupt_inside_a_destructor_is_not_lost(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Dying:
        def __del__(self) -> None:
            signal.raise_signal(signal.SIGINT)
            time.sleep(0)

    def command(**_: object) -> int:
        Dying()
        for _ in range(100):
            time.sleep(0.05)
        return 0

    monkeypatch.setattr(main, "app", command)
    assert main.run([]) == 130
    assert capsys.readouterr().err == INTERRUPTED


@pytest.mark.parametrize("words", [["fit", ""], ["ingest", ""], ["report", "fit.json", "-o", ""]])
def test_an_empty_word_is_not_the_current_folder(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(words) == 2
    assert "an empty word stands among the arguments" in capsys.readouterr().err


@pytest.mark.parametrize("name", [name.replace("_", "-") for name in main.COMMANDS])
def test_no_example_is_read_as_an_emoji(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """In Markdown 20:100:20 is 20, a hundred-points sign, and 20."""
    main.run([name, "--help"])
    assert max(map(ord, capsys.readouterr().out)) < 0x1F000
