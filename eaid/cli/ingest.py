"""`eaid ingest`: logs → a table of levels, warnings of their runs, and data.h5."""

from pathlib import Path

from eaid.cli import console
from eaid.cli.form import OUTPUT, Common, argument, takes, tell_result, written
from eaid.declared import option
from eaid.files import refuse_to_overwrite
from eaid.options import ReadOptions


@takes
def command(
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
    runs, stepset = read_steps(logs, reading, console.progress, console.warn, console.say, "ingest")
    if write_manifest:
        at = write(files_of(logs), {**stepset.reading, "kind": stepset.kind}, args.force)
        console.say(f"{at}: written; eaid ingest {at.parent} needs no options now")
    write_dataset(output, runs, kind=stepset.kind, apparatus=stepset.apparatus, force=args.force)  # type: ignore[arg-type]
    tell_result(args, ingested(stepset), steps_shown(stepset), (), "ingest")
    console.done(output, counts(stepset), ("fit", output))
