"""The Python target: `eaid.export.reference` as it stands, the constants beside it, and a check against vectors.csv."""

from collections.abc import Iterator
from importlib import resources
from typing import Any

from eaid.export.job import Job
from eaid.export.render import rendered


def python_files(job: Job) -> Iterator[tuple[str, str]]:
    """The files of the target."""
    yield "eaid_laws.py", (resources.files("eaid.export") / "reference.py").read_text(encoding="utf-8")
    lines = [f"{name.upper()} = {_text(value)}" for name, value in job.constants.items()]
    yield "eaid_constants.py", rendered(job, "constants.py.j2", lines=lines)
    yield "check.py", rendered(job, "check.py.j2")


def _text(value: Any) -> str:
    """A constant as Python writes it; single precision keeps its numbers, not its type."""
    if hasattr(value, "_fields"):
        inner = ",\n    ".join(f"{field}={_text(item)}" for field, item in value._asdict().items())
        return f"law.{type(value).__name__}(\n    {inner},\n)"
    if isinstance(value, tuple):
        return "(" + ", ".join(_text(item) for item in value) + ")"
    return repr(value) if isinstance(value, int) else repr(float(value))
