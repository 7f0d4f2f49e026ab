"""What a fit was made from: kind, units, levels, the rig and the runs, as fit.json holds them."""

from dataclasses import asdict

from eaid.results.common import Input, Source
from eaid.results.fit import Data, Rig
from eaid.steps.stepset import StepSet


def data_part(stepset: StepSet) -> Data:
    """The `data` part of a fit."""
    rates = [run.rate_hz for run in stepset.runs]
    if not rates:
        rates = [(len(level.time_s) - 1) / float(level.time_s[-1] - level.time_s[0]) for level in stepset.levels]
    return Data(
        kind=stepset.kind,  # type: ignore[arg-type]  # one of the three
        input_unit=stepset.input_unit,
        output_unit=stepset.output_unit,
        levels=tuple(level.level for level in stepset.levels),
        repeats=tuple(len(level.runs) for level in stepset.levels),
        samples=tuple(len(level.time_s) for level in stepset.levels),
        record_s=tuple(float(level.time_s[-1]) for level in stepset.levels),
        sample_rate_hz=max(rates, default=None),
        apparatus=Rig(**asdict(stepset.apparatus)),
        sources=tuple(
            Source(
                run.source,
                run.sha256,
                run.name,
                run.level,
                run.repeat,
                run.baseline_nm,
                run.step_s,
                run.samples,
                run.edge,
            )
            for run in stepset.runs
        ),
        inputs=tuple(Input(path, sha256) for path, sha256 in stepset.inputs),
        synthetic=stepset.synthetic,
    )
