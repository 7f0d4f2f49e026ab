"""`eaid today`: reference steps of a new session → a fit whose intervals hold for it."""

from pathlib import Path

from eaid.cli import console
from eaid.cli.form import Common, argument, exit_code_of, stamped, takes, tell_result, written
from eaid.errors import on_command_line
from eaid.files import refuse_to_overwrite
from eaid.options import ReadOptions


@takes
def today(
    args: Common, reading: ReadOptions,
    rig: Path = argument("RIG", "rig.json of eaid sessions."),
    steps: list[Path] = argument("STEP…", "Logs of one or two steps from rest, recorded in this session."),
    output: Path = written("today.json"),
) -> int:  # fmt: skip
    """One or two reference steps of today → a fit with intervals that hold for today, by what is known of the rig.

    tune-rc, simulate, couple, export and report take it as any other fit. Logs are read as those of the sessions were.

    Example: eaid today rig.json step_60.csv -o today.json
    """
    from eaid.findings import say
    from eaid.logs.folders import files_read
    from eaid.reading import read_steps
    from eaid.results import codec
    from eaid.results.summary import answer, verdict_line
    from eaid.sessions.rig import Rig
    from eaid.sessions.today import reading_of, today

    known, warnings = codec.read(rig, Rig)
    refuse_to_overwrite(output, args.force, [rig, *files_read(steps)])
    data = read_steps(steps, reading_of(known, reading), console.progress, console.warn, console.say)[1]
    fit = stamped(today(known, data), args)
    fit.save(output, args.force)
    one = next(found for found in fit.findings if found.code == "for-today")
    again = any(found.code == "step-outside" for found in fit.findings)
    after = f"eaid {'tune-rc' if fit.linear is not None and fit.verdict.usable else 'report'} {output}"
    after = f"next    {'the step once more; as it is: ' * again}{after}"
    values = [line for line in answer(fit)[1:] if not line.startswith(("used", "logs"))]
    shown = [*map(on_command_line, verdict_line(fit)), f"today   {say(one)}", *map(on_command_line, values), after]
    tell_result(args, fit, shown, [*warnings, *(found for found in fit.findings if found is not one)])
    console.say(f"{output}: a fit for today")
    return exit_code_of(fit, output)
