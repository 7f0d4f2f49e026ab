"""`eaid tune-rc`: a fit → gains of both controllers, and what may be expected of them."""

from pathlib import Path
from typing import TYPE_CHECKING, cast

from eaid.cli import console
from eaid.cli import tune_options as o
from eaid.cli.options import Force, Json, Output, Quiet, Seed
from eaid.cli.words import names, pair, word_or_number
from eaid.errors import UsageError

if TYPE_CHECKING:
    from eaid.results.fit import Fit
    from eaid.results.tuning import TuneOptions
    from eaid.steps.stepset import StepSet


def command(
    fit: o.FitFile,
    bounds: o.Bounds = None,
    levels: o.Levels = None,
    widen_bounds: o.Widen = False,
    b_hat: o.BHat = "pooled",
    kp: o.Kp = None,
    kd: o.Kd = None,
    natural_frequency: o.Frequency = None,
    damping: o.Damping = None,
    q_max: o.QMax = None,
    reference: o.Reference = None,
    phi: o.Phi = None,
    data: o.Data = None,
    epsilon: o.Epsilon = None,
    gamma: o.Gamma = None,
    p_scale: o.PScale = 5.0,
    rho: o.Rho = "paper",
    alpha: o.Alpha = "formula",
    pi_overshoot: o.Overshoot = None,
    pi_settling: o.Settling = None,
    pi_gains: o.PIGains = None,
    anti_windup: o.AntiWindup = "conditional",
    duty_limits: o.Limits = None,
    rate_hz: o.RateHz = None,
    pwm_hz: o.PwmHz = None,
    optimize: o.Optimize = False,
    optimize_for: o.OptimizeFor = "tracking",
    optimize_also: o.Also = None,
    plants: o.Plants = None,
    noise_nm: o.NoiseNm = None,
    chatter_limit: o.ChatterLimit = None,
    evaluations: o.Evaluations = None,
    allow_unidentified: o.Unidentified = False,
    output: Output = Path("gains.json"),
    verbose: o.Verbose = False,
    json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
    seed: Seed = 0,
) -> None:
    """Gains of the robust controller and of a PI from a fit, with one verdict on the guarantee.

    Exit code 5: the fit or the wishes are not physical, out of reach, or unstable on the linear model.

    Example: eaid tune-rc fit.json --b-hat minimax --phi data -o gains.json
    """
    console.be_quiet(quiet)
    import msgspec

    from eaid.cli import gains_tables
    from eaid.coupling.judge import stiffness_judge
    from eaid.files import refuse_to_overwrite
    from eaid.replay.references import read_reference
    from eaid.replay.scenarios import SCENARIOS
    from eaid.replay.tune import tune
    from eaid.results import codec
    from eaid.results.common import Input
    from eaid.results.fit import Fit
    from eaid.results.gains import GainsInputs
    from eaid.results.tuning import TuneOptions

    path = cast("Path", output)
    if data and phi != "data" and not optimize and optimize_also is None:
        raise UsageError("--data: does nothing without --phi data or --optimize; leave it out")
    own = None if reference is None or reference in SCENARIOS else Path(reference)
    refuse_to_overwrite(path, force, [fit, *([own] if own else []), *(data or [])])
    options = TuneOptions(
        bounds=bounds, levels=levels, widen_bounds=widen_bounds,
        b_hat=word_or_number(b_hat, ("pooled", "minimax"), "--b-hat"),  # type: ignore[arg-type]
        kp=kp, kd=kd, natural_frequency=natural_frequency, damping=damping, q_max=q_max,
        phi=word_or_number(phi, ("data",), "--phi"),  # type: ignore[arg-type]
        epsilon=epsilon, gamma=gamma, p_scale=p_scale, rho=rho, alpha=alpha,  # type: ignore[arg-type]
        pi_overshoot=pi_overshoot, pi_settling=pi_settling, pi_gains=pair("--pi-gains", pi_gains, "21,360"),
        anti_windup=anti_windup,  # type: ignore[arg-type]
        duty_limits=pair("--duty-limits", duty_limits, "0,100"), rate_hz=rate_hz, pwm_hz=pwm_hz, optimize=optimize,
        optimize_for=optimize_for,  # type: ignore[arg-type]
        optimize_also=names(optimize_also), plants=plants, noise_nm=noise_nm, chatter_limit=chatter_limit,
        evaluations=evaluations, allow_unidentified=allow_unidentified, seed=seed,
    )  # fmt: skip
    fitted, told = codec.read(fit, "fit", Fit)
    judge = stiffness_judge(fitted) if optimize_for == "stiffness" else None
    logs = _logs(fitted, fit, data, options)
    signal = read_reference(own) if own is not None else reference
    gains = tune(fitted, options, logs, signal, reference or "", console.progress, judge)
    sources = {"fit": fit, **({"reference": own} if own else {})}
    kept = GainsInputs(**{role: Input.of(each) for role, each in sources.items()})
    gains = msgspec.structs.replace(gains, inputs=kept)
    codec.write(path, gains, "gains", force)
    if json:
        print(codec.dumps(gains, "gains"), end="")
    else:
        gains_tables.show(gains, verbose)
    console.tell([*gains.findings, *told], verbose)
    console.say(f"wrote {path}")


def _logs(fitted: "Fit", fit: Path, data: list[Path] | None, options: "TuneOptions") -> "StepSet | None":
    """The logs given, or those that the fit names, where they are still there and unchanged."""
    from eaid.cli import inputs
    from eaid.errors import EaidError
    from eaid.files import sha256_of

    if data:
        return inputs.stepset_from(data)
    wants = {"φ": options.phi == "data", "the noise": options.searches and options.noise_nm is None}
    wanted = " and ".join(name for name, asked in wants.items() if asked)
    if not wanted:
        return None
    instead = f"so {wanted} cannot be read off them; give the logs with --data"
    if not fitted.data.inputs:
        console.warn(f"{fit}: names no logs, {instead}")
        return None
    paths = []
    for record in fitted.data.inputs:
        told = Path(record.path)
        found = next((path for path in (told, fit.parent / told.name) if path.is_file()), None)
        if found is None or sha256_of(found) != record.sha256:
            console.warn(f"{told}: is gone or has changed, {instead}")
            return None
        paths.append(found)
    try:
        return inputs.stepset_from(paths)
    except EaidError as fault:
        console.warn(f"{fault.sentences[0]}: {instead}")
        return None
