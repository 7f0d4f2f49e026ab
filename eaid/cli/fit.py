"""`eaid fit`: logs or a dataset → fit.json, what it says in a few lines, and its warnings."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from eaid.cli import console
from eaid.cli.form import Common, argument, takes, written
from eaid.declared import part
from eaid.files import refuse_to_overwrite
from eaid.options import FitOptions, ReadOptions

NOT_TO_BE_USED = 4  # Exit code of a fit whose verdict is that it must not be used; it is written, marked


@dataclass(frozen=True, kw_only=True)
class Arguments(Common, FitOptions, ReadOptions):
    """What `eaid fit` takes."""

    data: list[Path] = argument("DATA…", "A data.h5, log files, or folders of them.")
    output: Path = written("fit.json")


@takes(Arguments)
def command(args: Arguments) -> int:
    """Fit the models of the paper to recorded steps, and say how far they are to be trusted.

    Exit code 4: a model of the fit fails (it did not converge, or explains little); the result is written, marked.

    Example: eaid fit bench/ --levels 20:100 --hold-out 60 -o fit.json
    """
    import msgspec

    from eaid import api
    from eaid.cli.printed import PARTS, show_fit
    from eaid.logs.manifest import files_read
    from eaid.reading import read_steps
    from eaid.results.summary import runs

    refuse_to_overwrite(args.output, args.force, files_read(args.data))
    heard: list[Callable[[], None]] = []  # told once the answer stands there, or the fit has failed
    try:
        stepset = read_steps(
            args.data, part(ReadOptions, args), console.progress,
            lambda sentence: heard.append(partial(console.warn, sentence)),
            lambda sentence: heard.append(partial(console.say, sentence)),
        )[1]  # fmt: skip
        result = api.fit(stepset, part(FitOptions, args), progress=console.progress)
        result = msgspec.structs.replace(result, command=args.typed)
        result.save(args.output, args.force)
        if args.json:
            console.print_json(result)
        else:
            show_fit(result, args.output, args.verbose)
    finally:
        for tell in heard:
            tell()
    console.tell(result.findings, args.verbose)
    parts = ", ".join(name for name in PARTS if getattr(result, name)) or "no model"
    console.say(f"{args.output}: {parts} of {runs(result, f'{result.data.kind} run')}")
    if result.verdict.usable:
        return 0
    console.fail(f"{args.output}: is written and marked; do not use its numbers")
    return NOT_TO_BE_USED
