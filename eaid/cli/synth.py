"""`eaid synth`: a plant → synthetic logs."""

from dataclasses import dataclass
from pathlib import Path

from eaid.cli import console
from eaid.cli.form import Common, Seeded, option, refuse_idle, taken, takes, written
from eaid.cli.inputs import KINDS
from eaid.cli.words import keyed, spaced
from eaid.errors import UsageError
from eaid.shown import counted

WHAT, WHEN, HOW, LOOP = "What is recorded", "Times", "Disturbances", "Other inputs than steps"
EXCITATIONS = ("staircase", "random", "prbs", "multisine", "chirp", "closed-loop")


@dataclass(frozen=True, kw_only=True)
class Arguments(Common, Seeded):
    """What `eaid synth` is told."""

    kind: str | None = option(None, "By itself clutch; of a fit.json, its own.", WHAT, words=KINDS)
    plant: str = option("reference", "The paper's clutch, or a fit.json.", WHAT, shown="reference|FILE")
    levels: tuple[float, ...] | None = option(None, "30,40,90 or from:to:step.", WHAT, read=spaced, levels=True)
    repeats: int | None = option(None, "Runs of each level.", WHAT)
    plan: Path | None = option(None, "The run table of eaid plan.", WHAT, shown="FILE")
    idle_s: float | None = option(None, "Input 0 before the step [s].", WHEN, "--idle")
    hold_s: float | None = option(None, "Input at its level [s].", WHEN, "--hold")
    release_s: float | None = option(None, "Input 0 after the step [s].", WHEN, "--release")
    rate_hz: float | None = option(None, "Samples a second [Hz].", WHEN)
    clean: bool = option(False, "The plant alone: no noise, scatter, offset or digits.", HOW)
    white_nm: float | None = option(None, "White noise, sd [N·m].", HOW, "--noise-nm")
    coloured: float | None = option(None, "Coloured noise, sd, share of torque.", HOW)
    coloured_s: float | None = option(None, "Its time constant [s].", HOW)
    ripple: float | None = option(None, "Rotor ripple, amplitude, share of torque.", HOW)
    gain_scatter: float | None = option(None, "Run-to-run sd of the torque's gain, share.", HOW)
    tau1_scatter: float | None = option(None, "Run-to-run sd of log τ1.", HOW)
    tau2_scatter: float | None = option(None, "Run-to-run sd of log τ2.", HOW)
    offset_nm: float | None = option(None, "Offset of the torque sensor [N·m].", HOW)
    jitter_s: float | None = option(None, "Sample instants, sd [s].", HOW)
    resolution_nm: float | None = option(None, "Step of the sensor's digits [N·m].", HOW)
    duty_file: Path | None = option(None, "CSV time_s,duty_pct (force_n, speed_rpm, input).", LOOP, shown="FILE")
    excitation: str | None = option(None, "Logs to be fitted as recorded.", LOOP, words=EXCITATIONS)
    shape: str | None = option(
        None, "Of the excitation: duration_s=240,hold_s=0.5:20,duty=10:100,levels=10,rest_s=5,idle_s=2,"
        "frequency_hz=0.05:5,reference_nm=0.6:3.6,gains=21:360, all in the rig's units.", LOOP,
        shown="NAME=VALUE,…",
    )  # fmt: skip
    gains: Path | None = option(None, "A gains.json, whose controller drives the closed loop.", LOOP, shown="FILE")
    controller: str = option("pi", "Of the gains.json.", LOOP, words="pi|rc")
    output: Path = written("synthetic.h5", "A .h5 dataset, or a folder of CSV.")


@takes(Arguments)
def command(args: Arguments) -> None:
    """Make a synthetic dataset of a plant: a data.h5, or a folder of CSV when -o has no .h5 ending.

    Example: eaid synth --levels 20,60,100 --repeats 2 --hold 8 -o logs
    """
    from eaid.cli.printed import Synthesized
    from eaid.files import refuse_to_overwrite
    from eaid.results import codec
    from eaid.results.common import Input
    from eaid.results.fit import Fit
    from eaid.results.gains import Gains
    from eaid.synth.datasets import write
    from eaid.synth.disturbance import Disturbance
    from eaid.synth.excitation import Excitation
    from eaid.synth.folder import refuse_folder, write_folder
    from eaid.synth.synthesize import SynthOptions, synthesize

    fit_file = None if args.plant == "reference" else Path(args.plant)
    inputs = [each for each in (fit_file, args.duty_file, args.plan, args.gains) if each is not None]
    is_dataset = args.output.suffix.lower() in (".h5", ".hdf5")
    if args.excitation is None:
        refuse_idle(args, ("shape", "gains"), "without --excitation")
    elif is_dataset:
        raise UsageError("--excitation: writes a folder of CSV (-o FOLDER); give another -o")
    if args.gains is None:
        refuse_idle(args, ("controller",), "without --gains")
    (refuse_to_overwrite if is_dataset else refuse_folder)(args.output, args.force, inputs)
    sizes = {name: getattr(args, name) for name in Disturbance.__dataclass_fields__}
    options = taken(
        SynthOptions, args, sizes={name: value for name, value in sizes.items() if value is not None},
        shape=keyed("«shape»", args.shape, Excitation),
    )  # fmt: skip
    fit, doubts = codec.read(fit_file, "fit", Fit) if fit_file is not None else (None, ())
    named = "" if fit_file is None else f"{fit_file} (sha256 {Input.of(fit_file).sha256[:12]})"
    gains = codec.read(args.gains, "gains", Gains)[0] if args.gains is not None else None
    runs = synthesize(options, fit, named, gains)
    (write if is_dataset else write_folder)(args.output, runs, args.force)
    console.tell(doubts, verbose=True)
    if args.json:
        console.print_json(Synthesized.of(args.output, runs, tuple(map(Input.of, inputs)), args.seed), "synth")
    made_of = (runs[0].synthetic or "").partition(";")[0].removeprefix("eaid synth of ")
    said = f"{counted(len(runs), 'synthetic run')} of {made_of}, seed {args.seed}"
    console.done(args.output, said, f"eaid fit {args.output}")
