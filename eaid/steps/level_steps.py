"""Steps from level to level: every change of input between two holds, each from its own start.

A staircase, or steps about an operating point, hold more than steps from rest: Δy and Δu of each change, up and down
apart, are a gain Δy/Δu and a response to which a curve of `eaid.fitting.step_shapes` is fitted.
"""

from collections.abc import Sequence

from eaid.arrays import read_only
from eaid.findings import Finding
from eaid.logs.run import Run
from eaid.steps.step import Step
from eaid.steps.stepset import LevelStep

START_ASSUMED = ("step-at-first-sample", "no-rest-before-step")


def level_step(run: Run, findings: tuple[Finding, ...] = ()) -> LevelStep:
    """The change of input that a cut run holds."""
    step = Step(run)
    level = run.level or 0.0
    before, after = (level, run.from_level) if run.edge == "falling" else (run.from_level, level)
    start = run.baseline or 0.0
    if run.edge == "falling" and run.from_level == 0.0 and run.held is not None:
        start = run.held
    return LevelStep(
        name=run.name,
        source=run.source,
        from_level=before,
        level=after,
        start=start,
        time_s=step.time_s,
        output=read_only(run.output[step.start :]),
        input=read_only(run.input[step.start :]),
        start_known=not any(one.code in START_ASSUMED for one in run.findings),
        rest_s=run.rest_s,
        rest_moved=run.rest_moved,
        findings=findings,
    )


def level_steps(runs: Sequence[Run], said: dict[str, tuple[Finding, ...]] | None = None) -> tuple[LevelStep, ...]:
    """The changes of input of cut runs: those upwards first, each by the level they go to and come from."""
    said = said or {}
    steps = [level_step(run, said.get(run.name, ())) for run in runs if len(run.time_s) > Step(run).start]
    return tuple(sorted(steps, key=lambda one: (one.edge != "up", one.level, one.from_level, one.name)))
