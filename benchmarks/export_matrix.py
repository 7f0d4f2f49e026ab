"""Exports on every processor that compilers and emulators here can show: target × law × precision.

Each law is exported alone, compiled strictly, and its check program run: on this machine, under qemu (armhf, riscv64,
Cortex-M) and simavr (AVR). Instructions a step are counted between two marks in qemu's trace, cycles by the AVR's own
timer. The table goes into docs/export.md; what is not installed is left out, with a word.
"""

import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from eaid.export.options import ExportOptions

from benchmarks.table import Row, machine
from eaid.control.gains import paper_gains
from eaid.export.export import export
from eaid.models.parameters import PAPER_LINEAR, REFERENCE_PLANT
from eaid.replay import references
from eaid.replay.controllers import Knowledge, controller
from eaid.replay.loop import reference_rate, replay
from eaid.replay.plant import plant_parameters
from eaid.replay.rehab import rehabilitate
from eaid.replay.rig import Rig
from eaid.results.codec import from_plain
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.replay import Exercise

PAGE = Path(__file__).parent.parent / "docs" / "export.md"
BOARDS = Path(__file__).parent / "boards"
STRICT = ["-O2", "-std=c99", "-ffp-contract=off", "-Wall", "-Wextra", "-Wconversion", "-pedantic"]
PLANT = replace(REFERENCE_PLANT, release=(0.3, 5.0))
RC, PI = paper_gains()
FIT = from_plain(
    {
        "nonlinear": {**{name: list(getattr(PLANT, name)) for name in ("tau1", "tau2", "Ts", "u_range")}, "C": PLANT.C},
        "release": {"tau1": 0.3, "tau2": 5.0},
    },
    Fit,
    "the reference plant",
)
GAINS = from_plain(
    {
        "model": {"a0": RC.a0, "b0": RC.b0, "c0": RC.c0},
        "rc": {
            "K_P": RC.K_P, "K_D": RC.K_D, "B_hat": RC.B_hat, "epsilon": RC.epsilon, "gamma": RC.gamma,
            "rho": {"constant": RC.rho_constant, "slope": RC.rho_slope}, "Q": [[1.0, RC.Q12], [RC.Q12, RC.Q22]],
        },
        "pi": {"K_P": PI.K_P, "K_I": PI.K_I},
    },
    Gains,
    "the paper's gains",
)  # fmt: skip
LAWS = ("pi", "rc", "inverse", "plant")
GIVEN = {"pi": (GAINS, None), "rc": (GAINS, None), "inverse": (None, FIT), "plant": (None, FIT)}
DT = 1e-3
COUNTED = 120
"""Steps counted of each law."""


@dataclass(frozen=True)
class Board:
    """One processor: its compiler, and how a program runs on it."""

    name: str
    compiler: str
    flags: tuple[str, ...] = ()
    run: tuple[str, ...] = ()
    trace: tuple[str, ...] = ()
    """As `run`, with every instruction written to the file `{log}`."""
    start: str = ""
    """A source of `boards/` that it needs."""
    size: str = "size"
    nm: str = "nm"


_TRACED = ("-singlestep", "-d", "exec,nochain", "-D", "{log}")
_M = ("-nographic", "-semihosting-config", "enable=on,target=native,arg=check")
_ARM = ("-mthumb", "--specs=rdimon.specs", "-Wl,--section-start=.vectors=0")
_ARM_TOOLS = {"size": "arm-none-eabi-size", "nm": "arm-none-eabi-nm"}


def _cortex(name: str, machine: str, *flags: str) -> Board:
    run = ("qemu-system-arm", "-M", machine, *_M)
    traced = (*run, *_TRACED, "-kernel")
    return Board(name, "arm-none-eabi-gcc", (*flags, *_ARM), (*run, "-kernel"), traced, "cortex_m.c", **_ARM_TOOLS)


