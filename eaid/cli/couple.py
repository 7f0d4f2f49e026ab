"""`eaid couple`: how stiff a virtual wall each loop may render."""

from dataclasses import dataclass
from pathlib import Path

from eaid.cli import console
from eaid.cli.form import Common, Seeded, Verbose, argument, option, taken, takes, written
from eaid.cli.words import numbers

LIMB, LOOP, DRAWN = "The limb and the wall", "The loop as it runs", "Populations"
LOOPS = ("open-loop", "pi", "rc-no-rate", "rc", "inverse")


@dataclass(frozen=True, kw_only=True)
class Arguments(Common, Seeded, Verbose):
    """What `eaid couple` is told."""

    fit: Path = argument("FIT", "fit.json with a nonlinear model.")
    gains: Path | None = option(None, "gains.json; without it only open loop and inverse.", LOOP, shown="FILE")
    loops: tuple[str, ...] = option(LOOPS, "Loops that are judged.", LOOP, words=LOOPS, several=True, shown="NAME,…")
    rate_hz: float = option(1000.0, "Control rate [Hz].", LOOP)
    pwm_hz: float = option(0.0, "Duty latched at [Hz]; 0: at once.", LOOP)
    delay_samples: int = option(0, "From reading to duty [samples].", LOOP)
    sensor_hz: float = option(0.0, "Torque sensor's corner [Hz]; 0: none.", LOOP)
    replay: bool = option(True, "Also bisect replays of the nonlinear plant.", LOOP)
    torques: tuple[float, ...] = option(
        (), "Torques held; by itself four over the fitted range.", LIMB, "--torque", read=numbers, shown="1,2,3"
    )
    wall: float | None = option(None, "A stiffness that has to be rendered [N·m/rad].", LIMB)
    virtual_damping: float = option(0.0, "B_v of the wall [N·m·s/rad].", LIMB)
    limb_inertia: float = option(0.1, "[kg·m²]", LIMB)
    limb_damping: float = option(0.8, "[N·m·s/rad]", LIMB)
    encoder_counts: int | None = option(None, "Counts a turn of the limb.", LIMB)
    idle_drag_nm: float | None = option(None, "Torque of the idle clutch; by itself the fit's idle.", LIMB)
    rotor_rpm: float = option(10.0, "Speed of the rotor.", LIMB)
    pair_bias_nm: float | None = option(None, "Bias of an antagonistic pair; by itself mid-range.", LIMB)
    plants: int = option(0, "Plants drawn from the fit's uncertainty, each with a limb.", DRAWN)
    limb_spread: float = option(0.3, "Inertia and damping of drawn limbs: ± share.", DRAWN)
    output: Path = written("couple.json")


@takes(Arguments)
def command(args: Arguments) -> None:
    """How stiff a virtual wall each loop may render on a limb: passive on any limb, stable on this one, replayed.

    Exit code 5: a loop is unstable without any wall.

    Example: eaid couple fit.json --gains gains.json --torque 1,2,3 --wall 3
    """
    from eaid import api
    from eaid.cli import inputs
    from eaid.coupling.options import CoupleOptions
    from eaid.files import refuse_to_overwrite
    from eaid.report.tables.gains import walls_tables
    from eaid.results import codec
    from eaid.results.coupling import CoupleInputs
    from eaid.results.fit import Fit
    from eaid.results.gains import Gains

    refuse_to_overwrite(args.output, args.force, [args.fit, *([args.gains] if args.gains else [])])
    options = taken(CoupleOptions, args)
    fitted, doubts = codec.read(args.fit, "fit", Fit)
    tuned, more = codec.read(args.gains, "gains", Gains) if args.gains else (None, ())
    found = api.couple(fitted, tuned, options, progress=console.progress)
    found = inputs.stamped(found, args, CoupleInputs, fit=args.fit, gains=args.gains)
    codec.write(args.output, found, "couple", args.force)
    if args.json:
        console.print_json(found, "couple")
    else:
        for table in walls_tables(found):
            console.show(table)
    console.tell([*doubts, *more, *found.findings], args.verbose)
    console.done(args.output, f"{len(found.walls)} walls", f"eaid report {args.fit} {args.output}")
