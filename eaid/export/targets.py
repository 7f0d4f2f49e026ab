"""The table of targets: which laws each takes, and the files it makes."""

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import resources
from typing import Any

from eaid.export.entries import Entry
from eaid.export.fmu import fmus
from eaid.export.job import Job
from eaid.export.numbers import decimal
from eaid.export.options import LAWS
from eaid.export.render import laws, rendered

Files = Iterator[tuple[str, str | bytes]]


@dataclass(frozen=True)
class Target:
    """One target."""

    words: str
    laws: tuple[str, ...]
    files: Callable[[Job], Files]


def vectors_csv(job: Job) -> str:
    """The test vectors as text; `before` 1 is a reset, 2 a bumpless start from `from_duty`."""
    lines = ["law,case,before,reference,reference_rate,torque,from_duty,expected,status"]
    for v in job.vectors:
        numbers = ",".join(decimal(x) for x in (v.reference, v.rate, v.torque, v.duty, v.expected))
        lines.append(f"{v.law},{v.case},{v.before},{numbers},{v.status}")
    return "\n".join(lines) + "\n"


def _common(job: Job) -> Files:
    yield "vectors.csv", vectors_csv(job)
    yield "README.md", rendered(job, "README.md.j2", target=job.options.target)


def _c(job: Job) -> Files:
    yield "eaid_control.h", rendered(job, "eaid_control.h.j2")
    yield "eaid_control.c", rendered(job, "eaid_control.c.j2")
    yield "check.c", rendered(job, "check.c.j2")
    yield "vectors.h", rendered(job, "vectors.h.j2")
    yield "Makefile", rendered(job, "Makefile.j2")
    yield from _common(job)


def _arduino(job: Job) -> Files:
    yield from _c(job)
    if set(job.laws) - {"plant"}:
        yield f"{job.name}.ino", rendered(job, "sketch.ino.j2")


def _matlab(job: Job) -> Files:
    for law in job.laws:
        for part in ("init", "step") if law == "plant" else ("init", "start", "step"):
            yield f"eaid_{law}_{part}.m", rendered(job, f"matlab/{part}.m.j2", law=law)
        yield f"eaid_{law}_block.m", rendered(job, "matlab/block.m.j2", law=law)
    if "rate" in job.constants:
        yield "eaid_rate_step.m", rendered(job, "matlab/rate.m.j2")
    yield "check.m", rendered(job, "matlab/check.m.j2")
    yield from _common(job)


def _fmu(job: Job) -> Files:
    yield from fmus(job, dict(_c(job)))
    yield from _common(job)


def _yaml(job: Job) -> Files:
    yield "parameters.yaml", rendered(job, "parameters.yaml.j2")
    yield from _common(job)


def _json(job: Job) -> Files:
    def values(entries: tuple[Entry, ...]) -> dict[str, object]:
        return {
            e.name: values(e.value) if isinstance(e.value, tuple) else json.loads(decimal(e.value)) for e in entries
        }

    constants = {law.name: values(law.entries) for law in laws(job)}
    heading = {"head": list(job.head), "sample_time_s": job.timing.dt_s, "input_unit": job.units[0]}
    text = json.dumps({**heading, "output_unit": job.units[1], **constants}, indent=1, ensure_ascii=False)
    yield "parameters.json", text + "\n"
    yield from _common(job)


def _python(job: Job) -> Files:
    yield "eaid_laws.py", (resources.files("eaid.export") / "reference.py").read_text(encoding="utf-8")
    lines = [f"{name.upper()} = {_in_python(value)}" for name, value in job.constants.items()]
    yield "eaid_constants.py", rendered(job, "constants.py.j2", lines=lines)
    yield "check.py", rendered(job, "check.py.j2")
    yield from _common(job)


def _in_python(value: Any) -> str:
    """A constant as Python writes it; single precision keeps its numbers, not its type."""
    if hasattr(value, "_fields"):
        inner = ",\n    ".join(f"{field}={_in_python(item)}" for field, item in value._asdict().items())
        return f"law.{type(value).__name__}(\n    {inner},\n)"
    if isinstance(value, tuple):
        return "(" + ", ".join(_in_python(item) for item in value) + ")"
    return repr(value) if isinstance(value, int) else repr(float(value))


def _modelica(job: Job) -> Files:
    yield "EaidPlant.mo", rendered(job, "EaidPlant.mo.j2")
    yield from _common(job)


TARGETS: dict[str, Target] = {
    "c": Target("C99, one .h and one .c, C++ safe", LAWS, _c),
    "arduino": Target("the same C and a sketch around it", LAWS, _arduino),
    "matlab": Target("MATLAB and Octave functions, blocks for Simulink", LAWS, _matlab),
    "fmu": Target("FMI 2.0 co-simulation, one FMU a law, with sources", LAWS, _fmu),
    "yaml": Target("a plain parameter file, ROS 2 style", LAWS, _yaml),
    "json": Target("every constant as JSON, for a program of your own", LAWS, _json),
    "python": Target("plain Python, nothing else needed", LAWS, _python),
    "modelica": Target("the plant as a Modelica model", ("plant",), _modelica),
}
