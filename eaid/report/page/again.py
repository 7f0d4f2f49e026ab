"""How to make the same files again: command lines, as far as the results tell."""

import shlex

import msgspec

from eaid.report.results import Results
from eaid.results.fit import Fit, FitOptionsRecord
from eaid.results.gains import Gains
from eaid.results.replay import Replay, RigRecord
from eaid.results.tuning import TuneOptions

FIT = {
    "models": "--model", "share": "--share", "weights": "--weights", "loss": "--loss", "hold_out": "--hold-out",
    "bounds": "--bounds", "bounds_levels": "--bounds-levels", "estimator": "--estimator", "ci": "--ci",
    "shape": "--shape",
}  # fmt: skip
"""Option of a fit → its flag; left out where it is the default."""


def commands(results: Results) -> list[str]:
    """Command lines that make these files again, as far as they tell."""
    lines = [f"eaid ingest LOGS -o {shlex.quote(data.path)}" for data in results.data]
    for fit in results.fits:
        kind = fit.result.data.kind
        named = [data.path for data in results.data if data.result.kind == kind]
        behind = list(dict.fromkeys(one.path for one in (fit.result.data.inputs or fit.result.data.sources)))
        given = " ".join(shlex.quote(path) for path in (named[:1] or behind[:6])) or "LOGS"
        lines.append(f"eaid fit {given} -o {shlex.quote(fit.path)}{_fit_options(fit.result)}")
    clutch = next((fit.path for fit in results.fits if fit.result.data.kind == "clutch"), "fit.json")
    model = shlex.quote(clutch)
    lines += [f"eaid tune-rc {model} -o {shlex.quote(one.path)}{_tune_options(one.result)}" for one in results.gains]
    with_gains = f" --gains {shlex.quote(results.gains[0].path)}" if results.gains else ""
    lines += [_simulate(model, with_gains, one.result, shlex.quote(one.path)) for one in results.replays]
    lines.append("eaid report " + " ".join(shlex.quote(source.path) for source in results.sources) + " -o report")
    return lines


def _simulate(model: str, with_gains: str, replay: Replay, path: str) -> str:
    head = replay.head
    if head.scenario == "log":
        logs = " ".join(shlex.quote(one.path) for one in head.inputs.log) or "LOGS"
        return f"eaid simulate {model} --log {logs} -o {path}"
    names = ",".join(name for name, one in replay.records.items() if one.role == "controller")
    more = " --best" if any(one.role == "best" for one in replay.records.values()) else ""
    more += f" --plants {head.plants}" if head.plants else ""
    more += _rig(head.rig)
    if head.perturb:
        more += " --perturb " + ",".join(f"{name}={value:g}" for name, value in head.perturb.items())
    more += f" --seed {head.seed}" if head.seed else ""
    own = shlex.quote(head.inputs.reference.path) if head.inputs.reference is not None else "FILE"
    scenario = f"--reference {own}" if head.scenario == "reference" else f"--scenario {shlex.quote(head.scenario)}"
    return f"eaid simulate {model}{with_gains} {scenario} --controller {shlex.quote(names)}{more} -o {path}"


def _rig(rig: RigRecord) -> str:
    """The rig's own effects, as typed."""
    if rig.noise_coloured_share < 1:  # only residuals have noise of two kinds
        rig = msgspec.structs.replace(rig, noise_nm=0.0, noise_correlation_s=0.0)
        said = " --noise residuals"
    else:
        said = ""
    for name in ("noise_nm", "noise_correlation_s", "ripple_pct", "sensor_hz", "delay_samples", "pwm_hz", "duty_bits"):
        value = getattr(rig, name)
        said += f" --{name.replace('_', '-')} {value:g}" if value else ""
    said += f" --ripple-hz {rig.ripple_hz:.9g}" if rig.ripple_pct else ""
    return said if rig.saturation else f"{said} --no-saturation"


def _fit_options(fit: Fit) -> str:
    """The options that differ from their defaults, as typed; reading options and the seed too."""
    usual, said = FitOptionsRecord(), ""
    for key, flag in FIT.items():
        value = getattr(fit.options, key)
        if value is not None and value != getattr(usual, key):
            said += f" {flag} {shlex.quote(_text(value))}"
    for key, value in fit.options.reading.items():
        flag = f" --{key.replace('_', '-')}"
        if value is True:
            said += flag
        elif value not in (None, False, ""):
            said += f"{flag} {shlex.quote(_text(value))}"
    return f"{said} --seed {fit.seed}" if fit.seed else said


def _text(value: object) -> str:
    if isinstance(value, tuple):
        return ",".join(_text(one) for one in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def _tune_options(gains: Gains) -> str:
    """The options that differ from their defaults, as typed, with the reference and the seed."""
    said, options = "", gains.options or TuneOptions()
    for one in msgspec.structs.fields(TuneOptions):
        value = getattr(options, one.name)
        flag = f" --{one.name.replace('_', '-')}"
        if value is True:
            said += flag
        elif value is not None and value is not False and value != one.default and one.name != "seed":
            said += f"{flag} {shlex.quote(_text(value))}"
    if gains.inputs.reference is not None:
        said += f" --reference {shlex.quote(gains.inputs.reference.path)}"
    elif gains.rc is not None and gains.rc.reference_slope_nm_s is not None and gains.replayed is not None:
        said += f" --reference {shlex.quote(gains.replayed.reference)}"
    return f"{said} --seed {gains.seed}" if gains.seed else said
