"""Other processors, where their compilers and emulators are; the sketch in the AVR's own core; MISRA by cppcheck."""

import importlib.util
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from .conftest import closed_loop

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))
spec = importlib.util.spec_from_file_location("export_matrix", ROOT / "benchmarks" / "export_matrix.py")
assert spec and spec.loader
matrix = importlib.util.module_from_spec(spec)
sys.modules["export_matrix"] = matrix
spec.loader.exec_module(matrix)
sys.path.remove(str(ROOT))

CORE = Path("/usr/share/arduino/hardware/arduino/avr")


@pytest.mark.parametrize("board", matrix.BOARDS_HERE[2:], ids=lambda board: board.name)
@pytest.mark.parametrize(
    ("law", "precision"), [("rc", "double"), ("rc", "single"), ("inverse", "single"), ("plant", "double")]
)
def test_other_processors_give_the_bits_too(tmp_path, board, law, precision):
    if not matrix.there(board):
        pytest.skip(f"no {board.compiler}, or nothing that runs what it makes")
    check = matrix.checked(board, law, precision, tmp_path / "x")
    assert check.warnings == 0 and check.ok
    if "AVR" not in board.name or precision == "single":
        assert check.exact == check.rows > 100


@pytest.mark.parametrize("board", matrix.BOARDS_HERE[2:4], ids=lambda board: board.name)
@pytest.mark.parametrize(("law", "precision"), [("rc", "double"), ("inverse", "single")])
def test_the_closed_loop_on_other_processors_has_the_bits_of_the_plain_python(
    exported, played, tmp_path, board, law, precision
):
    if not matrix.there(board):
        pytest.skip(f"no {board.compiler}, or nothing that runs what it makes")
    run = played("multisine", law)
    folder = exported("c", precision)
    out = tmp_path / "check"
    command = [board.compiler, *matrix.STRICT, *board.flags, "-o", str(out), "check.c", "eaid_control.c", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    lines = "\n".join(f"{reference!r} {rate!r}" for reference, rate in zip(run.reference, run.rate, strict=True))
    command = [*board.run, str(out), "log", law, "-"]
    done = subprocess.run(command, input=lines, capture_output=True, text=True, check=True)
    found = [tuple(map(float, line.split(",")[1:3])) for line in done.stdout.splitlines()[1:]]
    assert found == [(float(duty), float(torque)) for duty, torque in closed_loop(run, precision)]


@pytest.mark.skipif(not shutil.which("cppcheck"), reason="no cppcheck")
@pytest.mark.parametrize("precision", ["double", "single"])
def test_misra_finds_nothing_but_names_for_the_caller(exported, precision):
    command = [
        "cppcheck",
        "--enable=all",
        "--inconclusive",
        "--std=c99",
        "--addon=misra",
        "--suppress=missingIncludeSystem",
    ]
    done = subprocess.run(
        [*command, "--suppress=unusedFunction", "eaid_control.c"], cwd=exported("c", precision),
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert set(re.findall(r"\[([\w.-]+)\]$", done.stderr, re.MULTILINE)) <= {"misra-c2012-8.7"}


@pytest.mark.skipif(not (shutil.which("avr-g++") and CORE.is_dir()), reason="no Arduino core for the AVR")
@pytest.mark.parametrize("precision", ["double", "single"])
def test_the_sketch_compiles_in_the_core_of_an_uno(exported, precision):
    folder = exported("arduino", precision, ("rc",))
    (sketch,) = folder.glob("*.ino")
    command = ["avr-g++", "-mmcu=atmega328p", "-DF_CPU=16000000L", "-DARDUINO=10819", "-std=gnu++11", "-Os"]
    paths = [
        f"-I{CORE}/cores/arduino",
        f"-I{CORE}/variants/standard",
        "-I.",
        "-Wall",
        "-Wextra",
        "-fsyntax-only",
        "-x",
        "c++",
        "-",
    ]
    text = f"#include <Arduino.h>\n{sketch.read_text()}"
    done = subprocess.run([*command, *paths], cwd=folder, input=text, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "warning" not in done.stderr, done.stderr
