"""`eaid plan --excitation`: one sequence of duties in place of a table of runs."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from eaid.cli import console
from eaid.errors import UsageError

if TYPE_CHECKING:
    from eaid.recorded.sequence import Limits
    from eaid.results.recorded import Excitation


def plan_one_recording(
    fit: Path, want: dict[str, float], limits: str | None, check: bool, output: Path, seed: int, json: bool, force: bool
) -> int:
    """Plan, write the duty file, and say what it gives and costs."""
    import msgspec

    from eaid.files import refuse_to_overwrite, written_whole
    from eaid.planning.excitation import ExcitationOptions, shortest_recording
    from eaid.results import codec
    from eaid.results.common import Input
    from eaid.results.fit import Fit

    refuse_to_overwrite(output, force, inputs=(fit,))
    source, doubts = codec.read(fit, "fit", Fit)
    options = ExcitationOptions(want, limits_of(limits, source.plant.u_range), check, seed)
    with console.progress("simulating the recording", 0) as advance:
        found = shortest_recording(source, options, advance)
    found = msgspec.structs.replace(found, inputs=(Input.of(fit),))
    with written_whole(output, force) as part:
        rows = ["time_s,duty_pct", *(f"{at:.9g},{duty:.9g}" for at, duty in found.duty)]
        part.write_text("\n".join(rows) + "\n", encoding="utf-8")
    if json:
        sys.stdout.write(codec.dumps(found, "plan"))
    else:
        table(found)
    console.tell((*doubts, *found.findings))
    classic = found.classic_time_on_rig_s
    beside = "steps from rest never reach these widths" if classic is None else f"steps from rest take {classic:.0f} s"
    console.say(f"{output}: {found.time_on_rig_s:.0f} s on the rig in {found.engagements} engagements; {beside}")
    return 0


def limits_of(text: str | None, duty_pct: tuple[float, float]) -> "Limits":
    """`duty=10:100,hold=0.3:30,rate=200,rest=5,work=60,engagements=4` as limits."""
    from eaid.reading import pairs
    from eaid.recorded.sequence import Limits

    names = {"rate": "rate_pct_s", "rest": "rest_s", "work": "work_s", "longest": "longest_s"}
    given: dict[str, float | int | tuple[float, float]] = {"duty_pct": duty_pct}
    for name, value in pairs("«limits»", text).items():
        try:
            numbers = [float(part) for part in value.split(":")]
        except ValueError:
            raise UsageError(f"«limits» {name}={value}: give a number, or two with a colon between") from None
        if name in ("duty", "hold") and len(numbers) == 2:
            given["duty_pct" if name == "duty" else "hold_s"] = (numbers[0], numbers[1])
        elif name == "engagements" and len(numbers) == 1:
            given[name] = int(numbers[0])
        elif name in names and len(numbers) == 1:
            given[names[name]] = numbers[0]
        else:
            raise UsageError(f"«limits» {name}={value}: knows duty=10:100, hold=0.3:30, rate, rest, work, engagements")
    return Limits(**given)  # type: ignore[arg-type]


def table(found: "Excitation") -> None:
    """The plan for people."""
    measured = found.measured_half_width_pct or {}
    rows = [
        [name, *("-" if w is None else f"{w:.3g}" for w in (found.wanted.get(name), width, measured.get(name)))]
        for name, width in found.half_width_pct.items()
    ]
    console.table(
        "Half-width of the 95 % intervals at the worst duty",
        ["parameter", "wanted [%]", "predicted [%]", "kept by nine of ten simulated recordings [%]"],
        rows,
    )
