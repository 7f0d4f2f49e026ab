"""An excitation from a text, and the controller that drives a closed loop."""

from dataclasses import fields, replace
from pathlib import Path

from eaid.control.gains import pi_gains, rc_gains
from eaid.control.pi import PIGains, pi_start, pi_step
from eaid.control.rc import rc_start, rc_step
from eaid.errors import UsageError, unknown
from eaid.reading import pairs
from eaid.replay.controllers import Controller
from eaid.results import codec
from eaid.results.gains import Gains
from eaid.synth.excitation import Excitation

PAIRS = ("hold_s", "frequency_hz", "reference_nm", "gains", "duty")


def excitation_of(kind: str, shape: str | None) -> Excitation:
    """`duration_s=240,hold_s=0.5:20` as an excitation."""
    plain = Excitation(kind)
    known = {one.name for one in fields(Excitation)} - {"kind", "low_pct", "high_pct"} | {"duty"}
    given: dict[str, float | int | tuple[float, float] | PIGains] = {}
    for name, text in pairs("«shape»", shape).items():
        if name not in known:
            raise UsageError(unknown("«shape»", name, sorted(known)))
        try:
            values = [float(part) for part in text.split(":")]
        except ValueError:
            raise UsageError(f"«shape» {name}={text}: give a number, or two with a colon between") from None
        if len(values) != (2 if name in PAIRS else 1):
            raise UsageError(f"«shape» {name}={text}: give {'two numbers, as 1:2' if name in PAIRS else 'one number'}")
        if name == "duty":
            given["low_pct"], given["high_pct"] = values
        elif name == "gains":
            given["gains"] = PIGains(*values)
        elif name in PAIRS:
            given[name] = (values[0], values[1])
        else:
            whole = isinstance(getattr(plain, name), int)
            if whole and not values[0].is_integer():
                raise UsageError(f"«shape» {name}={text}: give a whole number")
            given[name] = int(values[0]) if whole else values[0]
    return replace(plain, **given)  # type: ignore[arg-type]


def controller_of(gains: Path | None, name: str) -> Controller | None:
    """The controller of a gains.json that drives a closed loop."""
    if gains is None:
        return None
    stored, _ = codec.read(gains, "gains", Gains)
    if name == "rc" and (rc := rc_gains(stored)) is not None:
        return Controller("rc", rc_step, rc, rc_start())
    if name == "pi" and (pi := pi_gains(stored)) is not None:
        return Controller("pi", pi_step, pi, pi_start())
    raise UsageError(f"«controller» {name}: {gains} holds no such gains; a recorded loop has pi or rc")
