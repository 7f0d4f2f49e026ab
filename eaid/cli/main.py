"""`eaid`: the table of commands, and what a failure looks like."""

import importlib
import os
import sys
from typing import Annotated

import typer

from eaid import __version__
from eaid.cli import console
from eaid.errors import EaidError

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


for _name, _words in COMMANDS.items():
    _module = importlib.import_module(f"eaid.cli.{_name}")
    app.command(_name.replace("_", "-"), short_help=_words)(_module.command)


def run(arguments: list[str] | None = None) -> int:
    """Run one command and return its exit code; every expected failure is one plain sentence."""
    try:
        code = app(args=arguments, standalone_mode=False)
        if code == 130:  # typer turns Ctrl-C into this code, without a word
            raise KeyboardInterrupt
        return code if isinstance(code, int) else 0
    except EaidError as fault:
        for sentence in fault.sentences:
            console.fail(sentence)
        return fault.exit_code
    except (KeyboardInterrupt, typer.Abort):
        console.fail("interrupted; nothing half-written is left")
        return 130
    except OSError as fault:
        where = f"{fault.filename}: " if fault.filename else ""
        console.fail(f"{where}{fault.strerror or fault}")
        return 2
    except Exception as fault:
        wording = getattr(fault, "format_message", None)  # the usage errors of click, which typer may carry inside
        if wording is not None:
            context = getattr(fault, "ctx", None)
            where = f"; see {context.command_path} --help" if context else ""
            console.fail(f"{wording().rstrip('.')}{where}")
            return int(getattr(fault, "exit_code", 2))
        if os.environ.get("EAID_DEBUG"):
            raise
        console.fail(f"unexpected failure, a bug of eaid ({type(fault).__name__}: {fault}); EAID_DEBUG=1 shows where")
        return 1


def main() -> None:
    """Entry point of the `eaid` script."""
    sys.exit(run())
