"""`eaid`: the table of commands, and what a failure looks like."""

import contextlib
import io
import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any, cast

from eaid.cli import console
from eaid.cli.signals import breaking_off
from eaid.errors import EaidError, UsageError, on_command_line, unknown
from eaid.version import __version__

if TYPE_CHECKING:
    from typer.core import TyperCommand

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
"""Matrices are small here, and threads that wait for one another doubled the processor time of `plan`."""


class Patient:
    """A text stream that goes on as if nothing had happened once its pipe is closed at the other end."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        held = getattr(self._stream, name)
        return partial(self._read_or_not, held) if name in ("write", "flush") else held

    def _read_or_not(self, act: Callable[..., Any], *given: str) -> None:
        """Write or flush, or drop what nobody reads."""
        try:
            act(*given)
        except OSError as fault:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self._stream.fileno())
            os.close(nowhere)
            if not isinstance(fault, BrokenPipeError):  # a full disk behind `>`
                sentence = f"what is printed cannot be written ({fault.strerror}); make room, or send it elsewhere"
                raise UsageError(sentence) from None


@contextlib.contextmanager
def patient_streams() -> Iterator[None]:
    """Stdout and stderr that outlive their readers while the block runs; both are flushed at its end.

    A closed one is replaced by one that drops all; letters that the reader's encoding has not become `?`.
    """
    before = sys.stdout, sys.stderr
    for stream in before:
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    sys.stdout, sys.stderr = (Patient(stream) if stream is not None else io.StringIO() for stream in before)
    try:
        yield
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
    finally:
        sys.stdout, sys.stderr = before


# Command → the module of `eaid.cli` that has a function of its name, and the short words of `--help`, in their order
COMMANDS = {
    "ingest": ("models", "Logs → what is in them and warnings, data.h5"),
    "fit": ("models", "Logs or data.h5 → models with intervals and a verdict, fit.json"),
    "tune-rc": ("loops", "fit.json → robust and PI gains, the guarantee checked, gains.json"),
    "simulate": ("loops", "Replay controllers on the fitted plant, replay.h5"),
    "export": ("loops", "gains.json → source for a rig: C, Arduino, MATLAB, FMU, YAML"),
    "report": ("report", "Result files → one HTML page and figures"),
    "synth": ("models", "A plant → synthetic logs"),
    "couple": ("loops", "fit.json and gains.json → how stiff a virtual wall, couple.json"),
    "compare": ("sessions", "fit.json of sessions → what moved, must gains be made anew; or a recorded loop"),
    "sessions": ("sessions", "fit.json of three sessions and more → what the next may be, rig.json"),
    "today": ("sessions", "rig.json and a reference step → a fit that holds today"),
    "plan": ("models", "fit.json → what to record next, plan.csv"),
    "demo": ("demo", "All of the above on the three shipped datasets"),
}


HELP = f"""Usage: eaid COMMAND [OPTIONS] …

The workbench for electroadhesive clutches: from recorded step responses to models, gains and replays.

