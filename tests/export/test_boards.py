"""Other processors, where their compilers and emulators are; the sketch in the AVR's own core; MISRA by cppcheck."""

import importlib.util
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

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
