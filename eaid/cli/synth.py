"""`eaid synth`: a plant → synthetic logs."""

from pathlib import Path

import eaid
from eaid.cli import console
from eaid.cli.form import Common, takes, written
from eaid.declared import option
from eaid.errors import UsageError
from eaid.files import refuse_folder, refuse_to_overwrite
from eaid.options import LOGS, SynthOptions
from eaid.shown import counted


@takes
def command(
    args: Common, how: SynthOptions,
    plant: str = option("reference", "The paper's clutch, or a fit.json.", LOGS, shown="reference|FILE"),
    output: Path = written("synthetic.h5", "A .h5 dataset, or a folder of CSV."),
) -> None:  # fmt: skip
    """Make a synthetic dataset of a plant: a data.h5, or a folder of CSV when -o has no .h5 ending.

    Example: eaid synth --levels 20,60,100 --repeats 2 --hold 8 -o logs
    """
    from eaid.results import codec
    from eaid.results.common import Input
    from eaid.synth.datasets import write
    from eaid.synth.files import is_synthetic, write_folder
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
    fit, warnings = codec.read(fit_file, eaid.Fit) if fit_file is not None else (None, ())
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
