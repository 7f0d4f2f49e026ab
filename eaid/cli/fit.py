"""`eaid fit`: logs or a dataset → fit.json, what it says in a few lines, and what is to be doubted of it."""

from dataclasses import dataclass
from pathlib import Path

from eaid.cli import console
from eaid.cli.form import OUTPUT, Common, Seeded, Verbose, argument, option, taken, takes, written
from eaid.cli.inputs import Reading
from eaid.cli.words import numbers, pair

NOT_TO_BE_USED = 4
"""Exit code of a fit that did not converge, or that a stop-finding speaks against; it is written, marked."""
MODEL, RECORDED, ADVANCED = "Model", "Logs fitted as recorded", "Advanced"


@dataclass(frozen=True, kw_only=True)
class Arguments(Common, Reading, Seeded, Verbose):
    """What `eaid fit` is told."""

    data: list[Path] = argument("DATA…", "A data.h5, log files, or folders of them.")
    models: tuple[str, ...] | None = option(
        None, "By itself all that the kind allows.", MODEL, "--model", words="friction|nonlinear|linear", several=True
    )
    share: float | str = option(0.85, "C, share of the fast part, held or free.", MODEL, words="free", number=True)
    estimator: str = option("auto", "By the evidence, all at once, or one by one.", MODEL, words="auto|joint|two-stage")
    ci: str = option("robust", "How 95 % intervals are found.", MODEL, words="robust|bootstrap|white|none")
    hold_out: tuple[float, ...] = option((), "Left out, to measure the error: 40,70.", MODEL, read=numbers, levels=True)
    loss: str = option("squares", "Huber for logs with spikes and drop-outs.", MODEL, words="squares|huber")
    logs_as: str = option(
        "auto", "By what the input does, all as steps, or all as recorded.", RECORDED, words="auto|steps|recorded"
    )
    duty: tuple[float, float] | None = option(None, "Identified.", RECORDED, read=pair("10:100"), shown="LOW:HIGH")
    instrument: bool = option(False, "Closed loops: the simulated duty as an instrument.", RECORDED)
    bounds_levels: str | None = option(None, "Levels of B_m and B_M: 30:100 or 30,40.", ADVANCED, levels=True)
    shape: str = option(
        "auto", "Of steps between levels; auto: by the evidence.", ADVANCED, words="auto|one|two|free|overshoot"
    )
    dead_time: float | str = option(
        "auto", "Of each single step [s]; auto: by the evidence.", ADVANCED, words="auto", number=True
    )
    tables: bool = option(False, "Show all numbers as tables.", OUTPUT)
    plot: bool = option(False, "Draw the levels with the model in the terminal.", OUTPUT)
    output: Path = written("fit.json")


@takes(Arguments)
def command(args: Arguments) -> int:
    """Fit the models of the paper to recorded steps, and say how far they are to be trusted.

    Exit code 4: a fit did not converge, or explains little; the result is written, marked.

    Example: eaid fit bench/ --levels 20:100 --hold-out 60 -o fit.json
    """
    import msgspec

    from eaid import api
    from eaid.cli import fit_tables, inputs
    from eaid.files import refuse_to_overwrite
    from eaid.fitting.choices import check
    from eaid.logs.manifest import files_read
    from eaid.results import codec
    from eaid.results.fit import FitOptions

    refuse_to_overwrite(args.output, args.force, files_read(args.data))
    options = taken(
        FitOptions, args, bounds_levels=None, dead_time_s=None if args.dead_time == "auto" else args.dead_time
    )
    check(options)
    with console.answer_first():
        stepset = inputs.runs_from(args.data, inputs.reading_of(args), args.logs_as, console.say)[1]
        result = api.fit(
            stepset, options, bounds_levels=args.bounds_levels, duty=args.duty, instrument=args.instrument,
            progress=console.progress,
        )  # fmt: skip
        result = msgspec.structs.replace(result, command=args.words)
        codec.write(args.output, result, "fit", args.force)
        if args.json:
            console.print_json(result, "fit")
        else:
            fit_tables.show(result, args.output, args.tables or args.verbose, args.verbose)
            if args.plot:
                from eaid.cli import plots

                plots.levels(result, stepset)
    console.tell(result.findings, args.verbose)
    console.say(fit_tables.closing(result, args.output))
    if fit_tables.usable(result):
        return 0
    console.fail(f"{args.output}: is written and marked; do not use its numbers")
    return NOT_TO_BE_USED
