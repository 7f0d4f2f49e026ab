"""What `eaid plan` writes and prints, of a session of steps and of one sequence."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from eaid.cli import console
from eaid.files import all_written_whole
from eaid.planning.recordings import input_changes
from eaid.results.plan import Plan
from eaid.results.recorded import Excitation
from eaid.shown import counted
from eaid.synth.files import RUN_TABLE, input_file


def write(files: Sequence[Path], plan: Plan | Excitation, kind: str, force: bool) -> None:
    """The run table and the input file, both whole or neither; of a sequence the input file alone."""
    if isinstance(plan, Excitation):
        contents = [input_file(plan.duty, "clutch", plan.input_unit)]
    else:
        rows = [f"{r.order},{r.level:.9g},{r.repeat},{r.idle_s:g},{r.hold_s:g},{r.release_s:g}" for r in plan.runs]
        changes = input_file(input_changes(plan.runs), kind, plan.input_unit)
        contents = [[",".join(RUN_TABLE), *rows], changes]
    with all_written_whole(files, force) as parts:
        for part, lines in zip(parts, contents, strict=True):
            part.write_text("\n".join(lines) + "\n", encoding="utf-8")


def show(plan: Plan | Excitation, idle_s: float, release_s: float) -> None:
    """The plan for people."""
    if isinstance(plan, Excitation):
        _widths(plan.half_width_pct, plan, "19 of 20")
        return
    console.table(
        f"What to record: {plan.repeats} repeats of each level, in the order of the run table; each run idles for "
        f"{idle_s:g} s before its step and is recorded for {release_s:g} s after its release",
        [f"level [{plan.input_unit}]" if plan.input_unit else "level", "hold [s]"],
        [[f"{level:g}", f"{hold:g}"] for level, hold in zip(plan.levels, plan.hold_s, strict=True)],
    )
    _widths(plan.half_width_pct, plan, "four of five")


def _widths(predicted: Mapping[str, float | None], plan: Plan | Excitation, of: str) -> None:
    measured = plan.measured_half_width_pct or {}
    rows = [
        [name, *("–" if w is None else f"{w:.3g}" for w in (plan.wanted.get(name), width, measured.get(name)))]
        for name, width in predicted.items()
    ]
    console.table(
        f"Half-width of the 95 % intervals at the worst level [%]; kept: by {of} simulated recordings",
        ["parameter", "wanted", "predicted", "kept"], rows,
    )  # fmt: skip


def cost(plan: Plan | Excitation) -> str:
    """What a plan costs on the rig, and what is to be minded."""
    if isinstance(plan, Excitation):
        classic = plan.classic_time_on_rig_s
        beside = "never reach these widths" if classic is None else f"take {classic:.0f} s"
        engaged = f"{plan.time_on_rig_s:.0f} s on the rig in {plan.engagements} engagements"
        return f"{engaged}; steps from rest {beside}; next: record it, then eaid fit"
    minutes = f"{counted(len(plan.runs), 'run')}, {plan.time_on_rig_s / 60:.0f} minutes on the rig"
    return f"{minutes}; next: record whole blocks in this order, not sweeps, then eaid fit"
