"""What `eaid ingest` prints: one line a level, one line a step between levels, and one line for each doubt.

A doubt that several runs share is one line, with the run that has most of it.
"""

from typing import TYPE_CHECKING

from eaid.cli import console

if TYPE_CHECKING:
    from collections.abc import Sequence

    from eaid.logs.run import Run
    from eaid.steps.edges import Edge
    from eaid.steps.stepset import Level, RunRecord, StepSet

MOST = 20
"""Steps from level to level that are listed; all are in the file and in --json."""

LONGEST = 30
"""Letters of a run's name in a table."""


def as_json(stepset: "StepSet") -> dict[str, object]:
    """The levels, runs and findings, machine-readable."""
    from dataclasses import asdict

    from eaid.results.codec import stamped

    levels = [
        {"level": level.level, "repeats": len(level.names), "samples": len(level.time_s), "runs": level.names}
        for level in stepset.levels
    ]
    steps = [
        {
            "run": step.name, "from": step.from_level, "level": step.level, "edge": step.edge, "start": step.start,
            "change": step.change, "gain": step.gain, "window_s": float(step.time_s[-1]),
        }
        for step in stepset.level_steps
    ]  # fmt: skip
    content = {
        "kind": stepset.kind, "input_unit": stepset.input_unit, "output_unit": stepset.output_unit,
        "synthetic": stepset.synthetic, "apparatus": asdict(stepset.apparatus), "levels": levels,
        "releases": [{"level": level.level, "repeats": len(level.names)} for level in stepset.releases],
        "level_steps": steps, "runs": [{**asdict(run), "warnings": run.warnings} for run in stepset.runs],
        "findings": stepset.all_findings, "warnings": stepset.warnings,
    }  # fmt: skip
    return stamped("eaid/ingest/1", content)


def print_tables(stepset: "StepSet") -> None:
    """The tables on stdout."""
    made = f", synthetic: {stepset.synthetic}" if stepset.synthetic else ""
    title = f"{stepset.kind}: {_count(stepset.levels, 'level')}, {_count(stepset.runs, 'run')}, {_rates(stepset)}{made}"
    unit, out = stepset.input_unit or "input", stepset.output_unit or "output"
    if stepset.levels:
        rows = [_level_row(level, stepset) for level in stepset.levels]
        console.table(
            title,
            [f"level [{unit}]", "runs", f"start [{out}]", f"rise [{out}]", "lost", "hold [s]", "falls"],
            rows,
        )
    else:
        console.line(title)
    between = [step for step in stepset.level_steps if step.from_level != 0.0 and step.level != 0.0]
    if between:
        console.table(
            "steps from level to level",
            [f"from [{unit}]", "to", f"start [{out}]", f"change [{out}]", f"gain [{out}/{unit}]", "hold [s]"],
            [
                [
                    f"{step.from_level:g}", f"{step.level:g}", f"{step.start:.4g}", f"{step.change:+.4g}",
                    f"{step.gain:.4g}", f"{step.time_s[-1]:.4g}",
                ]
                for step in between[:MOST]
            ],
        )  # fmt: skip
        if len(between) > MOST:
            console.line(f"and {len(between) - MOST} more")
    slips = [(run, run.slip) for run in stepset.runs if run.slip is not None]
    if slips:
        console.table(
            "slip, of the run with the highest peak at each level",
            [f"level [{unit}]", f"peak [{out}]", "at", f"after [{out}]", "loading", "stick-slip"],
            [_slip_row(level.level, run, out) for level, run in _highest(stepset)],
        )
    told = stepset.all_findings
    if told:
        from eaid.errors import on_command_line
        from eaid.findings import say

        console.table(
            "doubts",
            ["", "run", "what"],
            [[console.PREFIX[one.severity], _short(one.subject), on_command_line(say(one))] for one in told],
        )


def print_edges(found: "list[tuple[Run, tuple[Edge, ...]]]", json: bool) -> None:
    """A table of the edges of each log, or JSON, on stdout."""
    if json:
        import dataclasses

        logs = [{"run": run.name, "edges": [dataclasses.asdict(one) for one in each]} for run, each in found]
        console.print_json({"logs": logs})
        return
    for run, each in found:
        unit = run.output_unit or "output"
        rows = [
            [
                f"{run.start_s + one.at_s:.4g}", f"{one.before:.4g}", f"{one.after:.4g}", f"{one.rise_s:.3g}",
                f"{one.overshoot_pct:.1f}", "–" if one.settling_s is None else f"{one.settling_s:.3g}",
            ]
            for one in each
        ]  # fmt: skip
        heads = ["at [s]", f"from [{unit}]", "to", "rise [s]", "overshoot [%]", "settled in [s]"]
        console.table(f"{run.name}: {_count(each, 'edge')} of its output", heads, rows)


def _rates(stepset: "StepSet") -> str:
    rates = sorted(f"{run.rate_hz:.4g}" for run in stepset.runs)
    low, high = min(rates, key=float, default="0"), max(rates, key=float, default="0")
    return f"{low} Hz" if low == high else f"{low} to {high} Hz"


def _short(name: str) -> str:
    """A run's name for a table: the middle of a long one is left out."""
    return name if len(name) <= LONGEST else f"{name[: LONGEST - 12]}…{name[-11:]}"


def _count(items: "Sequence[object]", what: str) -> str:
    return f"{len(items)} {what}{'' if len(items) == 1 else 's'}"


def _level_row(level: "Level", stepset: "StepSet") -> list[str]:
    runs = [run for run in stepset.runs if run.name in level.names]
    starts = [run.baseline_nm for run in runs]
    lost = max((run.lost_pct or 0.0 for run in runs), default=0.0)
    falls = sum(len(one.names) for one in stepset.releases if one.level == level.level)
    near = f"{starts[0]:.4g}" if len(starts) == 1 else f"{min(starts):.4g} … {max(starts):.4g}"
    end = float(level.mean[-max(1, len(level.mean) // 10) :].mean())
    return [
        f"{level.level:g}", str(len(level.names)), near, f"{end:.4g}", f"{lost:.0f} %", f"{level.time_s[-1]:.4g}",
        str(falls),
    ]  # fmt: skip


def _highest(stepset: "StepSet") -> "list[tuple[Level, RunRecord]]":
    found = []
    for level in stepset.levels:
        runs = [run for run in stepset.runs if run.slip is not None and run.name in level.names]
        found += [(level, max(runs, key=lambda run: run.slip.peak if run.slip else 0.0))] if runs else []
    return found


def _slip_row(level: float, run: "RunRecord", out: str) -> list[str]:
    slip = run.slip
    assert slip is not None
    stick = "–" if slip.stick_slip is None else f"{slip.stick_slip:.3g} at {slip.stick_slip_hz:.3g} Hz"
    at, loading = f"{slip.peak_s:.3g} s", f"{slip.stiffness_per_s:.3g} {out}/s"
    if slip.moved is not None:
        at += f", {slip.moved:.3g} {slip.unit}"
    if slip.stiffness is not None:
        loading = f"{slip.stiffness:.3g} {out}/{slip.unit}"
    return [f"{level:g}", f"{slip.peak:.4g}", at, f"{slip.after:.4g}", loading, stick]
