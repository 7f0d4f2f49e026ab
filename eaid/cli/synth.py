"""`eaid synth`: a plant → synthetic logs."""

from pathlib import Path
from typing import TYPE_CHECKING, cast

from eaid.cli import console
from eaid.cli import synth_options as o
from eaid.cli.options import Force, Json, Output, Quiet, Seed
from eaid.errors import UsageError

if TYPE_CHECKING:
    from eaid.logs.run import Run
    from eaid.synth.synthesize import SynthOptions


def command(
    kind: o.Kind = None,
    plant: o.PlantOption = "reference",
    levels: o.Levels = None,
    repeats: o.Repeats = None,
    idle: o.Idle = None,
    hold: o.Hold = None,
    release: o.Release = None,
    rate: o.Rate = None,
    duty_file: o.DutyFile = None,
    plan: o.PlanFile = None,
    excitation: o.ExcitationOption = None,
    shape: o.Shape = None,
    gains: o.GainsFile = None,
    controller: o.Controller = "pi",
    clean: o.Clean = False,
    white_nm: o.Noise = None,
    coloured: o.Coloured = None,
    coloured_s: o.ColouredS = None,
    ripple: o.Ripple = None,
    gain_scatter: o.GainScatter = None,
    tau1_scatter: o.Tau1Scatter = None,
    tau2_scatter: o.Tau2Scatter = None,
    offset_nm: o.Offset = None,
    jitter_s: o.Jitter = None,
    resolution_nm: o.Resolution = None,
    output: Output = Path("synthetic.h5"),
    seed: Seed = 0,
    as_json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Make a synthetic dataset of a plant: a data.h5, or a folder of CSV when -o has no .h5 ending.

    Example: eaid synth --levels 20:100:20 --repeats 2 --hold 8 -o logs
    """
    console.be_quiet(quiet)
    from eaid.cli.synth_excitation import controller_of, excitation_of
    from eaid.files import refuse_to_overwrite
    from eaid.results import codec
    from eaid.results.common import Input
    from eaid.results.fit import Fit
    from eaid.synth.folder import refuse_folder, write_folder
    from eaid.synth.synthesize import SynthOptions, plant_of, synthesize

    path = cast("Path", output)
    fit_file = None if plant == "reference" else Path(plant)
    inputs = [each for each in (fit_file, duty_file, plan, gains) if each is not None]
    is_dataset = path.suffix.lower() in (".h5", ".hdf5")
    if excitation is not None and is_dataset:
        raise UsageError("--excitation: writes a folder of CSV (-o FOLDER); give another -o")
    if excitation is None and (shape is not None or gains is not None):
        raise UsageError("--shape and --gains: do nothing without --excitation; leave them out")
    if is_dataset:
        refuse_to_overwrite(path, force, inputs)
    else:
        refuse_folder(path, force)
    sizes = {
        "white_nm": white_nm, "coloured": coloured, "coloured_s": coloured_s, "ripple": ripple,
        "gain_scatter": gain_scatter, "tau1_scatter": tau1_scatter, "tau2_scatter": tau2_scatter,
        "offset_nm": offset_nm, "jitter_s": jitter_s, "resolution_nm": resolution_nm,
    }  # fmt: skip
    options = SynthOptions(
        kind=kind, levels=None if levels is None else levels_of(levels),  # type: ignore[arg-type]
        repeats=repeats, idle_s=idle, hold_s=hold, release_s=release, rate_hz=rate, duty_file=duty_file, plan=plan,
        excitation=None if excitation is None else excitation_of(excitation, shape), clean=clean,
        sizes={name: value for name, value in sizes.items() if value is not None}, seed=seed,
    )  # fmt: skip
    fit, told = codec.read(fit_file, "fit", Fit) if fit_file is not None else (None, ())
    named = "" if fit_file is None else f"{fit_file} (sha256 {Input.of(fit_file).sha256[:12]})"
    runs = synthesize(options, fit, named, controller_of(gains, controller))
    if is_dataset:
        from eaid.synth.datasets import write

        write(path, runs, force)
    else:
        write_folder(path, runs, force)
    console.tell(told, verbose=True)
    made_of = plant_of(options, fit, named).made_of
    console.say(f"{path}: {len(runs)} synthetic runs of {made_of}, seed {seed}")
    if as_json:
        console.print_json(_summary(path, runs, made_of, options, inputs))


def levels_of(text: str) -> tuple[float, ...]:
    """`30,40,90`, or `from:to:step` with both ends."""
    try:
        if ":" not in text:
            return tuple(float(part) for part in text.split(","))
        start, end, step = (float(part) for part in text.split(":"))
        count = round((end - start) / step)
    except (ValueError, ZeroDivisionError, OverflowError):
        raise UsageError(f"--levels {text}: give levels as 30,40,90 or as from:to:step") from None
    if not 0 <= count <= 10_000 or abs(start + count * step - end) > 1e-9 * abs(step):
        raise UsageError(f"--levels {text}: the step does not lead from {start:g} to {end:g}")
    return tuple(start + k * step for k in range(count + 1))


def _summary(
    path: Path, runs: "list[Run]", made_of: str, options: "SynthOptions", inputs: list[Path]
) -> dict[str, object]:
    from eaid.results.codec import stamped
    from eaid.results.common import Input

    rows = [{"name": run.name, "level": run.level, "repeat": run.repeat, "samples": run.time_s.size} for run in runs]
    return stamped(
        "eaid/synth/1",
        {
            "output": str(path),
            "synthetic": runs[0].synthetic,
            "kind": runs[0].kind,
            "plant": made_of,
            "input_unit": runs[0].input_unit,
            "output_unit": runs[0].output_unit,
            "inputs": [Input.of(each) for each in inputs],
            "seed": options.seed,
            "runs": rows,
        },
    )
