"""What a user sees on a terminal: every line within its width, broken between words only, numbers to the right."""

import json
import os
import re
import struct
import subprocess
import sys
from pathlib import Path

import pytest

pty = pytest.importorskip("pty")
fcntl, termios = pytest.importorskip("fcntl"), pytest.importorskip("termios")

COMMANDS = [
    ["ingest", "logs", "-o", "data.h5", "--force"],
    ["fit", "data.h5", "--force"],
    ["fit", "data.h5", "--force", "--tables"],
    ["tune-rc", "fit.json", "--force", "-v"],
    ["simulate", "fit.json", "--gains", "gains.json", "--scenario", "steps", "--duration", "8", "--force"],
    ["plan", "fit.json", "--no-check", "--force"],
    ["couple", "fit.json", "--gains", "gains.json", "--torque", "1", "--no-replay", "--force"],
]
SCRIPT = """
import json, sys
from eaid.cli.main import run
for words in json.loads(sys.argv[1]):
    print("$", *words, flush=True)
    run(words)
"""


def told(where: Path, commands: list[list[str]], width: int, **environment: str) -> str:
    """What stands on a terminal of this width, both streams together."""
    pid, end = pty.fork()
    if pid == 0:
        os.chdir(where)
        os.environ.update({"TERM": "xterm-256color", **environment})
        os.environ.pop("COLUMNS", None)
        fcntl.ioctl(1, termios.TIOCSWINSZ, struct.pack("HHHH", 50, width, 0, 0))
        os.execv(sys.executable, [sys.executable, "-c", SCRIPT, json.dumps(commands)])
    seen = b""
    while True:
        try:
            part = os.read(end, 1 << 16)
        except OSError:  # the other end is closed
            break
        if not part:
            break
        seen += part
    os.waitpid(pid, 0)
    os.close(end)
    return seen.decode().replace("\r\n", "\n")


def plain(text: str) -> str:
    """Without colours, and without the bars of progress, which are drawn over one line."""
    lines = [line.split("\r")[-1] for line in re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", text).split("\n")]
    return "\n".join(line for line in lines if "━" not in line)


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of thirty logs, gains and a fit."""
    where = tmp_path_factory.mktemp("terminal")
    made = ["--repeats", "3", "--rate-hz", "50", "--idle", "1", "--hold", "8", "--release", "3", "-q"]
    ingest = ["ingest", "logs", "-o", "data.h5", "-q"]
    for words in (["synth", *made, "-o", "logs"], ingest, ["fit", "logs", "-q"], ["tune-rc", "fit.json", "-q"]):
        subprocess.run([sys.executable, "-m", "eaid", *words], cwd=where, check=True)
    return where


@pytest.fixture(scope="module")
def piped(rig: Path) -> set[str]:
    """Words of the same commands where no terminal wraps them."""
    call = [sys.executable, "-c", SCRIPT, json.dumps(COMMANDS)]
    done = subprocess.run(call, cwd=rig, capture_output=True, text=True, check=False)
    return set(f"{done.stdout} {done.stderr}".split())


@pytest.mark.parametrize("width", [80, 120])
def test_nothing_is_wider_than_the_terminal_or_broken_within_a_word(rig: Path, piped: set[str], width: int) -> None:
    shown = plain(told(rig, COMMANDS, width))
    assert "bug of eaid" not in shown
    lines = shown.splitlines()
    assert [line for line in lines if len(line) > width + line.count("\u0302")] == []
    assert {word for word in shown.split() if word not in piped} == set()


def test_thirty_logs_are_told_in_sixty_lines(rig: Path) -> None:
    shown = plain(told(rig, [["ingest", "logs", "-o", "d.h5"], ["fit", "d.h5", "-o", "f.json"]], 80)).split("$ fit")
    assert len(shown) == 2
    for part in shown:
        assert len(part.splitlines()) <= 60
    assert "next: eaid" in shown[0].splitlines()[-1]


REAL = Path(__file__).parents[3] / "shared" / "realdata"
SHIPPED = Path(__file__).parents[2] / "datasets" / "clutch.h5"
EA = ["--columns", 'time=Time,output="Load Cell"', "--units", "time=us,output=N", "--name-pattern", "_V={level}_",
      "--step-at", "2", "--until", "5", "--repair"]  # fmt: skip


@pytest.mark.parametrize(
    ("data", "options", "worst", "after"),
    [
        (SHIPPED, [], ["repeats-disagree", "linear-output-negative"], "tune-rc"),
        (REAL / "ea-clutch", EA, ["output-decays-under-hold"], "tune-rc"),
        (REAL / "friction-steps", [], ["repeats-disagree", "output-is-no-torque", "runs-reject-the-share"], "report"),
    ],
    ids=["clutch", "ea", "seals"],
)
def test_eight_lines_answer_first(data: Path, options: list[str], worst: list[str], after: str, tmp_path: Path) -> None:
    """Fit %, T_s, τ1, τ2 with intervals at three levels, which estimate, the doubts, the next command."""
    if not data.exists():
        pytest.skip("the recorded logs are not there")
    shown = plain(told(tmp_path, [["fit", str(data), *options, "-o", "fit.json"]], 80)).splitlines()[1:]
    first = shown[:8]
    labels = [line.split()[0] for line in first]
    fit, heading = first[0], first[1]
    assert labels[0] == "fit" and "%" in fit
    assert all(symbol in heading for symbol in (" [", "τ1 [s]", "τ2 [s]")) and ("T_s" in heading or "change" in heading)
    assert sum(" (" in line and " … " in line for line in first[2:5]) == 3
    assert len({"taken", "shown"} & set(labels)) == (after == "tune-rc")  # friction has one estimate
    (doubts,) = [line for line in first if line.startswith("doubts ")]
    assert all(code.replace("-", " ") in doubts for code in worst)
    answer = first[: first.index(f"next   eaid {after} fit.json")]
    assert all(len(line) <= 80 for line in shown)
    assert not any(line.startswith(("warning", "note", "columns of")) for line in answer)
    assert sum(line.startswith("warning:") for line in shown[6:]) >= len(worst)


def test_a_bar_moves_and_says_what_is_left(rig: Path) -> None:
    shown = told(rig, [["ingest", "logs", "-o", "e.h5"]], 80)
    counts = re.findall(r"(\d+)/30", re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown))
    assert counts and int(counts[-1]) == 30 and len(set(counts)) > 1


def test_colour_marks_severity_unless_it_is_not_wanted(rig: Path) -> None:
    call = [["fit", "data.h5", "-o", "g.json", "--force"]]
    assert "\x1b[33mwarning:\x1b[0m" in told(rig, call, 80)
    assert "warning:" in (bare := told(rig, call, 80, NO_COLOR="1")) and "\x1b[33m" not in bare
