"""`eaid`: the table of commands, and what a failure looks like."""

import importlib
import os
import signal
import sys
import threading
import time
from collections.abc import Iterable, Sequence
from typing import Annotated, Any

import typer

from eaid import __version__
from eaid.cli import console
from eaid.cli.plain import PlainCommand, PlainGroup
from eaid.cli.streams import patient_streams
from eaid.errors import EaidError, on_command_line

COMMANDS = {
    "ingest": "Logs → a table of runs with what is doubtful, and data.h5",
    "fit": "Logs or data.h5 → models with intervals and a verdict, fit.json",
    "tune_rc": "fit.json → robust and PI gains, the guarantee checked, gains.json",
    "simulate": "Replay controllers on the fitted plant, replay.h5",
    "report": "Result files → one HTML page and figures",
    "synth": "A plant → synthetic logs",
    "plan": "fit.json → what to record next, plan.csv",
    "reproduce": "The paper, number by number, recomputed",
    "demo": "All of the above on the three shipped datasets",
}
"""One module of `eaid.cli` each, with a function `command`; the order and the short words of `--help`."""

app = typer.Typer(
    name="eaid",
    cls=PlainGroup,
    help="The workbench for electroadhesive clutches: from recorded step responses to models, gains and replays.",
    no_args_is_help=True,
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # its markup eats units in brackets, and its panels cost 60 ms a help page
)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"eaid {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    _show: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    pass


def _add(commands: Iterable[str], to: typer.Typer = app) -> None:
    """Import the modules of some commands, once each, and put them into the app."""
    for name in commands:
        if name not in _added:
            _added.add(name)
            module = importlib.import_module(f"eaid.cli.{name}")
            to.command(name.replace("_", "-"), cls=PlainCommand, short_help=COMMANDS[name])(module.command)
    order = [name.replace("_", "-") for name in COMMANDS]
    to.registered_commands.sort(key=lambda command: order.index(command.name or ""))


_added: set[str] = set()


def _wanted(arguments: Sequence[str]) -> list[str]:
    """The command that is called; all of them where that is not clear, or where they are to be listed."""
    first = next(iter(arguments), "").replace("-", "_")
    return [first] if first in COMMANDS else list(COMMANDS)


INTERRUPTED = "interrupted; nothing half-written is left"
_interrupts: list[float] = []
"""When signals came while a command ran: a library may make another failure of a KeyboardInterrupt."""


def run(arguments: list[str] | None = None) -> int:
    """Run one command and return its exit code; every expected failure is one plain sentence."""
    _interrupts.clear()
    before = _listen(dict.fromkeys(SIGNALS, _on_interrupt))
    unraisable, sys.unraisablehook = sys.unraisablehook, _not_swallowed
    try:
        with patient_streams():
            code, sentences = _outcome(arguments)
            if code and _interrupts:
                code, sentences = 130, (INTERRUPTED,)
            for sentence in sentences:
                console.fail(on_command_line(sentence))
    except EaidError as fault:  # what was printed cannot be stored
        code = fault.exit_code
        console.fail(str(fault))
    finally:
        sys.unraisablehook = unraisable
        if _interrupts and hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0)  # an alarm that is still to come would end the process
        _listen(before)
    return code


SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGALRM") if hasattr(signal, name))
"""Ctrl-C, a polite kill, a terminal that closes; and the alarm by which an interrupt comes again."""


def _listen(handlers: dict[int, Any]) -> dict[int, Any]:
    """Set what signals do, and return what they did; only the main thread of a program may. What nohup set stays."""
    if threading.current_thread() is not threading.main_thread():
        return {}
    held = {number: signal.getsignal(number) for number in handlers}
    wanted = {number: handler for number, handler in handlers.items() if held[number] not in (None, signal.SIG_IGN)}
    for number, handler in wanted.items():
        signal.signal(number, handler)
    return {number: held[number] for number in wanted}


def _on_interrupt(number: int, *_frame: object) -> None:
    """Break off; a second Ctrl-C within a second does not break off the clearing away."""
    now = time.monotonic()
    if _interrupts and now - _interrupts[-1] < 1.0 and number != getattr(signal, "SIGALRM", None):
        return
    _interrupts.append(now)
    raise KeyboardInterrupt


def _not_swallowed(told: Any) -> None:
    """An interrupt that came inside a destructor or a weak reference's callback, where Python drops it, comes again."""
    if not isinstance(told.exc_value, KeyboardInterrupt):
        sys.__unraisablehook__(told)
    elif hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, AGAIN_S)


AGAIN_S = 0.02
"""After which a dropped interrupt comes again, as an alarm [s]."""


def _outcome(arguments: list[str] | None) -> tuple[int, tuple[str, ...]]:
    """Exit code of one command, and the sentences that say why it failed."""
    try:
        _add(_wanted(sys.argv[1:] if arguments is None else arguments))
        code = app(args=arguments, standalone_mode=False)
        if code == 130:  # typer turns Ctrl-C into this code, without a word
            raise KeyboardInterrupt
        return (code if isinstance(code, int) else 0), ()
    except EaidError as fault:
        return fault.exit_code, fault.sentences
    except (KeyboardInterrupt, typer.Abort):
        return 130, (INTERRUPTED,)
    except OSError as fault:
        where = f"{fault.filename}: " if fault.filename else ""
        return 2, (f"{where}{fault.strerror or fault}",)
    except Exception as fault:
        wording = getattr(fault, "format_message", None)  # the usage errors of click, which typer may carry inside
        if wording is not None:
            context = getattr(fault, "ctx", None)
            where = f"; see {context.command_path} --help" if context else ""
            return int(getattr(fault, "exit_code", 2)), (f"{wording().rstrip('.')}{where}",)
        if os.environ.get("EAID_DEBUG"):
            raise
        what = f"{type(fault).__name__}: {fault}"
        return 1, (f"unexpected failure, a bug of eaid ({what}); EAID_DEBUG=1 shows where",)


def main() -> None:
    """Entry point of the `eaid` script."""
    sys.exit(run())
