"""Other processors, where their compilers and emulators are; the sketch in the AVR's own core; MISRA by cppcheck."""

import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

from .conftest import STRICT, closed_loop

pytestmark = pytest.mark.slow
CORE = Path("/usr/share/arduino/hardware/arduino/avr")
STARTS = Path(__file__).parent / "boards"


@dataclass(frozen=True)
class Board:
    """One processor: its compiler, and how a program runs on it."""

    name: str
    compiler: str
    flags: tuple[str, ...]
    run: tuple[str, ...]
    start: str = ""
    """A source of `boards/` that it needs."""

    def program(self, folder: Path) -> list[str]:
        """Compile a folder's check program, without a warning; the command that runs it."""
        for needed in (self.compiler, self.run[0]):
            if not shutil.which(needed):
                pytest.skip(f"no {needed}")
        out, sources = f"check-{self.name}", ["check.c", "eaid_control.c"]
        start = [str(STARTS / self.start)] if self.start else []
        strict = [flag for flag in STRICT if flag not in ("-Werror", "-pedantic")] if start else STRICT
        libraries = [flag for flag in self.flags if flag.startswith("-l")]
        flags = [flag for flag in self.flags if flag not in libraries]
        command = [self.compiler, "-O2", *strict, *flags, "-o", out, *sources, *start, *libraries, "-lm"]
        subprocess.run(command, cwd=folder, check=True)
        return [*self.run, str(folder / out)]


def cortex(name: str, machine: str, *flags: str) -> Board:
    emulator = ("qemu-system-arm", "-M", machine, "-nographic", "-semihosting-config")
    linked = ("-mthumb", "--specs=rdimon.specs", "-Wl,--section-start=.vectors=0")
    run = (*emulator, "enable=on,target=native,arg=check", "-kernel")
    return Board(name, "arm-none-eabi-gcc", (*flags, *linked), run, "cortex_m.c")


BOARDS = (
    Board("ARMv7", "arm-linux-gnueabihf-gcc", ("-static",), ("qemu-arm",)),
    Board("RISC-V", "riscv64-linux-gnu-gcc", ("-static",), ("qemu-riscv64",)),
    cortex("Cortex-M4F", "mps2-an386", "-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard"),
    cortex("Cortex-M3", "mps2-an385", "-mcpu=cortex-m3"),
    Board(
        "AVR", "avr-gcc", ("-mmcu=atmega1284p", "-Wl,-u,vfprintf", "-lprintf_flt"),
        ("simavr", "-m", "atmega1284p", "-f", "16000000"), "avr.c",
    ),
)  # fmt: skip


@pytest.mark.parametrize("board", BOARDS, ids=lambda board: board.name)
@pytest.mark.parametrize(
    ("law", "precision"), [("rc", "double"), ("rc", "single"), ("inverse", "single"), ("plant", "double")]
)
def test_other_processors_give_the_bits_too(exported, board, law, precision):
    command = board.program(exported("c", precision, (law,)))
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False, timeout=600)
    rows = re.search(rf"{law} +(\d+) rows, +(\d+) to the bit, .*wrong status (\d+)", done.stdout + done.stderr)
    assert rows and int(rows[1]) > 100 and rows[3] == "0"
    if board.name != "AVR" or precision == "single":
        assert rows[2] == rows[1]


@pytest.mark.parametrize("board", BOARDS[:2], ids=lambda board: board.name)
@pytest.mark.parametrize(("law", "precision"), [("rc", "double"), ("inverse", "single")])
def test_the_closed_loop_on_other_processors_has_the_bits_of_the_plain_python(exported, played, board, law, precision):
    run = played("multisine", law)
    lines = "\n".join(f"{reference!r} {rate!r}" for reference, rate in zip(run.reference, run.rate, strict=True))
    command = [*board.program(exported("c", precision)), "log", law, "-"]
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
