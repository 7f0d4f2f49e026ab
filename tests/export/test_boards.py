"""Other processors, where their compilers and emulators are; MISRA by cppcheck."""

import re
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from .conftest import STRICT, logged, ran

pytestmark = pytest.mark.slow
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
        start = [STARTS / self.start] if self.start else []
        strict = [flag for flag in STRICT if flag not in ("-Werror", "-pedantic")] if start else STRICT
        libraries = [flag for flag in self.flags if flag.startswith("-l")]
        flags = [*strict, *(flag for flag in self.flags if flag not in libraries)]
        out, sources = f"check-{self.name}", ["check.c", "eaid_control.c", *start]
        done = ran(self.compiler, "-O2", *flags, "-o", out, *sources, *libraries, "-lm", cwd=folder)
        assert done.returncode == 0, done.stderr
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
    folder = exported("c", precision, (law,))
    done = ran(*board.program(folder), cwd=folder, errors="replace", timeout=600)
    rows = re.search(rf"{law} +(\d+) rows, +(\d+) to the bit, .*wrong status (\d+)", done.stdout + done.stderr)
    assert rows and int(rows[1]) > 100 and rows[3] == "0"
    if board.name != "AVR" or precision == "single":
        assert rows[2] == rows[1]


@pytest.mark.parametrize("board", BOARDS[:2], ids=lambda board: board.name)
@pytest.mark.parametrize(("law", "precision"), [("rc", "double"), ("inverse", "single")])
def test_the_closed_loop_on_other_processors_has_the_bits_of_the_plain_python(
    exported, laws, played, board, law, precision
):
    run = played("multisine", law)
    found = logged(board.program(exported("c", precision)), run)[:, 1:3]
    assert np.array_equal(found, np.array(list(laws(precision).closed_loop(run)), dtype=float))


@pytest.mark.skipif(not shutil.which("cppcheck"), reason="no cppcheck")
@pytest.mark.parametrize("precision", ["double", "single"])
def test_misra_finds_nothing_but_names_for_the_caller(exported, precision):
    command = "cppcheck --enable=all --inconclusive --std=c99 --addon=misra --suppress=missingIncludeSystem"
    done = ran(*command.split(), "--suppress=unusedFunction", "eaid_control.c", cwd=exported("c", precision))
    assert set(re.findall(r"\[([\w.-]+)\]$", done.stderr, re.MULTILINE)) <= {"misra-c2012-8.7"}
