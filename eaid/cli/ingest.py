"""`eaid ingest`: logs → a table of levels, warnings of their runs, and data.h5."""

from dataclasses import dataclass
from pathlib import Path

from eaid.cli import console
from eaid.cli.form import OUTPUT, Common, argument, takes, tell_result, written
from eaid.declared import option, part
from eaid.files import refuse_to_overwrite
from eaid.options import ReadOptions


@dataclass(frozen=True, kw_only=True)
class Arguments(Common, ReadOptions):
    """What `eaid ingest` takes."""

    logs: list[Path] = argument("LOG…", "Log files, folders of them, or a data.h5.")
    output: Path = written("data.h5")
    write_manifest: bool = option(
        False, "Also write dataset.toml beside the logs: the next call needs no options.", OUTPUT
    )


@takes(Arguments)
def command(args: Arguments) -> None:
    """Read logs in any supported format, find steps, levels and repeats, and write one tidy dataset.

    Prints a line for each level and each step between levels, and what is wrong, with warnings.

    Example: eaid ingest bench/ --columns input=Volts --units output=mNm -o data.h5
    """
    from eaid.cli.printed import counts, ingested, steps_shown
    from eaid.logs.dataset import write_dataset
    from eaid.logs.manifest import files_read
    from eaid.reading import read_steps

    options = part(ReadOptions, args)
    refuse_to_overwrite(args.output, args.force, files_read(args.logs))
    runs, stepset = read_steps(args.logs, options, console.progress, console.warn, console.say, "ingest")
    if args.write_manifest:
        from eaid.logs.folders import files_of
        from eaid.logs.manifest import write_manifest

        at = write_manifest(files_of(args.logs), runs, {**stepset.reading, "kind": stepset.kind}, args.force)
        console.say(f"{at}: written; eaid ingest {at.parent} needs no options now")
    write_dataset(args.output, runs, kind=stepset.kind, apparatus=stepset.apparatus, force=args.force)  # type: ignore[arg-type]
    tell_result(args, ingested(stepset), steps_shown(stepset), (), "ingest")
    console.done(args.output, counts(stepset), ("fit", args.output))
