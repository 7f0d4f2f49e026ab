"""`eaid simulate`: controllers replayed on the fitted plant."""

from pathlib import Path
from typing import cast

from eaid.cli import console, inputs
from eaid.cli import simulate_inputs as given_as
from eaid.cli import simulate_options as o
from eaid.cli.options import Force, Json, Output, Quiet, Seed
from eaid.cli.words import names
from eaid.errors import UsageError


def command(
    fit: o.FitFile,
    gains: o.Gains = None,
    controllers: o.Controllers = None,
    scenario: o.Scenario = None,
    reference: o.Reference = None,
    log: o.Log = None,
    columns: inputs.Columns = None,
    units: inputs.Units = None,
    repair: inputs.Repair = False,
    variable: inputs.Variable = None,
    keep_baseline: inputs.KeepBaseline = False,
    duration: o.Duration = None,
    rate: o.Rate = None,
    noise_nm: o.NoiseNm = 0.0,
    noise_time: o.NoiseTime = 0.0,
    noise: o.Noise = None,
    ripple_pct: o.RipplePct = 0.0,
    ripple_hz: o.RippleHz = None,
    sensor_hz: o.SensorHz = 0.0,
    delay: o.Delay = 0,
    pwm_hz: o.PwmHz = 0.0,
    duty_bits: o.DutyBits = 0,
    saturation: o.Saturation = True,
    perturb: o.Perturb = None,
    plants: o.Plants = None,
    threads: o.Threads = None,
    with_best: o.Best = False,
    limb_damping: o.LimbDamping = None,
    limb_inertia: o.LimbInertia = None,
    output: Output = Path("replay.h5"),
    verbose: o.Verbose = False,
    as_json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
    seed: Seed = 0,
) -> None:
    """Replay controllers on the fitted plant, from rest, and measure how well they track.

    Example: eaid simulate fit.json --gains gains.json --scenario sweep --noise-nm 0.01
    """
    console.be_quiet(quiet)
    from dataclasses import replace

    from eaid.cli import simulate_tables as tables
    from eaid.coupling.entry import with_wall_findings
    from eaid.files import refuse_to_overwrite
    from eaid.replay.files import as_json as content_of
    from eaid.replay.files import write_replay
    from eaid.replay.options import SimulateOptions
    from eaid.replay.references import read_reference
    from eaid.replay.rig import Rig
    from eaid.replay.simulate import simulate
    from eaid.results import codec
    from eaid.results.fit import Fit
    from eaid.results.gains import Gains

    path = cast("Path", output)
    given = [each for each in (fit, gains, reference) if each is not None]
    refuse_to_overwrite(path, force, [*given, *(log or [])])
    if noise not in (None, "residuals"):
        raise UsageError(f"--noise {noise}: there is residuals (coloured as the fit's), and --noise-nm for white")
    if sum(each is not None for each in (scenario, reference, log)) > 1:
        raise UsageError("--scenario, --reference and --log exclude each other; give one of them")
    if ripple_hz is not None and not ripple_pct:
        raise UsageError("--ripple-hz: does nothing without --ripple-pct; give both or neither")
    rig = Rig(
        noise_nm=noise_nm, noise_correlation_s=noise_time, ripple_pct=ripple_pct, sensor_hz=sensor_hz,
        delay_samples=delay, pwm_hz=pwm_hz, duty_bits=duty_bits, saturation=saturation,
        **({} if ripple_hz is None else {"ripple_hz": ripple_hz}),
    )  # fmt: skip
    options = SimulateOptions(
        scenario=scenario, controllers=None if controllers is None else names(controllers), duration=duration,
        rate_hz=rate, rig=rig, residual_noise=noise is not None, perturb=given_as.factors(perturb), plants=plants,
        threads=threads, best=with_best, limb_damping=limb_damping, limb_inertia=limb_inertia,
        keep_baseline=keep_baseline, seed=seed,
    )  # fmt: skip
    options.check_for("log" if log else "reference" if reference else scenario or "multisine")
    if not log and (columns or units or repair or variable):
        raise UsageError("--columns, --units, --repair and --variable belong to --log; leave them out")
    fitted, told = codec.read(fit, "fit", Fit)
    tuned, more = codec.read(gains, "gains", Gains) if gains else (None, ())
    signal = read_reference(reference) if reference else None
    runs = given_as.runs_of(log, columns, units, repair, variable) if log else None
    replay = with_wall_findings(simulate(fitted, tuned, options, signal, runs, console.progress), fitted, tuned)
    replay = replace(replay, head=given_as.with_inputs(replay.head, fit, gains, reference, log))
    write_replay(path, replay, force)
    if as_json:
        console.print_json(content_of(replay))
    else:
        tables.show(replay)
    console.tell([*replay.findings, *told, *more], verbose)
    console.say(f"wrote {path}")
