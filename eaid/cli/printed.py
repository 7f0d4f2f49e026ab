"""What `--json` prints where no result file says it."""

from dataclasses import dataclass
from pathlib import Path

from eaid.apparatus import Apparatus
from eaid.findings import Finding
from eaid.logs.run import Run
from eaid.results.common import Input
from eaid.steps.edges import Edge
from eaid.steps.stepset import Level, LevelStep, RunRecord, StepSet


@dataclass(frozen=True)
class OneLevel:
    """A level of --json."""

    level: float
    repeats: int
    samples: int
    runs: tuple[str, ...]

    @classmethod
    def of(cls, level: Level) -> "OneLevel":
        """What is printed of a level."""
        return cls(level.level, len(level.names), len(level.time_s), level.names)


@dataclass(frozen=True)
class OneStep:
    """A step between levels of --json."""

    run: str
    from_: float
    level: float
    edge: str
    start: float
    change: float
    gain: float
    window_s: float

    @classmethod
    def of(cls, step: LevelStep) -> "OneStep":
        """What is printed of a step."""
        end = float(step.time_s[-1])
        return cls(step.name, step.from_level, step.level, step.edge, step.start, step.change, step.gain, end)


@dataclass(frozen=True)
class Ingested:
    """What --json prints: the levels, runs and findings."""

    kind: str
    input_unit: str
    output_unit: str
    synthetic: str | None
    apparatus: Apparatus
    levels: tuple[OneLevel, ...]
    releases: tuple[OneLevel, ...]
    level_steps: tuple[OneStep, ...]
    runs: tuple[RunRecord, ...]
    findings: tuple[Finding, ...]

    @classmethod
    def of(cls, data: StepSet) -> "Ingested":
        """What is printed of a step set."""
        levels, releases = (tuple(map(OneLevel.of, each)) for each in (data.levels, data.releases))
        steps = tuple(map(OneStep.of, data.level_steps))
        return cls(
            data.kind, data.input_unit, data.output_unit, data.synthetic, data.apparatus, levels, releases, steps,
            data.runs, data.all_findings,
        )  # fmt: skip


@dataclass(frozen=True)
class LogEdges:
    """The edges of one log's output."""

    run: str
    edges: tuple[Edge, ...]


@dataclass(frozen=True)
class Edges:
    """What --edges --json prints."""

    logs: tuple[LogEdges, ...]


@dataclass(frozen=True)
class Made:
    """One synthetic run."""

    name: str
    level: float | None
    repeat: int | None
    samples: int


@dataclass(frozen=True)
class Synthesized:
    """What --json prints."""

    output: Path
    synthetic: str | None
    kind: str | None
    input_unit: str
    output_unit: str
    inputs: tuple[Input, ...]
    seed: int
    runs: tuple[Made, ...]

    @classmethod
    def of(cls, output: Path, runs: list[Run], inputs: tuple[Input, ...], seed: int) -> "Synthesized":
        """What is printed of some runs."""
        rows = tuple(Made(run.name, run.level, run.repeat, run.time_s.size) for run in runs)
        first = runs[0]
        units = first.input_unit, first.output_unit
        return cls(output, first.synthetic, first.kind, *units, inputs, seed, rows)


@dataclass(frozen=True)
class Filled:
    """What --json prints: the page, and every file of the folder."""

    page: Path
    files: tuple[str, ...]
