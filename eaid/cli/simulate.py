"""`eaid simulate`: controllers replayed on the fitted plant."""

from dataclasses import dataclass
from pathlib import Path

from eaid.cli import console
from eaid.cli.form import Common, Seeded, Verbose, argument, option, taken, takes, written
from eaid.cli.inputs import Columns
from eaid.cli.words import factors
from eaid.errors import UsageError

WHAT, RIG, MORE, REHAB = "What is replayed", "Rig", "More plants", "Rehabilitation"
CONTROLLERS = ("rc", "pi", "pi-feedforward", "feedforward", "open-loop", "inverse")
Factors = dict[str, float] | None


@dataclass(frozen=True, kw_only=True)
class Arguments(Common, Columns, Seeded, Verbose):
    """What `eaid simulate` is told."""

    fit: Path = argument("FIT", "fit.json of eaid fit.")
    gains: Path | None = option(None, "gains.json of eaid tune-rc; rc and pi need it.", WHAT, shown="FILE")
    controllers: tuple[str, ...] | None = option(
        None, "By itself rc,pi; sweep adds open-loop.", WHAT, "--controller", several=True, words=CONTROLLERS
    )
    scenario: str | None = option(None, "By itself multisine.", WHAT, words="steps|multisine|sweep|ramp|rehab")
    reference: Path | None = option(None, "A reference of your own: CSV time_s,reference_nm.", WHAT, shown="FILE")
    log: list[Path] | None = option(None, "Recorded runs: their input through the plant.", WHAT, shown="FILE")
    keep_baseline: bool = option(False, "Do not subtract the idle output of recorded runs.", WHAT)
    duration: float | None = option(None, "Length of steps, multisine or rehab [s].", WHAT)
    rate_hz: float | None = option(None, "Control rate [Hz]; by itself 1000.", RIG)
    noise_nm: float = option(0.0, "Noise on the measured torque, sd [N·m].", RIG)
    noise_correlation_s: float = option(0.0, "Correlation time of the noise [s]; 0: white.", RIG)
    noise: str | None = option(None, "As large and coloured as the fit's residuals.", RIG, words="residuals")
    ripple_pct: float = option(0.0, "Rotor ripple, amplitude in % of the torque.", RIG)
    ripple_hz: float | None = option(None, "Its frequency [Hz]; by itself 1/6.", RIG)
    sensor_hz: float = option(0.0, "Corner of the torque sensor's low-pass [Hz]; 0: none.", RIG)
    delay_samples: int = option(0, "Control delay [samples].", RIG)
    pwm_hz: float = option(0.0, "Duty latched once a PWM period [Hz]; 0: off.", RIG)
    duty_bits: int = option(0, "Resolution of the duty [bit]; 0: unlimited.", RIG)
    saturation: bool = option(True, "Keep the duty within its limits.", RIG)
    perturb: Factors = option(None, "On the plant alone: Ts=0.9,tau1=1.2.", MORE, read=factors, shown="NAME=FACTOR")
    plants: int | None = option(None, "Also on so many plants drawn from the fit's uncertainty.", MORE)
    threads: int | None = option(None, "Of the drawn plants; by itself all processors.", MORE, kept=False)
    limb_damping: float | None = option(None, "Damping of the limb [N·m·s/rad].", REHAB)
    limb_inertia: float | None = option(None, "Its inertia [kg·m²].", REHAB)
    output: Path = written("replay.h5")


@takes(Arguments)
def command(args: Arguments) -> None:
    """Replay controllers on the fitted plant, from rest, and measure how well they track.

    Example: eaid simulate fit.json --gains gains.json --scenario sweep --noise-nm 0.01
    """
    from dataclasses import replace

    from eaid import api
    from eaid.cli import inputs
    from eaid.files import refuse_to_overwrite
    from eaid.logs.manifest import files_read
    from eaid.replay.files import as_json, write_replay
    from eaid.replay.options import SimulateOptions
    from eaid.replay.rig import Rig
    from eaid.report.tables.replays import tables_of
    from eaid.results import codec
    from eaid.results.fit import Fit
    from eaid.results.gains import Gains
    from eaid.results.replay import ReplayInputs

    files = {"fit": args.fit, "gains": args.gains, "reference": args.reference}
    refuse_to_overwrite(args.output, args.force, [*filter(None, files.values()), *files_read(args.log or [])])
    if args.ripple_hz is not None and not args.ripple_pct:
        raise UsageError("--ripple-hz: does nothing without --ripple-pct; give both or neither")
    if not args.log and any((args.columns, args.units, args.repair, args.variable)):
        raise UsageError("--columns, --units, --repair and --variable belong to --log; leave them out")
    options = taken(SimulateOptions, args, rig=taken(Rig, args), residual_noise=args.noise is not None)
    fitted, doubts = codec.read(args.fit, "fit", Fit)
    tuned, more = codec.read(args.gains, "gains", Gains) if args.gains else (None, ())
    replay = api.simulate(
        fitted, tuned, options=options, reference=args.reference, log=args.log, reading=inputs.reading_of(args),
        progress=console.progress,
    )  # fmt: skip
    replay = replace(replay, head=inputs.stamped(replay.head, args, ReplayInputs, **files, log=args.log))
    write_replay(args.output, replay, args.force)
    if args.json:
        console.print_json(as_json(replay))
    else:
        for table in tables_of(replay):
            console.show(table)
    console.tell([*replay.findings, *doubts, *more], args.verbose)
    said = f"{replay.head.scenario} with {', '.join(sorted(replay.records)[:5])}"
    console.done(args.output, said, f"eaid report {args.fit} {args.output}")
