"""`eaid synth`: a plant → synthetic logs."""

from dataclasses import dataclass
from pathlib import Path

from eaid.cli import console
from eaid.cli.form import Common, takes, written
from eaid.declared import option, part
from eaid.errors import UsageError
from eaid.files import refuse_folder, refuse_to_overwrite
from eaid.options import LOGS, SynthOptions
from eaid.shown import counted


@dataclass(frozen=True, kw_only=True)
class Arguments(Common, SynthOptions):
    """What `eaid synth` takes."""

    plant: str = option("reference", "The paper's clutch, or a fit.json.", LOGS, shown="reference|FILE")
    output: Path = written("synthetic.h5", "A .h5 dataset, or a folder of CSV.")


@takes(Arguments)
def command(args: Arguments) -> None:
    """Make a synthetic dataset of a plant: a data.h5, or a folder of CSV when -o has no .h5 ending.

    Example: eaid synth --levels 20,60,100 --repeats 2 --hold 8 -o logs
    """
    from eaid.results import codec
    from eaid.results.common import Input
    from eaid.results.fit import Fit
    from eaid.synth.datasets import write
    from eaid.synth.files import is_synthetic, write_folder
    from eaid.synth.synthesize import synthesize

    fit_file = None if args.plant == "reference" else Path(args.plant)
    inputs = [each for each in (fit_file, args.duty_file) if each is not None]
    is_dataset = args.output.suffix.lower() in (".h5", ".hdf5")
    if args.excitation is not None and is_dataset:
        raise UsageError("--excitation: writes a folder of CSV (-o FOLDER); give another -o")
    if is_dataset:
        refuse_to_overwrite(args.output, args.force, inputs)
    else:
        refuse_folder(args.output, args.force, is_synthetic, "eaid synth", inputs)
    options = part(SynthOptions, args)
    fit, warnings = codec.read(fit_file, Fit) if fit_file is not None else (None, ())
    named = "" if fit_file is None else f"{fit_file} (sha256 {Input.of(fit_file).sha256[:12]})"
    runs = synthesize(options, fit, named)
    (write if is_dataset else write_folder)(args.output, runs, args.force)
    console.tell(warnings, verbose=True)
    if args.json:
        rows = [{"name": r.name, "level": r.level, "repeat": r.repeat, "samples": r.time_s.size} for r in runs]
        of = {key: getattr(runs[0], key) for key in ("synthetic", "kind", "input_unit", "output_unit")}
        sources = tuple(map(Input.of, inputs))
        console.print_json({"output": args.output, **of, "inputs": sources, "seed": args.seed, "runs": rows}, "synth")
    made_of = (runs[0].synthetic or "").partition(";")[0].removeprefix("eaid synth of ")
    summary = f"{counted(len(runs), 'synthetic run')} of {made_of}, seed {args.seed}"
    console.done(args.output, summary, ("fit", args.output))
