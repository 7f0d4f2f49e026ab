"""How to make the same files again: command lines, as far as the results tell."""

import shlex

from eaid.report.results import Results
from eaid.results.fit import Fit, FitOptionsRecord
from eaid.results.gains import Gains
from eaid.results.replay import Replay

FIT = {
    "models": "--model", "share": "--share", "weights": "--weights", "loss": "--loss", "hold_out": "--hold-out",
    "bounds": "--bounds", "bounds_levels": "--bounds-levels", "estimator": "--estimator", "ci": "--ci",
    "shape": "--shape",
}  # fmt: skip
"""Option of a fit → its flag; left out where it is the default."""
TUNE = {"K_P": ("--kp", 4.5), "K_D": ("--kd", 3.0), "Q_M": ("--q-max", 5.0), "phi": ("--phi", 0.05),
        "epsilon": ("--epsilon", 0.5), "gamma": ("--gamma", 50.0)}  # fmt: skip
"""Choice of the robust controller → flag and default of `eaid tune-rc`."""


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
        return f"eaid simulate {model} --log LOGS -o {path}"
    names = ",".join(name for name, one in replay.records.items() if one.role == "controller")
    more = " --best" if any(one.role == "best" for one in replay.records.values()) else ""
    more += f" --plants {head.plants}" if head.plants else ""
    more += f" --seed {head.seed}" if head.seed else ""
    scenario = "--reference FILE" if head.scenario == "reference" else f"--scenario {shlex.quote(head.scenario)}"
    return f"eaid simulate {model}{with_gains} {scenario} --controller {shlex.quote(names)}{more} -o {path}"


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
    said = ""
    for key, (flag, usual) in TUNE.items():
        value = getattr(gains.rc, key) if gains.rc is not None else None
        if value is not None and abs(value - usual) > 1e-12:
            said += f" {flag} {value:.6g}"
    if gains.pi is not None and gains.pi.asked is not None:
        for flag, asked in (("overshoot", gains.pi.asked.overshoot_pct), ("settling", gains.pi.asked.settling_s)):
            said += f" --pi-{flag} {asked:g}" if asked is not None else ""
    return f"{said} --seed {gains.seed}" if gains.seed else said