Commands:
{"".join(f"  {name:<10}{words}{chr(10)}" for name, (_, words) in COMMANDS.items())}
eaid COMMAND --help shows its options; eaid --version the version; eaid --install-completion completes in your shell."""


def function_of(name: str) -> Callable[..., Any]:
    """The function of a command; only its module is imported."""
    module = import_module(f"eaid.cli.{COMMANDS[name][0]}")
    return cast("Callable[..., Any]", getattr(module, name.replace("-", "_")))


def load_command(name: str) -> "TyperCommand":
    """One command with its arguments and options; its name as it is typed, `tune-rc`."""
    import typer

    alone = typer.Typer(add_completion=False, rich_markup_mode="markdown")  # rich's own markup would eat [units]
    alone.command(name, context_settings={"help_option_names": ["-h", "--help"]})(function_of(name))
    return cast("TyperCommand", typer.main.get_command(alone))


COMPLETION = ("--install-completion", "--show-completion")  # Of the shell; Typer's own


def complete(arguments: list[str]) -> None:
    """What Typer does for the shell: install or show its completion, or complete what is typed so far."""
    import typer

    whole = typer.Typer(name="eaid", rich_markup_mode="markdown")
    for name in COMMANDS:
        whole.command(name)(function_of(name))
    typer.main.get_command(whole)(args=arguments, prog_name="eaid", standalone_mode=False)


UNUSABLE = 4  # A result was written, whatever came before: `fit --follow` ends by Ctrl-C
INTERRUPTED = "interrupted; nothing half-written is left"


def run(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code; every expected failure is one plain sentence."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        with console.hushed(False), breaking_off() as interrupted, patient_streams():
            code, sentences = _outcome(given or ["--help"])
            # typer, or a library, may make another failure of a KeyboardInterrupt
            if code not in (0, UNUSABLE) and interrupted:
                code, sentences = 130, (INTERRUPTED,)
            for sentence in sentences if {"-v", "--verbose"} & set(given) else once_each(sentences):
                (console.speak if sentence.startswith("try: ") else console.fail)(on_command_line(sentence))
    except EaidError as fault:  # what was printed cannot be stored
        code = fault.exit_code
        console.fail(str(fault))
    return code


FAULTS_ALIKE = 3  # So many files with the same fault are one sentence and a count


def once_each(sentences: Sequence[str]) -> list[str]:
    """Each cause once: of sentences alike but for numbers, of `FAULTS_ALIKE` files or more, the first and a count."""
    causes: dict[str, list[str]] = {}
    for sentence in sentences:
        causes.setdefault(re.sub(r"\d+(\.\d+)?", "", sentence.partition(": ")[2]), []).append(sentence)
    shown = []
    for alike in causes.values():
        files = {sentence.partition(": ")[0] for sentence in alike}
        shown += alike if len(files) < FAULTS_ALIKE else [f"{alike[0]} ({len(alike) - 1} more alike: --verbose)"]
    return shown


def _outcome(arguments: list[str]) -> tuple[int, tuple[str, ...]]:
    """Exit code of one command, and the sentences that say why it failed."""
    name, *rest = arguments
    for k in [k for k, word in enumerate(rest) if word == "--follow"]:  # its number may be left out
        if not re.fullmatch(r"[\d.]+", "".join(rest[k + 1 : k + 2])):
            rest = [*rest[: k + 1], "0", *rest[k + 1 :]]
    try:
        if "" in arguments:  # pathlib takes it for the current folder
            raise UsageError("an empty word stands among the arguments; give a file or a folder in its place")
        if name in COMPLETION or "_EAID_COMPLETE" in os.environ:
            complete(arguments)
            return 0, ()
        if name in ("-h", "--help", "--version"):
            print(f"eaid {__version__}" if name == "--version" else HELP)
            return 0, ()
        if name not in COMMANDS:
            raise UsageError(f"{unknown('no such command', name, COMMANDS)}; see eaid --help")
        code = load_command(name)(args=rest, prog_name=f"eaid {name}", standalone_mode=False)
        return (code if isinstance(code, int) else 0), ()
    except EaidError as fault:
        return fault.exit_code, fault.sentences
    except KeyboardInterrupt:
        return 130, (INTERRUPTED,)
    except OSError as fault:
        where = f"{fault.filename}: " if fault.filename else ""
        return 2, (f"{where}{fault.strerror or fault}",)
    except Exception as fault:
        if hasattr(fault, "format_message"):  # wrong usage, as click tells it
            sentence = str(fault.format_message()).rstrip(".").replace("\n", " ")
            context = getattr(fault, "ctx", None)
            return 2, (sentence + (f"; see {context.command_path} --help" if context else ""),)
        if os.environ.get("EAID_DEBUG"):
            raise
        what = f"{type(fault).__name__}: {fault}"
        return 1, (f"unexpected failure, a bug of eaid ({what}); EAID_DEBUG=1 shows where",)
