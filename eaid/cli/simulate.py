"""`eaid simulate`: controllers replayed on the fitted plant."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from eaid.cli import console
from eaid.cli.inputs import Columns, KeepBaseline, Repair, Units, Variable
from eaid.cli.options import Force, Json, Output, Quiet, Seed
from eaid.errors import UsageError

if TYPE_CHECKING:
    from eaid.cli.simulate_work import Outcome


def command(
    fit: Annotated[Path, typer.Argument(metavar="FIT", help="fit.json of eaid fit.")],
    gains: Annotated[
        Path | None, typer.Option("--gains", help="gains.json of eaid tune-rc; rc and pi need it.")
    ] = None,
    controllers: Annotated[
        str | None,
        typer.Option(
            "--controller", help="Comma-separated: rc, pi, open-loop, inverse. Default: rc,pi; sweep adds open-loop."
        ),
    ] = None,
    scenario: Annotated[
        str | None, typer.Option("--scenario", help="steps, multisine (default), sweep or rehab.")
    ] = None,
    reference: Annotated[
        Path | None, typer.Option("--reference", help="A reference of your own: CSV time_s,reference_nm.")
    ] = None,
    log: Annotated[
        list[Path] | None,
        typer.Option("--log", help="Recorded runs: their duty through the plant; closed-loop ones compared."),
    ] = None,
    columns: Columns = None,
    units: Units = None,
    repair: Repair = False,
    variable: Variable = None,
    keep_baseline: KeepBaseline = False,
    duration: Annotated[
        float | None, typer.Option("--duration", help="Length of steps, multisine or rehab [s].")
    ] = None,
    rate: Annotated[float, typer.Option("--rate-hz", help="Control rate [Hz].")] = 1000.0,
    noise_nm: Annotated[float, typer.Option("--noise-nm", help="Noise on the measured torque, sd [N·m].")] = 0.0,
    noise_time: Annotated[
        float, typer.Option("--noise-correlation-s", help="Correlation time of the noise [s]; 0: white.")
    ] = 0.0,
    ripple_pct: Annotated[
        float, typer.Option("--ripple-pct", help="Rotor ripple, amplitude in % of the torque.")
    ] = 0.0,
    ripple_hz: Annotated[float, typer.Option("--ripple-hz", help="Its frequency [Hz].")] = 1 / 6,
    sensor_hz: Annotated[
        float, typer.Option("--sensor-hz", help="Corner of the torque sensor's low-pass [Hz]; 0: none.")
    ] = 0.0,
    delay: Annotated[int, typer.Option("--delay-samples", help="Control delay [samples].")] = 0,
    pwm_hz: Annotated[float, typer.Option("--pwm-hz", help="Duty latched once a PWM period [Hz]; 0: off.")] = 0.0,
    duty_bits: Annotated[int, typer.Option("--duty-bits", help="Resolution of the duty [bit]; 0: unlimited.")] = 0,
    saturation: Annotated[bool, typer.Option("--saturation/--no-saturation", help="Limit the duty to 0…100 %.")] = True,
    noise: Annotated[
        str | None,
        typer.Option("--noise", help="residuals: as large and as coloured as the fit's residuals of one run."),
    ] = None,
    perturb: Annotated[
        str | None, typer.Option("--perturb", help="Factors on the plant, unknown to controllers: Ts=0.9,tau1=1.2.")
    ] = None,
    plants: Annotated[
        int | None, typer.Option("--plants", help="Also on so many plants drawn from the fit's uncertainty.")
    ] = None,
    threads: Annotated[
        int | None, typer.Option("--threads", help="Threads for --plants; default: all processors.")
    ] = None,
    with_best: Annotated[
        bool,
        typer.Option("--best", help="The least error this plant allows, the future known; how far each is from it."),
    ] = False,
    limb_damping: Annotated[
        float | None, typer.Option("--limb-damping", help="rehab: damping of the limb [N·m·s/rad].")
    ] = None,
    limb_inertia: Annotated[float | None, typer.Option("--limb-inertia", help="rehab: its inertia [kg·m²].")] = None,
    output: Output = None,
    as_json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
    seed: Seed = 0,
) -> None:
    """Replay controllers on the fitted plant, from rest, and measure how well they track."""
    console.be_quiet(quiet)
    from eaid.files import refuse_to_overwrite

    path = output or Path("replay.h5")
    refuse_to_overwrite(path, force)
    if sum(given is not None for given in (scenario, reference, log)) > 1:
        raise UsageError("--scenario, --reference and --log exclude each other; give one of them")
    if not rate > 0:
        raise UsageError(f"--rate-hz is {rate:g}; it must be above 0")
    name = "log" if log else "reference" if reference else scenario or "multisine"
    tracks = name not in ("log", "rehab")
    if plants is not None and (plants < 1 or not tracks):
        raise UsageError("--plants takes a number from 1 on, and goes with steps, multisine, sweep or --reference")
    if threads is not None and threads < 1:
        raise UsageError(f"--threads is {threads}; it takes a number from 1 on")
    if with_best and name == "rehab":
        raise UsageError("--best: in rehab the reference depends on what the limb does; choose another scenario")
    if with_best and name == "log":
        raise UsageError("--best goes with a scenario or --reference; leave it out")
    if with_best and not saturation:
        raise UsageError("--best: is the best within the duty limits; leave out --no-saturation")
    if name != "rehab" and (limb_damping is not None or limb_inertia is not None):
        raise UsageError("--limb-damping and --limb-inertia belong to --scenario rehab")
    if noise is not None and (noise_nm > 0 or noise_time > 0):
        raise UsageError("--noise residuals sets the noise; leave out --noise-nm and --noise-correlation-s")

    from eaid import __version__, store
    from eaid.cli import simulate_inputs as inputs
    from eaid.cli import simulate_tables as tables
    from eaid.cli import simulate_work as work
    from eaid.replay.controllers import controller
    from eaid.replay.files import write_replay
    from eaid.replay.plant import perturbed, plant_parameters, plant_terms
    from eaid.replay.rig import Rig

    fitted, given = inputs.files(fit, gains)
    open_ends = inputs.unidentified(fitted, given)
    known = inputs.knowledge(fitted, given, gains)
    settings: dict[str, Any] = {"noise_nm": noise_nm, "noise_correlation_s": noise_time}
    if noise is not None:
        settings = inputs.noise_of(noise, fitted, fit)
    rig = Rig(
        **settings,
        ripple_pct=ripple_pct,
        ripple_hz=ripple_hz,
        sensor_hz=sensor_hz,
        delay_samples=delay,
        pwm_hz=pwm_hz,
        duty_bits=duty_bits,
        saturation=saturation,
    )
    chosen = [controller(each, known) for each in inputs.names(controllers, name, known)]
    factors = inputs.factors(perturb)
    plant = plant_parameters(perturbed(known.plant, factors))

    done: Outcome
    if log:
        from eaid.logs.options import ReadOptions
        from eaid.reading import pairs

        if duration is not None:
            raise UsageError("--duration does not go with --log; the log says how long it is")
        reading = ReadOptions(
            columns=pairs("--columns", columns), units=pairs("--units", units), repair=repair, variable=variable
        )
        done = work.log(plant, chosen, log, reading, rig, seed, keep_baseline)
    elif name == "rehab":
        exercise = inputs.exercise(duration, limb_damping, limb_inertia)
        done = work.rehab(plant, chosen, exercise, rig, 1.0 / rate, seed)
    else:
        wanted = inputs.reference(name, reference, 1.0 / rate, duration)
        inputs.doubts(wanted, plant_terms(plant, plant.u_high)[2], given)
        done = work.scenario(plant, chosen, wanted, rig, seed)
        if plants is not None:
            work.spread(done, chosen, wanted, rig, work.Draw(fitted, plants, seed, factors, threads))
        if with_best:
            done.best = work.best(plant, wanted, rig, known, done.results, done.records)
    sources = {"fit": fit, **({"gains": gains} if gains else {}), **({"reference": reference} if reference else {})}
    head: dict[str, Any] = {
        "eaid": __version__,
        "scenario": name,
        "seed": seed,
        **({} if log else {"dt_s": 1.0 / rate}),
        **done.head,
        "rig": rig.__dict__,
        "perturb": factors,
        **({"unidentified": open_ends} if open_ends else {}),
        "inputs": {role: store.input_record(source) for role, source in sources.items()}
        | ({"log": [store.input_record(each) for each in log if each.is_file()]} if log else {}),
    }
    write_replay(path, done.records, head, force)
    if as_json:
        beside = {key: value for key, value in (("best", done.best), ("log", done.log)) if value}
        console.print_json({"schema": "eaid/replay/1", **head, "controllers": done.results, **beside})
    else:
        if done.log:
            tables.recorded(done.log)
        if done.results:
            tables.tracking(name, done.results)
        tables.best_found(done.best, done.results)
    console.say(f"wrote {path}")
