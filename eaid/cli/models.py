"""`eaid ingest`, `fit`, `plan` and `synth`: logs → steps → models, what to record next, and synthetic logs."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import eaid
from eaid.cli import console
from eaid.cli.form import OUTPUT, Common, argument, exit_code_of, refuse_idle, stamped, takes, tell_result, written
from eaid.declared import option
from eaid.errors import UsageError, on_command_line
from eaid.files import refuse_folder, refuse_to_overwrite, written_whole
from eaid.options import LOGS, FitOptions, PlanOptions, ReadOptions, SynthOptions
from eaid.shown import counted

if TYPE_CHECKING:
    from eaid.report.tables import Table

FOLLOW = "At the rig"


@takes
def ingest(
    args: Common, reading: ReadOptions,
    logs: list[Path] = argument("LOG…", "Log files, folders of them, or a data.h5."),
    output: Path = written("data.h5"),
    write_manifest: bool = option(
        False, "Also write dataset.toml beside the logs: the next call needs no options.", OUTPUT
    ),
) -> None:  # fmt: skip
    """Read logs in any supported format, find steps, levels and repeats, and write one tidy dataset.

    Prints a line for each level and each step between levels, and what is wrong, with warnings.

    Example: eaid ingest bench/ --columns input=Volts --units output=mNm -o data.h5
    """
    from eaid.cli.printed import counts, ingested, steps_shown
    from eaid.logs.dataset import write_dataset
    from eaid.logs.folders import files_of, files_read
    from eaid.logs.folders import write_manifest as write
    from eaid.reading import read_steps

    refuse_to_overwrite(output, args.force, files_read(logs))
    runs, stepset = read_steps(logs, reading, console.progress, console.warn, console.speak, "ingest")
    if write_manifest:
        at = write(files_of(logs), {**stepset.reading, "kind": stepset.kind}, args.force)
        console.speak(f"{at}: written; eaid ingest {at.parent} needs no options now")
    write_dataset(output, [*runs, *stepset.recorded], kind=stepset.kind, apparatus=stepset.apparatus, force=args.force)  # type: ignore[arg-type]
    tell_result(args, ingested(stepset), steps_shown(stepset), (), "ingest")
    console.done(output, counts(stepset), ("fit", output))


@takes
def fit(
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
    from eaid.results.summary import answer, runs, usable_line, verdict_line

    if follow is None:
        refuse_idle(args, ("against", "plan"), "without --follow")
    else:
        refuse_to_overwrite(output, args.force)
        data = _follow(data, reading, follow, against, plan)
    refuse_to_overwrite(output, args.force, files_read(data))
    stepset = read_steps(data, reading, console.progress, console.warn, console.speak)[1]
    result = stamped(eaid.fit(stepset, how, progress=console.progress), args)
    result.save(output, args.force)
    lines = *verdict_line(result), *answer(result), usable_line(result), f"next   {_next(result, output)}"
    shown: list[Table | str] = [*map(on_command_line, lines)]
    if args.verbose:  # all that tables need takes its time to import
        from eaid.report.tables.fits import model_tables

        shown += model_tables(result)
    tell_result(args, result, shown, result.findings)
    models = ("friction", "nonlinear", "linear", "release", "steps")
    parts = ", ".join(name for name in models if getattr(result, name)) or "no model"
    console.speak(f"{output}: {parts} of {runs(result, f'{result.data.kind} run')}")
    return exit_code_of(result, output)


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

    rig = codec.read_as(against, Rig)[0] if against is not None else None
    console.speak("following; Ctrl-C ends it with the fit")
    unread = set[Path]()
    try:
        for line in followed(data, reading, silence_s, unread, rig, plan):
            console.speak(on_command_line(line))
    except KeyboardInterrupt:
        console.speak("followed to here; fitting")
    if not unread:
        return data
    console.speak(f"left out: {', '.join(sorted(file.name for file in unread))}")
    return [file for file in files_of(data) if file not in unread]


@takes
def plan(
    args: Common, how: PlanOptions,
    fit: Path = argument("FIT", "A fit.json."),
    excitation: bool = option(False, "One sequence of duties for one recording, in place of steps.", LOGS),
    output: Path = written("plan.csv"),
) -> None:  # fmt: skip
    """Which levels, hold times, repeats and order to record next, for wanted interval widths.

    Writes the run table (plan.csv) and, beside it, the whole session as an input file for the rig
    (plan.duty.csv: time_s,duty_pct or another input in its unit, each value held until the next). Every run ends
    with a recorded release.

    Example: eaid plan fit.json --want Ts=2,tau2=7 --longest-hold 60 -o plan.csv
    """
    import msgspec

    from eaid.cli.printed import cost, plan_shown
    from eaid.planning.kinds import input_changes
    from eaid.results import codec
    from eaid.results.common import Input
    from eaid.results.plan import Excitation, PlannedRun
    from eaid.synth.files import input_file

    files = [output] if excitation else [output, output.with_suffix(".duty.csv")]
    if excitation:
        refuse_idle(args, ("idle_s", "release_s", "longest_hold_s", "most_levels"), "with --excitation")
    else:
        refuse_idle(args, ("limits",), "without --excitation")
    fitted, warnings = codec.read_as(fit, eaid.Fit)
    for path in files:
        refuse_to_overwrite(path, args.force, (fit,))
    plan = eaid.plan(fitted, how, excitation=excitation, progress=console.progress)
    plan = msgspec.structs.replace(plan, inputs=(Input.of(fit),), command=args.typed)
    if isinstance(plan, Excitation):
        contents = [input_file(plan.duty, "clutch", plan.input_unit)]
    else:
        rows = [f"{r.order},{r.level:.9g},{r.repeat},{r.idle_s:g},{r.hold_s:g},{r.release_s:g}" for r in plan.runs]
        changes = input_file(input_changes(plan.runs), fitted.data.kind, plan.input_unit)
        contents = [[",".join(PlannedRun.__struct_fields__), *rows], changes]
    with written_whole(*files, force=args.force) as parts:
        for file, lines in zip(parts, contents, strict=True):
            file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    tell_result(args, plan, plan_shown(plan), (*warnings, *plan.findings))
    console.speak(f"{', '.join(map(str, files))}: {cost(plan)}")


@takes
def synth(
    args: Common, how: SynthOptions,
    plant: str = option("reference", "The paper's clutch, or a fit.json.", LOGS, shown="reference|FILE"),
    output: Path = written("synthetic.h5", "A .h5 dataset, or a folder of CSV."),
) -> None:  # fmt: skip
    """Make a synthetic dataset of a plant: a data.h5, or a folder of CSV when -o has no .h5 ending.

    Example: eaid synth --levels 20,60,100 --repeats 2 --hold 8 -o logs
    """
    from eaid.results import codec
    from eaid.results.common import Input
    from eaid.synth.files import is_synthetic, write, write_folder
    from eaid.synth.synthesize import synthesize

    fit_file = None if plant == "reference" else Path(plant)
    inputs = [each for each in (fit_file, how.duty_file) if each is not None]
    is_dataset = output.suffix.lower() in (".h5", ".hdf5")
    if how.excitation is not None and is_dataset:
        raise UsageError("--excitation: writes a folder of CSV (-o FOLDER); give another -o")
    if is_dataset:
        refuse_to_overwrite(output, args.force, inputs)
    else:
        refuse_folder(output, args.force, is_synthetic, "eaid synth", inputs)
    fit, warnings = codec.read_as(fit_file, eaid.Fit) if fit_file is not None else (None, ())
    named = "" if fit_file is None else f"{fit_file} (sha256 {Input.of(fit_file).sha256[:12]})"
    runs = synthesize(how, fit, named)
    (write if is_dataset else write_folder)(output, runs, args.force)
    console.tell(warnings, verbose=True)
    if args.json:
        rows = [{"name": r.name, "level": r.level, "repeat": r.repeat, "samples": r.time_s.size} for r in runs]
        of = {key: getattr(runs[0], key) for key in ("synthetic", "kind", "input_unit", "output_unit")}
        sources = tuple(map(Input.of, inputs))
        console.print_json({"output": output, **of, "inputs": sources, "seed": how.seed, "runs": rows}, "synth")
    made_of = (runs[0].synthetic or "").partition(";")[0].removeprefix("eaid synth of ")
    summary = f"{counted(len(runs), 'synthetic run')} of {made_of}, seed {how.seed}"
    console.done(output, summary, ("fit", output))
