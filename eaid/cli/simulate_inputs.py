"""What `eaid simulate` is given: the plant and the controllers' gains, the reference, the rig's noise."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from eaid.cli import console
from eaid.errors import DataError, UsageError

if TYPE_CHECKING:
    from eaid.replay.controllers import Knowledge
    from eaid.replay.references import Reference
    from eaid.replay.rehab import Rehabilitation


def files(fit: Path, gains: Path | None) -> tuple[dict[str, Any], dict[str, Any]]:
    """fit.json and gains.json as read; an empty gains.json where none is given."""
    from eaid.store import read_json

    fitted = read_json(fit, "fit", console.warn)
    if not fitted.get("nonlinear"):
        raise DataError(f"{fit}: holds no nonlinear model, which the replay's plant is; fit clutch data with it")
    return fitted, read_json(gains, "gains", console.warn) if gains else {}


def unidentified(fitted: dict[str, Any], given: dict[str, Any]) -> dict[str, str]:
    """What of a replay stands on a fit that its data do not determine, and why; each told."""
    from eaid.fitting.stored import not_identifiable_because

    said: dict[str, str] = {}
    if given.get("unidentified"):
        said["gains"] = str(given["unidentified"])
        console.warn(f"gains made with --allow-unidentified ({said['gains']}): the replay is marked")
    part = fitted["nonlinear"]
    if part.get("identifiable") is False:
        said["plant"] = "; ".join(not_identifiable_because(fitted, "nonlinear"))
        console.warn(
            f"the nonlinear model is not identifiable ({said['plant']}): the replay shows that model, not the clutch; "
            "it is marked"
        )
    return said


def knowledge(fitted: dict[str, Any], given: dict[str, Any], gains: Path | None) -> "Knowledge":
    """What the controllers are made from; what is missing in the files stays None."""
    from eaid.control.gains import pi_from_json, rc_from_json
    from eaid.fitting.stored import linear_from_json, nonlinear_from_json
    from eaid.replay.controllers import Knowledge

    linear = None
    for source in (fitted.get("linear"), given.get("model")):
        if linear is None and isinstance(source, dict) and "a0" in source:
            linear = linear_from_json({"linear": source})
    return Knowledge(
        nonlinear_from_json(fitted),
        linear,
        rc_from_json(given, str(gains)) if given.get("rc") else None,
        pi_from_json(given, str(gains)) if given.get("pi") else None,
    )


def names(controllers: str | None, scenario: str, known: "Knowledge") -> list[str]:
    """The controllers to replay; by default those that the files allow."""
    if controllers is not None:
        names = [name.strip() for name in controllers.split(",") if name.strip()]
        if not names or len(set(names)) < len(names):
            raise UsageError(f"--controller is {controllers!r}; name each controller once, with commas between")
        if "open-loop" in names and known.linear is None:
            console.warn("no linear model, so open-loop takes the straight line through the plant's steady torque")
        return names
    names = [name for name, held in (("rc", known.rc), ("pi", known.pi)) if held is not None]
    if scenario == "sweep" and known.linear is not None:
        names.append("open-loop")
    if not names:
        console.warn("no --gains, so rc and pi are left out; the controllers that need none are replayed")
        names = ["open-loop", "inverse"] if known.linear is not None else ["inverse"]
    return names


def reference(name: str, path: Path | None, dt_s: float, duration_s: float | None) -> "Reference":
    """The scenario's reference, or the user's own."""
    from eaid.replay.references import from_file
    from eaid.replay.scenarios import SCENARIOS

    if path is not None:
        if duration_s is not None:
            raise UsageError("--duration does not go with --reference; the file says how long it is")
        return from_file(path, dt_s)
    if name not in SCENARIOS:
        raise UsageError(f"no scenario {name!r}; there are {', '.join(SCENARIOS)}, rehab")
    return SCENARIOS[name].reference(dt_s, duration_s)


def exercise(duration_s: float | None, damping: float | None, inertia: float | None) -> "Rehabilitation":
    """The rehabilitation's own defaults where the user says nothing; the three modes are of one length."""
    from eaid.replay.rehab import MODES, Rehabilitation

    mode_s = None if duration_s is None else duration_s / len(MODES)
    said = {"mode_s": mode_s, "damping_nms": damping, "inertia_kgm2": inertia}
    return Rehabilitation(**{key: value for key, value in said.items() if value is not None})


def factors(text: str | None) -> dict[str, float]:
    """`Ts=0.9,tau1=1.2` as numbers."""
    factors: dict[str, float] = {}
    for part in (text or "").split(","):
        name, _, value = part.partition("=")
        if not part.strip():
            continue
        try:
            factors[name.strip()] = float(value)
        except ValueError:
            raise UsageError(f"--perturb has {part.strip()!r}; write factors as Ts=0.9,tau1=1.2") from None
    return factors


def noise_of(text: str, fitted: dict[str, Any], fit: Path) -> dict[str, float]:
    """`--noise residuals` as settings of the rig."""
    from eaid.replay.residual_noise import residual_noise

    if text != "residuals":
        raise UsageError(f"--noise is {text!r}; there is residuals (coloured as the fit's), and --noise-nm for white")
    found = residual_noise(fitted)
    if isinstance(found, str):
        raise DataError(f"{fit}: {found}")
    said = f"{found['noise_nm']:.3g} N·m, {100 * found['noise_coloured_share']:.0f} % of its power with a memory of "
    console.say(f"noise as the fit's residuals: {said}{found['noise_correlation_s']:.3g} s")
    return found


def doubts(reference: "Reference", highest_nm: float, given: dict[str, Any]) -> None:
    """Warn where a reference asks for more than the plant has, or is steeper than Q_M."""
    import numpy as np

    top = float(reference.torque_nm.max())
    if top > highest_nm:
        console.warn(f"the reference goes to {top:.3g} N·m, the plant at its highest duty to {highest_nm:.3g} N·m")
    steepest = (given.get("rc") or {}).get("Q_M")
    if isinstance(steepest, int | float) and not reference.steps:
        slope = float(np.abs(np.gradient(reference.torque_nm, reference.dt_s)).max())
        if slope > steepest * (1 + 1e-9):
            console.warn(
                f"the reference is as steep as {slope:.3g} N·m/s; the gains were made for Q_M = {steepest:g} N·m/s"
            )
