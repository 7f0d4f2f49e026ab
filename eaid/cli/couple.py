"""`eaid couple`: how stiff a virtual wall each loop may render."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

from eaid.cli import console
from eaid.cli.options import Force, Json, Output, Quiet, Seed
from eaid.cli.words import names, numbers

if TYPE_CHECKING:
    from eaid.results.coupling import Wall

Fit = Annotated[Path, typer.Argument(metavar="FIT", help="fit.json with a nonlinear model.")]
Gains = Annotated[Path | None, typer.Option("--gains", help="gains.json; without it only open loop and inverse.")]
LIMB, LOOP, DRAWN = "The limb and the wall", "The loop as it runs", "Populations"


def command(
    fit: Fit,
    gains: Gains = None,
    torque: Annotated[
        str | None, typer.Option("--torque", help="Torques held: 1,2,3; default: four.", rich_help_panel=LIMB)
    ] = None,
    loops: Annotated[
        str | None,
        typer.Option("--loops", help="Of open-loop,pi,rc-no-rate,rc,inverse; default: all.", rich_help_panel=LOOP),
    ] = None,
    limb_inertia: Annotated[float, typer.Option(help="[kg·m²]", rich_help_panel=LIMB)] = 0.1,
    limb_damping: Annotated[float, typer.Option(help="[N·m·s/rad]", rich_help_panel=LIMB)] = 0.8,
    virtual_damping: Annotated[float, typer.Option(help="B_v of the wall [N·m·s/rad].", rich_help_panel=LIMB)] = 0.0,
    wall: Annotated[
        float | None, typer.Option(help="A stiffness that has to be rendered [N·m/rad].", rich_help_panel=LIMB)
    ] = None,
    rate_hz: Annotated[float, typer.Option(help="Control rate.", rich_help_panel=LOOP)] = 1000.0,
    pwm_hz: Annotated[float, typer.Option(help="Duty latched at; 0: at once.", rich_help_panel=LOOP)] = 0.0,
    delay_samples: Annotated[int, typer.Option(help="From reading to duty.", rich_help_panel=LOOP)] = 0,
    sensor_hz: Annotated[float, typer.Option(help="Torque sensor's corner; 0: none.", rich_help_panel=LOOP)] = 0.0,
    encoder_counts: Annotated[int | None, typer.Option(help="Counts a turn of the limb.", rich_help_panel=LIMB)] = None,
    idle_drag_nm: Annotated[
        float | None, typer.Option(help="Torque of the idle clutch; default: the fit's idle.", rich_help_panel=LIMB)
    ] = None,
    rotor_rpm: Annotated[float, typer.Option(help="Speed of the rotor.", rich_help_panel=LIMB)] = 10.0,
    pair_bias_nm: Annotated[
        float | None, typer.Option(help="Bias of an antagonistic pair.", rich_help_panel=LIMB)
    ] = None,
    plants: Annotated[int, typer.Option(help="Plants drawn, each with a limb.", rich_help_panel=DRAWN)] = 0,
    limb_spread: Annotated[float, typer.Option(help="J and b of drawn limbs: ± share.", rich_help_panel=DRAWN)] = 0.3,
    replay: Annotated[bool, typer.Option(help="Also bisect replays.", rich_help_panel=LOOP)] = True,
    output: Output = Path("couple.json"),
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Tell all findings.")] = False,
    json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
    seed: Seed = 0,
) -> None:
    """How stiff a virtual wall each loop may render on a limb: passive on any limb, stable on this one, replayed.

    Exit code 5: a loop is unstable without any wall.

    Example: eaid couple fit.json --gains gains.json --torque 1,2,3 --wall 3
    """
    console.be_quiet(quiet)
    import msgspec

    from eaid.coupling.entry import CoupleOptions, couple_fit
    from eaid.files import refuse_to_overwrite
    from eaid.results import codec
    from eaid.results.common import Input
    from eaid.results.coupling import CoupleInputs
    from eaid.results.fit import Fit as FitResult
    from eaid.results.gains import Gains as GainsResult

    path = cast("Path", output)
    refuse_to_overwrite(path, force, [fit, *([gains] if gains else [])])
    plain = CoupleOptions()
    options = CoupleOptions(
        torques=numbers("--torque", torque), loops=names(loops) or plain.loops, limb_inertia=limb_inertia,
        limb_damping=limb_damping, virtual_damping=virtual_damping, wall=wall, rate_hz=rate_hz, pwm_hz=pwm_hz,
        delay_samples=delay_samples, sensor_hz=sensor_hz, encoder_counts=encoder_counts, idle_drag_nm=idle_drag_nm,
        rotor_rpm=rotor_rpm, pair_bias_nm=pair_bias_nm, plants=plants, limb_spread=limb_spread, seed=seed,
        replay=replay,
    )  # fmt: skip
    fitted, told = codec.read(fit, "fit", FitResult)
    tuned, more = codec.read(gains, "gains", GainsResult) if gains else (None, ())
    found = couple_fit(fitted, tuned, options, console.progress)
    inputs = CoupleInputs(Input.of(fit), Input.of(gains) if gains else None)
    found = msgspec.structs.replace(found, inputs=inputs)
    codec.write(path, found, "couple", force)
    if json:
        print(codec.dumps(found, "couple"), end="")
    else:
        _show(found.walls, "Stiffest wall, one clutch [N·m/rad]", found.output_unit)
        _show(found.pair, f"An antagonistic pair, each held at {found.pair_bias_nm:.3g} {found.output_unit}", "")
    console.tell([*told, *more, *found.findings], verbose)
    console.say(f"wrote {path}")


def _show(walls: "tuple[Wall, ...]", title: str, unit: str) -> None:
    torque = f"torque [{unit}]" if unit else "torque"
    heading = ["loop", torque, "passive", "limited at [Hz]", "stable", "lost at [Hz]", "replayed"]
    rows = [
        [wall.loop, f"{wall.torque_nm:g}", *(_number(v) for v in (wall.K_passive, wall.passive_hz, wall.K_stable,
                                                                     wall.lost_hz, wall.K_replayed))]
        for wall in walls
    ]  # fmt: skip
    if rows:
        console.table(title, heading, rows)


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"
