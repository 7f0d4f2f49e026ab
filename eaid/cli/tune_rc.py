"""`eaid tune-rc`: a fit → gains of both controllers, and what may be expected of them."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from eaid.cli import console, gains_tables, tune_search
from eaid.cli.options import Force, Json, Output, Quiet, Seed
from eaid.errors import DataError, EaidError, UsageError

if TYPE_CHECKING:
    from eaid.control.options import DesignOptions
    from eaid.replay.references import Reference
    from eaid.steps.stepset import StepSet

FitFile = Annotated[Path, typer.Argument(metavar="FIT", help="fit.json of eaid fit; only its linear part is needed.")]
BoundsOption = Annotated[
    str | None,
    typer.Option("--bounds", help="b0 of one level: zero-offset, pooled-offset, pooled-dynamics; default: the fit's."),
]
Levels = Annotated[str | None, typer.Option("--levels", help="Levels that B_m, B_M are taken over: 30:100 or 30,40.")]
Widen = Annotated[bool, typer.Option("--widen-bounds", help="Take the far ends of the 95 % intervals of B.")]
BHat = Annotated[str, typer.Option("--b-hat", help="B̂: pooled (1/b0), minimax, or a value [%·s/(N·m)].")]
Kp = Annotated[float | None, typer.Option("--kp", help="K_P [1/s²]; default 4.5.")]
Kd = Annotated[float | None, typer.Option("--kd", help="K_D [1/s]; default 3.")]
Frequency = Annotated[
    float | None, typer.Option("--natural-frequency", help="In place of --kp, --kd: ω_n [rad/s], with --damping.")
]
Damping = Annotated[float | None, typer.Option("--damping", help="In place of --kp, --kd: damping ratio.")]
QMax = Annotated[float | None, typer.Option("--q-max", help="Q_M, largest slope of the reference [N·m/s]; default 5.")]
ReferenceOption = Annotated[
    str | None,
    typer.Option(
        "--reference", help="CSV time_s,reference_nm, or multisine or steps: Q_M is taken from it, or judged."
    ),
]
Phi = Annotated[str, typer.Option("--phi", help="φ in the reading's own number, or data: what model and logs show.")]
Data = Annotated[
    list[Path] | None, typer.Option("--data", help="Logs or data.h5 for --phi data; default: those the fit names.")
]
Epsilon = Annotated[float, typer.Option("--epsilon", help="ε, half width of the boundary layer.")]
Gamma = Annotated[float, typer.Option("--gamma", help="γ, sharpness of the soft switch.")]
PScale = Annotated[float, typer.Option("--p-scale", help="p of P = p·I in the Lyapunov equation.")]
Rho = Annotated[str, typer.Option("--rho", help="Reading of Eq. (15): paper (B_M φ) or textbook (φ/B_m).")]
Alpha = Annotated[str, typer.Option("--alpha", help="α that ρ is made with: formula, or the one really reached.")]
Overshoot = Annotated[float | None, typer.Option("--pi-overshoot", help="PI: overshoot on the linear model [%].")]
Settling = Annotated[float | None, typer.Option("--pi-settling", help="PI: settling time, 2 % band [s].")]
PIGainsOption = Annotated[str | None, typer.Option("--pi-gains", help="PI: K_P,K_I; default 21,360.")]
AntiWindup = Annotated[str, typer.Option("--anti-windup", help="conditional (integration) or back-calculation.")]
Limits = Annotated[
    str | None, typer.Option("--duty-limits", help="Lowest and highest duty of the actuator [%]; default 0,100.")
]
RateHz = Annotated[float | None, typer.Option("--rate-hz", help="Control rate [Hz]; default: the fit's, else 1000.")]
PwmHz = Annotated[
    float | None, typer.Option("--pwm-hz", help="Duty latched at this rate [Hz]; default: the fit's, else 300; 0: off.")
]
Optimize = Annotated[
    bool, typer.Option("--optimize", help="Choose P's scale, ε and φ for the least RMS error on the reference.")
]
Also = Annotated[
    str | None,
    typer.Option("--optimize-also", help="Chosen too, with commas: frequency (ω_n), b-hat. Implies --optimize."),
]
Plants = Annotated[int, typer.Option("--plants", help="Plants drawn from the fit's uncertainty for --optimize.")]
NoiseNm = Annotated[
    float | None, typer.Option("--noise-nm", help="Torque noise of --optimize, sd [N·m]; default: what the logs show.")
]
ChatterLimit = Annotated[
    float | None,
    typer.Option(
        "--chatter-limit", help="Most mean |Δu| per sample [%]; default: that of the gains before --optimize."
    ),
]
Evaluations = Annotated[int, typer.Option("--evaluations", help="Candidates of --optimize after the first scatter.")]
Unidentified = Annotated[
    bool, typer.Option("--allow-unidentified", help="Use a fit that is marked not identifiable; the result is marked.")
]


def command(
    fit: FitFile,
    bounds: BoundsOption = None,
    levels: Levels = None,
    widen_bounds: Widen = False,
    b_hat: BHat = "pooled",
    kp: Kp = None,
    kd: Kd = None,
    natural_frequency: Frequency = None,
    damping: Damping = None,
    q_max: QMax = None,
    reference: ReferenceOption = None,
    phi: Phi = "0.05",
    data: Data = None,
    epsilon: Epsilon = 0.5,
    gamma: Gamma = 50.0,
    p_scale: PScale = 5.0,
    rho: Rho = "paper",
    alpha: Alpha = "formula",
    pi_overshoot: Overshoot = None,
    pi_settling: Settling = None,
    pi_gains: PIGainsOption = None,
    anti_windup: AntiWindup = "conditional",
    duty_limits: Limits = None,
    rate_hz: RateHz = None,
    pwm_hz: PwmHz = None,
    optimize: Optimize = False,
    optimize_also: Also = None,
    plants: Plants = 16,
    noise_nm: NoiseNm = None,
    chatter_limit: ChatterLimit = None,
    evaluations: Evaluations = 160,
    allow_unidentified: Unidentified = False,
    output: Output = None,
    json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
    seed: Seed = 0,
) -> None:
    """Gains of the robust controller and of a PI from a fit, with the guarantee checked, margins and warnings.

    Exit code 5: the fit or the wishes are not physical, out of reach, or unstable on the linear model.
    """
    console.be_quiet(quiet)
    from eaid.files import refuse_to_overwrite

    path = output or Path("gains.json")
    refuse_to_overwrite(path, force)
    chosen = {
        "--b-hat": None, "--rho": (rho, ("paper", "textbook")), "--alpha": (alpha, ("formula", "reached")),
        "--anti-windup": (anti_windup, ("conditional", "back-calculation")),
    }  # fmt: skip
    for name, choice in chosen.items():
        if choice is not None and choice[0] not in choice[1]:
            raise UsageError(f"{name} {choice[0]}: must be one of {', '.join(choice[1])}")
    K_P, K_D = _proportional(kp, kd, natural_frequency, damping)

    from eaid import store
    from eaid.control.design import design
    from eaid.control.options import DesignOptions, PIOptions

    fitted = store.read_json(fit, "fit", console.warn)
    _refuse_unidentified(fitted, fit, allow_unidentified)
    timing = _timing(fitted, rate_hz, pwm_hz)
    wanted, reference_name = _reference(reference, 1 / timing.rate_hz)
    slope = None if wanted is None else _slope(wanted)
    options = DesignOptions(
        convention=bounds, levels=levels, widen=widen_bounds, B_hat=_b_hat(b_hat), K_P=K_P, K_D=K_D,
        Q_M=q_max if q_max is not None else (slope if slope is not None else 5.0),
        phi=0.05 if phi == "data" else _number("--phi", phi), epsilon=epsilon, gamma=gamma, p_scale=p_scale,
        reading=rho, alpha=alpha,  # type: ignore[arg-type]
        pi=PIOptions(_pair("--pi-gains", pi_gains) if pi_gains else None, pi_overshoot, pi_settling),
        anti_windup=anti_windup,  # type: ignore[arg-type]
        duty_limits_pct=_limits(fitted, duty_limits), timing=timing,
    )  # fmt: skip
    optimize = optimize or optimize_also is not None
    wants = {"φ": phi == "data", "the noise": optimize and noise_nm is None}
    wanted_for = " and ".join(name for name, asked in wants.items() if asked)
    stepset = _logs(fitted, fit, data, wanted_for) if data or wanted_for else None
    if phi == "data":
        options = _with_phi_from(fitted, options, str(fit), stepset)
    told_of_search = None
    if optimize:
        noise = (noise_nm, "given") if noise_nm is not None else tune_search.noise_of(fitted, stepset)
        search = tune_search.search_of(noise[0], chatter_limit, optimize_also, evaluations, seed)
        options, told_of_search = tune_search.optimized(fitted, options, str(fit), wanted, search, plants)
        told_of_search = {"reference": reference_name, "noise_source": noise[1], **told_of_search}
    result = design(fitted, options, str(fit), stepset, slope)
    if told_of_search is not None:
        result["optimized"] = told_of_search
        result["warnings"] += told_of_search.pop("warnings")
    _add_replay(result, fitted, wanted, reference_name, 1 / timing.rate_hz)
    if allow_unidentified and _unidentified(fitted):
        result["warnings"].insert(0, f"made from a fit that is not identifiable: {_unidentified(fitted)}")
        result["unidentified"] = _unidentified(fitted)
    inputs = {"fit": store.input_record(fit)}
    if reference is not None and reference_name not in NAMED:
        inputs["reference"] = store.input_record(Path(reference))
    units = [(fitted.get("data") or {}).get(key) or usual for key, usual in UNITS.items()]
    if units != list(UNITS.values()):
        result["warnings"].insert(
            0, f"input in {units[0]}, output in {units[1]}: read them wherever this says % duty and N·m"
        )
    told = {"inputs": inputs, "options": _told(options, phi, allow_unidentified), "seed": seed}
    result = store.stamped("eaid/gains/1", {**told, **result})
    store.write_json(path, result, force)
    if json:
        console.print_json(result)
    else:
        gains_tables.show(result)
    for warning in result["warnings"]:
        console.warn(warning)
    console.say(f"wrote {path}")


UNITS = {"input_unit": "%", "output_unit": "N·m"}
"""Units that gains are in where the fit says nothing else."""
NAMED = ("multisine", "steps")
"""References that need no file."""


def _proportional(
    kp: float | None, kd: float | None, natural_frequency: float | None, damping: float | None
) -> tuple[float, float]:
    if natural_frequency is None and damping is None:
        return (4.5 if kp is None else kp), (3.0 if kd is None else kd)
    if kp is not None or kd is not None:
        raise UsageError("give either --kp and --kd, or --natural-frequency and --damping, not both")
    if natural_frequency is None or damping is None:
        raise UsageError("--natural-frequency and --damping belong together: give both")
    from eaid.control.robust import damping_gains

    if not (natural_frequency > 0 and damping > 0):
        raise UsageError("--natural-frequency and --damping must be above 0")
    return damping_gains(natural_frequency, damping)


def _number(option: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"{option} {text}: is no number") from None


def _pair(option: str, text: str) -> tuple[float, float]:
    numbers = [_number(option, part) for part in text.split(",")]
    if len(numbers) != 2:
        raise UsageError(f"{option} {text}: write two numbers with a comma between them, as 21,360")
    return numbers[0], numbers[1]


def _limits(fitted: dict[str, Any], text: str | None) -> tuple[float, float]:
    """Limits of the input: 0…100 % of a duty; of another input what was identified, unless they are given."""
    data = fitted.get("data") or {}
    unit = data.get("input_unit") or "%"
    highest = float(max(data.get("levels") or [100.0]))
    is_duty = unit == "%" and highest <= 100
    if text is not None:
        low, high = _pair("--duty-limits", text)
        if is_duty and high > 100:
            raise UsageError(f"--duty-limits {text}: a duty ends at 100 %")
        return low, high
    if is_duty:
        return 0.0, 100.0
    console.warn(f"the input is no duty (levels up to {highest:g} {unit}): limits 0,{highest:g}; give --duty-limits")
    return 0.0, highest


def _b_hat(text: str) -> Any:
    if text in ("pooled", "minimax"):
        return text
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"--b-hat {text}: must be pooled, minimax or a number") from None


def _timing(fitted: dict[str, Any], rate_hz: float | None, pwm_hz: float | None) -> Any:
    from eaid.control.margins import Timing

    rig = (fitted.get("data") or {}).get("apparatus") or {}
    rate = rate_hz if rate_hz is not None else float(rig.get("sample_rate_hz") or 1000.0)
    pwm = pwm_hz if pwm_hz is not None else float(rig.get("pwm_hz") or 300.0)
    if not rate > 0:
        raise UsageError(f"--rate-hz {rate:g}: must be above 0")
    if pwm < 0:
        raise UsageError(f"--pwm-hz {pwm:g}: must be 0 or above")
    return Timing(rate, pwm or None)


def _reference(reference: str | None, dt_s: float) -> "tuple[Reference | None, str]":
    from eaid.replay import references

    if reference is None:
        return None, "multisine"
    if reference == "multisine":
        return references.multisine(dt_s), reference
    if reference == "steps":
        return references.steps(dt_s), reference
    return references.from_file(Path(reference), dt_s), reference


def _slope(reference: "Reference") -> float:
    from eaid.replay.standard import steepest_nm_s

    return steepest_nm_s(reference)


def _logs(fitted: dict[str, Any], fit: Path, data: list[Path] | None, wanted_for: str) -> "StepSet | None":
    """The logs given, or those that the fit names, where they are still there and unchanged."""
    from eaid.cli import inputs
    from eaid.files import sha256_of

    if data:
        return inputs.stepset_from(data)
    instead = f"so {wanted_for} cannot be read off them; give the logs with --data"
    named = (fitted.get("data") or {}).get("inputs") or []
    if not named:
        console.warn(f"{fit}: names no logs, {instead}")
        return None
    paths = []
    for record in named:
        told = Path(str(record.get("path")))
        found = next((path for path in (told, fit.parent / told.name) if path.is_file()), None)
        if found is None or sha256_of(found) != record.get("sha256"):
            console.warn(f"{told}: is gone or has changed, {instead}")
            return None
        paths.append(found)
    try:
        return inputs.stepset_from(paths)
    except EaidError as fault:
        console.warn(f"{fault.sentences[0]}: {instead}")
        return None


def _with_phi_from(
    fitted: dict[str, Any], options: "DesignOptions", source: str, stepset: "StepSet | None"
) -> "DesignOptions":
    from dataclasses import replace

    from eaid.control.bounds import bounds_of, model_of
    from eaid.control.design import least_phi_pct, mismatches, plant_of

    model = model_of(fitted, source)
    found = mismatches(
        model, bounds_of(fitted, source, options.convention, options.levels, options.widen), plant_of(fitted), stepset
    )
    least = least_phi_pct(found)
    if least is None:
        raise DataError(
            f"{source}: holds neither a nonlinear model nor fits of single levels, so --phi data has nothing to look at"
        )
    return replace(options, phi_honest_pct=least.pct)


def _add_replay(
    result: dict[str, Any], fitted: dict[str, Any], wanted: "Reference | None", name: str, dt_s: float
) -> None:
    """The replayed errors beside the ultimate bound, where the fit has a plant to replay on."""
    from eaid.control.design import plant_of
    from eaid.control.gains import pi_from_json, rc_from_json
    from eaid.models.nonlinear import steady_torque
    from eaid.replay.references import multisine
    from eaid.replay.standard import beside_the_bound

    plant = plant_of(fitted)
    if plant is None:
        result["warnings"].append("the fit holds no nonlinear model, so no error is replayed beside the ultimate bound")
        return
    reference = wanted if wanted is not None else multisine(dt_s)
    most, highest = float(reference.torque_nm.max()), float(steady_torque(plant, plant.u_range[1]))
    if most > highest:
        result["warnings"].append(
            f"the {name} asks for up to {most:.3g} N·m, the fitted plant makes {highest:.3g} N·m at most: its errors "
            "say nothing about the gains; give a --reference within reach"
        )
    told = beside_the_bound(plant, rc_from_json(result), pi_from_json(result), reference, name)
    result["replayed"] = told
    result["rc"]["ultimate_bound"]["replayed_nm"] = told["rc"]["max_abs_error_nm"]
    if wanted is None and told["slope_nm_s"] > result["rc"]["Q_M"] * (1 + 1e-9):
        result["warnings"].append(
            f"Q_M does not hold for the {name}: it rises at up to {told['slope_nm_s']:.4g} N·m/s, "
            f"Q_M is {result['rc']['Q_M']:g} N·m/s; --reference {name} takes it from there"
        )


def _unidentified(fitted: dict[str, Any]) -> str:
    """Why a fit says that its linear model, which gains rest on, is not identifiable; empty where it does not."""
    linear = fitted.get("linear")
    if not isinstance(linear, dict) or linear.get("identifiable") is not False:
        return ""
    from eaid.fitting.stored import not_identifiable_because

    return "; ".join(not_identifiable_because(fitted, "linear"))


def _refuse_unidentified(fitted: dict[str, Any], fit: Path, allowed: bool) -> None:
    said = _unidentified(fitted)
    if said and not allowed:
        raise DataError(f"{fit}: the linear model is not identifiable ({said}); --allow-unidentified uses it, marked")


def _told(options: "DesignOptions", phi: str, allow_unidentified: bool) -> dict[str, Any]:
    from dataclasses import asdict

    return {**asdict(options), "phi": phi if phi == "data" else options.phi, "allow_unidentified": allow_unidentified}