BOARDS_HERE = (
    Board("x86-64, gcc", "gcc", ("-static",), (), ("qemu-x86_64", *_TRACED)),
    Board("x86-64, clang", "clang", ("-static",), (), ("qemu-x86_64", *_TRACED)),
    Board("ARMv7 hard float", "arm-linux-gnueabihf-gcc", ("-static",), ("qemu-arm",), ("qemu-arm", *_TRACED)),
    Board("RISC-V 64", "riscv64-linux-gnu-gcc", ("-static",), ("qemu-riscv64",), ("qemu-riscv64", *_TRACED)),
    _cortex("Cortex-M4F", "mps2-an386", "-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard"),
    _cortex("Cortex-M3", "mps2-an385", "-mcpu=cortex-m3"),
    Board(
        "AVR ATmega1284P", "avr-gcc", ("-mmcu=atmega1284p", "-Wl,-u,vfprintf", "-lprintf_flt"),
        ("simavr", "-m", "atmega1284p", "-f", "16000000"), (), "avr.c", "avr-size", "avr-nm",
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Cell:
    """One law in one precision on one board: its check, bytes of code and state, and what a step takes."""

    check: "Checked"
    code: int
    state: int
    mean: float
    most: int


def rows() -> list[Row]:
    """Run the matrix and put it into docs/export.md; no row of times comes of it."""
    text = PAGE.read_text(encoding="utf-8")
    head, rest = text.split("<!-- matrix -->", 1)
    made = "\n".join([*_matrix(), "", *_scenarios(), "", *_checks()])
    PAGE.write_text(f"{head}<!-- matrix -->\n{made}\n<!-- end -->{rest.split('<!-- end -->', 1)[1]}", encoding="utf-8")
    return []


def _matrix() -> Iterator[str]:
    yield f"The paper's gains and the reference plant at 1 kHz, each law alone, `-O2`, on {machine()} and emulators."
    yield "Largest difference from the plain Python in % duty (plant: N·m); code with constants, and state, in bytes;"
    yield "instructions a step, on the AVR cycles (1 ms is 16,000 at 16 MHz), over the first 120 rows. Warnings: 0"
    yield "under the flags above, where none are told. On the AVR `double` is 32 bits."
    yield ""
    for precision in ("double", "single"):
        yield f"| {precision} | law | rows to the bit | largest difference | code | state | a step, mean | most |"
        yield "|---|---|--:|--:|--:|--:|--:|--:|"
        for board in BOARDS_HERE:
            if not there(board):
                yield f"| {board.name} | not installed here | | | | | | |"
                continue
            for law in LAWS:
                cell = measured(board, law, precision)
                check = cell.check
                told = "" if check.ok and not check.warnings else f" **fails, {check.warnings} warnings**"
                yield (
                    f"| {board.name} | {law}{told} | {check.exact} of {check.rows} | {check.worst:.2g} | {cell.code:,} "
                    f"| {cell.state} | {cell.mean:,.0f} | {cell.most:,} |"
                )
        yield ""


@dataclass(frozen=True)
class Checked:
    """What the check program of one law said."""

    rows: int
    exact: int
    worst: float
    ok: bool
    warnings: int


def there(board: Board) -> bool:
    """Whether this machine can compile for a board and run it."""
    return bool(shutil.which(board.compiler) and (not board.run or shutil.which(board.run[0])))


def checked(board: Board, law: str, precision: str, folder: Path) -> Checked:
    """Export one law into a new folder, compile its check program strictly, run it."""
    gains, plant = GIVEN[law]
    export(gains, plant, ExportOptions(laws=(law,), precision=precision, folder=folder))
    for source in BOARDS.glob("*.c"):
        shutil.copy(source, folder)
    warnings = _compiled(board, folder, "check", ["check.c", "eaid_control.c", *_start(board)])
    said = _out([*board.run, str(folder / "check")])
    found = re.search(rf"{law} +(\d+) rows, +(\d+) to the bit, largest difference (\S+), wrong status (\d+)", said)
    assert found, (board.name, law, said[:400])
    rows, exact, worst, wrong = found.groups()
    scale = {"plant": 5.0}.get(law, 100.0)
    bound = (1e-12 if precision == "double" and "AVR" not in board.name else 1e-4) * scale
    return Checked(int(rows), int(exact), float(worst), float(worst) <= bound and int(wrong) == 0, warnings)


def _start(board: Board) -> list[str]:
    return [board.start] if board.start else []


def measured(board: Board, law: str, precision: str) -> Cell:
    """Compile, run and count."""
    with tempfile.TemporaryDirectory() as work:
        folder = Path(work) / "x"
        check = checked(board, law, precision, folder)
        state = {"inverse": "eaid_inverse_state", "plant": "eaid_plant_state"}.get(law, "eaid_integral_state")
        defines = [f"-DLAW={law}", f"-DSTATE={state}", f"-DROWS={COUNTED}", *(["-DPLANT"] if law == "plant" else [])]
        _compiled(board, folder, "steps", ["steps.c", "eaid_control.c", *_start(board), *defines])
        mean, most = _counted(board, folder)
        subprocess.run(
            [board.compiler, *STRICT, *(flag for flag in board.flags if flag.startswith("-m")), "-c", "eaid_control.c"],
            cwd=folder, check=True, capture_output=True,
        )  # fmt: skip
        code = int(_out([board.size, str(folder / "eaid_control.o")]).splitlines()[1].split()[0])
        symbols = _out([board.nm, "-S", str(folder / "steps")])
        size = int(next(line.split()[1] for line in symbols.splitlines() if line.endswith("eaid_kept")), 16)
    return Cell(check, code, size, mean, most)


def _compiled(board: Board, folder: Path, out: str, sources: list[str]) -> int:
    """Compile, and count the warnings."""
    own = [name for name in sources if name.endswith(".c")]
    libraries = ["-lm", *(flag for flag in board.flags if flag.startswith("-l"))]
    flags = [flag for flag in board.flags if not flag.startswith("-l")]
    command = [board.compiler, *STRICT, *flags, *(s for s in sources if s not in own), "-o", out, *own, *libraries]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return sum("warning:" in line and "boards" not in line for line in done.stderr.splitlines())


def _counted(board: Board, folder: Path) -> tuple[float, int]:
    """Instructions between two marks; cycles where the board counts its own."""
    if not board.trace:
        _, mean, most = re.search(r"(cycles) (\d+) (\d+)", _out([*board.run, str(folder / "steps")])).groups()  # type: ignore[union-attr]
        return float(mean), int(most)
    log = folder / "trace"
    subprocess.run(
        [*(part.replace("{log}", str(log)) for part in board.trace), str(folder / "steps")],
        check=True, capture_output=True, timeout=600,
    )  # fmt: skip
    gaps, since = [], -1
    with log.open(encoding="utf-8", errors="replace") as lines:
        for line in lines:
            if line.endswith("eaid_mark\n"):
                gaps.append(since)
                since = 0
            elif since >= 0 and line.startswith("Trace"):
                since += 1
    log.unlink()
    steps = gaps[1::2]  # the first gap ends at the first mark; then a step, the loop, a step, …
    assert len(steps) == COUNTED
    return float(np.mean(steps)), max(steps)


def _out(command: list[str]) -> str:
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False, timeout=600)
    return re.sub(r"\x1b\[[0-9;]*m", "", done.stdout + done.stderr)


def _scenarios() -> Iterator[str]:
    """Largest difference of the torque between the exported C, plant and controller together, and the replay."""
    known = Knowledge(PLANT, PAPER_LINEAR, RC, PI)
    yield "Plant and controller in one C program against the replay of `eaid simulate`: largest difference of the"
    yield "torque [N·m], in double and in single precision."
    yield ""
    yield "| scenario | pi | rc | inverse |"
    yield "|---|--:|--:|--:|"
    with tempfile.TemporaryDirectory() as work:
        programs = {}
        for precision in ("double", "single"):
            for law in ("pi", "rc", "inverse"):
                folder = Path(work) / f"{law}_{precision}"
                gains = GIVEN[law][0]
                export(gains, FIT, ExportOptions(laws=(law, "plant"), precision=precision, folder=folder))
                _compiled(BOARDS_HERE[0], folder, "check", ["check.c", "eaid_control.c"])
                programs[law, precision] = folder / "check"
        for name in ("steps", "multisine", "sweep", "rehab"):
            cells = []
            for law in ("pi", "rc", "inverse"):
                torque, lines = _played(name, law, known)
                worst = []
                for precision in ("double", "single"):
                    command = [str(programs[law, precision]), "log", law, "-"]
                    done = subprocess.run(command, input=lines, capture_output=True, text=True, check=True)
                    found = np.array([float(line.split(",")[2]) for line in done.stdout.splitlines()[1:]])
                    worst.append(f"{np.abs(found - torque).max():.1g}")
                cells.append(", ".join(worst))
            yield f"| {name} | {' | '.join(cells)} |"


def _played(name: str, law: str, known: Knowledge) -> tuple[np.ndarray, str]:
    chosen = controller(law, known)
    if name == "rehab":
        done = rehabilitate(plant_parameters(PLANT), chosen, Exercise(), Rig(), DT).replay
        rate = np.diff(done.reference_nm, prepend=0.0) / DT
    else:
        wanted = {"steps": references.steps, "multisine": references.multisine, "sweep": references.sweep}[name](DT)
        done = replay(plant_parameters(PLANT), chosen, wanted.torque_nm, Rig(), DT)
        rate = reference_rate(done.reference_nm, DT, chosen.looks_ahead)
    pairs = zip(done.reference_nm.tolist(), rate.tolist(), strict=True)
    return done.torque_nm, "\n".join(f"{reference!r} {slope!r}" for reference, slope in pairs)


def _checks() -> Iterator[str]:
    """cppcheck with its MISRA addon, valgrind, Octave, the AVR's core with the sketch."""
    with tempfile.TemporaryDirectory() as work:
        for target in ("c", "matlab"):
            laws = ("rc", "inverse", "plant")
            export(GAINS, FIT, ExportOptions(target=target, laws=laws, folder=Path(work) / target))
        c = Path(work) / "c"
        if shutil.which("cppcheck"):
            command = ["cppcheck", "--enable=all", "--inconclusive", "--std=c99", "--addon=misra", "eaid_control.c"]
            quiet = ["--suppress=missingIncludeSystem", "--suppress=unusedFunction"]
            done = subprocess.run([*command, *quiet], cwd=c, capture_output=True, text=True, check=False)
            told = re.findall(r"\[([\w.-]+)\]$", done.stderr, re.MULTILINE)
            others = [rule for rule in told if rule != "misra-c2012-8.7"]
            own = told.count("misra-c2012-8.7")
            beside = f"rule 8.7 (advisory), {own} names that only the caller uses"
            yield f"- cppcheck with its MISRA addon: {len(others)} findings beside {beside}."
        if shutil.which("valgrind"):
            _compiled(replace(BOARDS_HERE[0], flags=("-g",)), c, "check", ["check.c", "eaid_control.c"])
            command = ["valgrind", "-q", "--error-exitcode=9", "./check"]
            done = subprocess.run(command, cwd=c, capture_output=True, check=False)
            yield f"- valgrind: {'nothing found' if done.returncode == 0 else 'ERRORS'}."
        if shutil.which("octave"):
            command = ["octave", "--no-gui", "-q", "--norc", "--eval", "check();"]
            done = subprocess.run(command, cwd=Path(work) / "matlab", capture_output=True, text=True, check=False)
            yield f"- Octave: {done.stdout.strip()}."


if __name__ == "__main__":
    rows()
