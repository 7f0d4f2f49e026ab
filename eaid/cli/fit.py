"""`eaid fit`: logs or a dataset → fit.json, what it says in a few lines, and its warnings."""

import shlex
from pathlib import Path

import eaid
from eaid.cli import console
from eaid.cli.form import Common, argument, refuse_idle, stamped, takes, tell_result, written
from eaid.declared import option
from eaid.errors import on_command_line
from eaid.files import refuse_to_overwrite
from eaid.options import FitOptions, ReadOptions

FOLLOW = "At the rig"
NOT_TO_BE_USED = 4  # Exit code of a fit whose verdict is that it must not be used; it is written, marked


@takes
def command(
    args: Common, how: FitOptions, reading: ReadOptions,
    data: list[Path] = argument("DATA…", "A data.h5, log files, or folders of them."),
    follow: float | None = option(
        None, "Read each new log of the folder as it comes, until Ctrl-C or so many seconds of silence; then fit.",
        FOLLOW, shown="[SECONDS]", kept=False,
    ),
    against: Path | None = option(None, "rig.json that following holds each step against.", FOLLOW, shown="FILE",
                                  kept=False),
    plan: Path | None = option(None, "plan.csv that following tells the next run of.", FOLLOW, shown="FILE",
                               kept=False),
    output: Path = written("fit.json"),
) -> int:  # fmt: skip
    """Fit the models of the paper to recorded steps, and say how far they are to be trusted.

    Exit code 4: a model of the fit fails (it did not converge, or explains little); the result is written, marked.

    Example: eaid fit bench/ --levels 20:100 --hold-out 60 -o fit.json
    """
    from eaid.logs.folders import files_read
    from eaid.reading import read_steps
    from eaid.report.tables.fits import model_tables
    from eaid.results.summary import answer, runs, usable_line, verdict_line

    if follow is None:
        refuse_idle(args, ("against", "plan"), "without --follow")
    else:
        refuse_to_overwrite(output, args.force)
        data = _follow(data, reading, follow, against, plan)
    refuse_to_overwrite(output, args.force, files_read(data))
    stepset = read_steps(data, reading, console.progress, console.warn, console.say)[1]
    result = stamped(eaid.fit(stepset, how, progress=console.progress), args)
    result.save(output, args.force)
    usable = result.verdict.usable
    lines = *verdict_line(result), *answer(result), usable_line(result), f"next   {_next(result, output)}"
    shown = [*map(on_command_line, lines), *(model_tables(result) if args.verbose else ())]
    tell_result(args, result, shown, result.findings)
    models = ("friction", "nonlinear", "linear", "release", "steps")
    parts = ", ".join(name for name in models if getattr(result, name)) or "no model"
    console.say(f"{output}: {parts} of {runs(result, f'{result.data.kind} run')}")
    if usable:
        return 0
    console.fail(f"{output}: is written and marked; do not use its numbers")
    return NOT_TO_BE_USED


def _next(fit: "eaid.Fit", file: Path) -> str:
    """What the gravest warning asks for, then the command that goes on from here."""
    from eaid.findings import advised

    first, refit = advised(fit.findings, fit.command)
    if refit:
        return shlex.join(("eaid", "fit", *fit.command, *refit.split(), "-o", str(file), "--force"))
    if not fit.verdict.usable or fit.linear is None:
        return shlex.join(("eaid", "report", str(file)))
    return f"{first}; as it is: " * bool(first) + shlex.join(("eaid", "tune-rc", str(file)))


def _follow(
    data: list[Path], reading: ReadOptions, silence_s: float, against: Path | None, plan: Path | None
) -> list[Path]:
    """Tell of each new log as it comes, until Ctrl-C or silence; the logs that the fit is to be made of."""
    from eaid.logs.folders import files_of
    from eaid.results import codec
    from eaid.sessions.follow import followed
    from eaid.sessions.rig import Rig

    rig = codec.read(against, Rig)[0] if against is not None else None
    console.say("following; Ctrl-C ends it with the fit")
    unread = set[Path]()
    try:
        for line in followed(data, reading, silence_s, unread, rig, plan):
            console.say(on_command_line(line))
    except KeyboardInterrupt:
        console.say("followed to here; fitting")
    if not unread:
        return data
    console.say(f"left out: {', '.join(sorted(file.name for file in unread))}")
    return [file for file in files_of(data) if file not in unread]
