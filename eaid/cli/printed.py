"""What commands print of what was read and of plans; and `--json` where no file says it."""

from collections.abc import Iterator
from typing import Any

from eaid.errors import on_command_line
from eaid.findings import say
from eaid.findings.finding import WORD
from eaid.report.tables import Table, table_of
from eaid.report.tables.data import between_levels, distinct, levels_recorded, slips_table
from eaid.results.plan import Excitation, Plan
from eaid.shown import counted
from eaid.steps.stepset import Level, StepSet

MOST_LISTED_STEPS = 20  # Steps from level to level that are listed; all are in the file and in --json


def steps_shown(data: StepSet) -> Iterator[str | Table]:
    """What was read: one line a level, one line a step between levels, slips and warnings."""
    made = f", synthetic: {data.synthetic}" if data.synthetic else ""
    rates = sorted(run.rate_hz for run in data.runs) or [0.0]
    rate = " to ".join(dict.fromkeys(f"{one:.5g}" for one in (rates[0], rates[-1])))
    yield f"{data.kind}: {counts(data)}, {rate} Hz{made}"
    between = [step for step in data.level_steps if step.from_level != 0.0 and step.level != 0.0]
    yield levels_recorded(data)
    yield between_levels(between[:MOST_LISTED_STEPS], data)
    if len(between) > MOST_LISTED_STEPS:
        yield f"and {len(between) - MOST_LISTED_STEPS} more"
    yield slips_table(data)
    for one in data.all_findings:
        said = on_command_line(say(one))
        yield f"{WORD[one.severity]}: {f'{one.subject}: ' * (one.subject != 'data' and one.subject not in said)}{said}"


def counts(data: StepSet) -> str:
    """How many levels and runs, a rise and its release as one, and logs that are fitted as recorded."""
    whole = f"{counted(len(data.recorded), 'log')} as recorded"
    steps = f"{counted(len(data.levels), 'level')}, {counted(len(distinct(data.runs)), 'run')}"
    return ", ".join([steps] * bool(data.runs or not data.recorded) + [whole] * bool(data.recorded))


def ingested(data: StepSet) -> dict[str, Any]:
    """What `ingest --json` prints of a step set: the levels, runs and findings."""

    def level(one: Level) -> dict[str, Any]:
        return {"level": one.level, "repeats": len(one.names), "samples": len(one.time_s), "runs": one.names}

    steps = [
        {"run": one.name, "from": one.from_level, "level": one.level, "edge": one.edge, "start": one.start,
         "change": one.change, "gain": one.gain, "window_s": float(one.time_s[-1])}
        for one in data.level_steps
    ]  # fmt: skip
    return {
        **{key: getattr(data, key) for key in ("kind", "input_unit", "output_unit", "synthetic", "apparatus")},
        "levels": tuple(map(level, data.levels)), "releases": tuple(map(level, data.releases)),
        "level_steps": steps, "runs": data.runs, "findings": data.all_findings,
    }  # fmt: skip


def plan_shown(plan: Plan | Excitation) -> Iterator[Table]:
    """The plan for people."""
    if isinstance(plan, Plan):
        yield table_of(
            "What to record",
            f"{plan.repeats} repeats of each level, in the order of the run table; each run idles for "
            f"{plan.runs[0].idle_s:g} s before its step and is recorded for {plan.runs[0].release_s:g} s after its "
            "release",
            zip(plan.levels, plan.hold_s, strict=True),
            (("level", plan.input_unit), lambda of: f"{of[0]:g}"), (("hold", "s", 3), lambda of: of[1]),
        )  # fmt: skip
    kept = "four of five" if isinstance(plan, Plan) else "19 of 20"
    measured = plan.measured_half_width_pct or {}
    yield table_of(
        "Half-widths",
        f"Of the 95 % intervals at the worst level; kept: by {kept} simulated recordings. They are of one mounting; of "
        "the next one fits of three sessions and more tell (eaid sessions)",
        plan.half_width_pct.items(),
        ("parameter", lambda of: of[0]), (("wanted", "%", 3), lambda of: plan.wanted.get(of[0])),
        (("predicted", "%", 3), lambda of: of[1]), (("kept", "%", 3), lambda of: measured.get(of[0])),
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
