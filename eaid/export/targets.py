"""The table of targets, and the files that each makes."""

from collections.abc import Callable, Iterator
from importlib import resources
from typing import Any

from eaid.export.fmu import fmus
from eaid.export.job import Job
from eaid.export.numbers import decimal
from eaid.export.render import rendered

Files = Iterator[tuple[str, str | bytes]]


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


TARGETS: dict[str, Callable[[Job], Files]] = {
    "c": _c,
    "arduino": _arduino,
    "matlab": _matlab,
    "fmu": _fmu,
    "yaml": _yaml,
    "python": _python,
}
"""Target → the files it makes: name and content."""
