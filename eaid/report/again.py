"""How to make the same files again: command lines, as far as the files tell."""

import shlex
from collections.abc import Mapping
from typing import Any

from eaid.report.results import Results

FIT: dict[str, tuple[str, Any]] = {
    "share": ("--share", 0.85),
    "weights": ("--weights", "equal"),
    "loss": ("--loss", "squares"),
    "hold_out": ("--hold-out", []),
    "bounds": ("--bounds", "zero-offset"),
    "bounds_levels": ("--bounds-levels", None),
    "estimator": ("--estimator", "joint"),
    "ci": ("--ci", "robust"),
}
"""Option in a fit.json → flag and default of `eaid fit`."""
TUNE: dict[str, tuple[str, Any]] = {
    "K_P": ("--kp", 4.5),
    "K_D": ("--kd", 3.0),
    "Q_M": ("--q-max", 5.0),
    "phi": ("--phi", 0.05),
    "epsilon": ("--epsilon", 0.5),
    "gamma": ("--gamma", 50.0),
    "p_scale": ("--p-scale", 5.0),
    "B_hat": ("--b-hat", "pooled"),
    "reading": ("--rho", "paper"),
}
"""Option in a gains.json → flag and default of `eaid tune-rc`."""


def commands(results: Results) -> list[str]:
    """Command lines that make these files again, as far as the files tell."""
    lines = [f"eaid ingest LOGS -o {shlex.quote(data.source.path)}" for data in results.data]
    for fit in results.fits:
        named = [data.source.path for data in results.data if data.steps.kind == fit.kind]
        behind = list(
            dict.fromkeys(
                str(item.get("path", ""))
                for item in (fit.content.get("data") or {}).get("sources") or []
                if isinstance(item, Mapping)
            )
        )
        given = " ".join(shlex.quote(path) for path in (named[:1] or behind[:6])) or "LOGS"
        lines.append(f"eaid fit {given} -o {shlex.quote(fit.source.path)}{_options(fit.content, FIT)}")
    clutch = results.fit("clutch")
    model = shlex.quote(clutch.source.path) if clutch else "fit.json"
    lines += [
        f"eaid tune-rc {model} -o {shlex.quote(gains.source.path)}{_options(gains.content, TUNE)}"
        for gains in results.gains
    ]
    with_gains = f" --gains {shlex.quote(results.gains[0].source.path)}" if results.gains else ""
    for replay in results.replays:
        if replay.scenario == "log":
            lines.append(f"eaid simulate {model} --log LOGS -o {shlex.quote(replay.source.path)}")
            continue
        names = ",".join(name for name in replay.traces if name != "best")
        more = " --best" if "best" in replay.traces else ""
        more += f" --plants {replay.options['plants']}" if isinstance(replay.options.get("plants"), int) else ""
        own = replay.scenario == "reference"
        scenario = " --reference FILE" if own else f" --scenario {shlex.quote(replay.scenario)}"
        seed = f" --seed {replay.options['seed']}" if isinstance(replay.options.get("seed"), int) else ""
        lines.append(
            f"eaid simulate {model}{with_gains}{scenario} --controller {shlex.quote(names)}{more}{seed} -o "
            f"{shlex.quote(replay.source.path)}"
        )
    lines.append("eaid report " + " ".join(shlex.quote(source.path) for source in results.sources) + " -o report")
    return lines


def _options(content: Mapping[str, Any], flags: Mapping[str, tuple[str, Any]]) -> str:
    """The options that differ from their defaults, as typed; and the seed."""
    options = content.get("options")
    said = ""
    for key, (flag, default) in flags.items():
        value = options.get(key, default) if isinstance(options, Mapping) else default
        if value != default and value not in (None, []):
            several = value if isinstance(value, list) and all(isinstance(v, int | float) for v in value) else None
            text = str(value) if several is None else ",".join(f"{part:g}" for part in several)
            said += f" {flag} {shlex.quote(text)}"
    seed = content.get("seed")
    return f"{said} --seed {seed}" if isinstance(seed, int) and not isinstance(seed, bool) else said
