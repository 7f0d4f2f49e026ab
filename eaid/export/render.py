"""A job's texts: one Jinja environment for all languages, and what its templates are given."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from eaid.export.entries import Entry, entries
from eaid.export.job import TITLES, Job
from eaid.export.series import rounded, series
from eaid.export.text import commented, decimal, hexadecimal
from eaid.synth.folder import input_column
from eaid.synth.plants import UNKNOWN

START = {
    "pi": "Bumpless: sets the integral with which the next step, on these inputs, gives `duty`.",
    "rc": "Bumpless: sets the integral with which the next step, on these inputs, gives `duty`.",
    "inverse": "Sets the observer to the measured torque, as after a long hold, and its search to `duty`.",
}
RATE = {
    "pi": "The rate is not used.",
    "rc": "reference_rate: the reference's slope, yours or that of eaid_rate_step.",
    "inverse": "reference + reference_rate dt is where the torque is to be at the next sample.",
}


@dataclass(frozen=True)
class Field:
    """A constant as C declares it."""

    name: str
    c_type: str
    comment: str


@dataclass(frozen=True)
class Struct:
    """A struct of constants."""

    name: str
    title: str
    entries: tuple[Field, ...]


@dataclass(frozen=True)
class Law:
    """One law as the templates need it."""

    name: str
    title: str
    start: str
    rate: str
    entries: tuple[Entry, ...]
    structs: tuple[Struct, ...]
    initializer: str


@cache
def environment() -> Environment:
    """The templates and their filters."""
    made = Environment(
        loader=PackageLoader("eaid.export"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # sources, no markup; XML is escaped by its own filter
    )
    made.filters |= {"lit": hexadecimal, "dec": decimal, "comment": commented, "xml": _xml}
    return made


def rendered(job: Job, template: str, **further: Any) -> str:
    """The text of one template."""
    return environment().get_template(template).render(context(job), **further)


def context(job: Job) -> dict[str, Any]:
    """What every template may use."""
    t, names = job.timing, job.laws
    single = t.precision == "single"
    return {
        "job": job,
        "head": list(job.head),
        "laws": [_law(job, name) for name in names],
        "names": names,
        "controllers": [name for name in names if name != "plant"],
        "plain_laws": bool(set(names) - {"plant"}),
        "integral_laws": bool({"pi", "rc"} & set(names)),
        "needs_series": bool({"rc", "inverse", "plant"} & set(names)),
        "series": rounded(series(t.precision), t.precision),
        "rate": job.constants.get("rate"),
        "real": "float" if single else "double",
        "sqrt": "sqrtf" if single else "sqrt",
        "single": single,
        "timing": {
            **{name: rounded(getattr(t, name), t.precision) for name in ("dt_s", "duty_on_fault", "stuck_s")},
            "stuck_samples": t.stuck_samples,
        },
        "dt_text": decimal(t.dt_s),
        "filter_text": decimal(t.rate_filter_hz),
        "input_unit": job.units[0],
        "output_unit": job.units[1],
        "vectors": job.vectors,
        "folder": job.name,
        "version_line": job.head[0],
        "law": next((name for name in ("rc", "pi", "inverse") if name in names), "plant"),
        "duty_max_text": decimal(float(_limits(job)[1])) + "F",
        "limits_text": _limits_text(job),
        "log_header": log_header(job.units),
        "plant_header": log_header(job.units).rsplit(",", 1)[0],
        **_jump(job),
    }


def log_header(units: tuple[str, str]) -> str:
    """Columns of a log, as `eaid` finds them by name, with their units."""
    into, out = (UNKNOWN if unit == "1" else unit for unit in units)
    torque, reference = ("torque_nm", "reference_nm") if out == "N·m" else (f"output ({out})", f"reference ({out})")
    return f"time_s,{input_column('clutch', into)},{torque},{reference}"


def _limits(job: Job) -> tuple[float, float]:
    for law in job.laws:
        if law != "plant":
            return float(job.constants[law].duty_min), float(job.constants[law].duty_max)
    return 0.0, float(job.constants["plant"].u_high)


def _limits_text(job: Job) -> str:
    low, high = _limits(job)
    return f"The duty stays within {low:g} to {high:g} {job.units[0]}."


def _jump(job: Job) -> dict[str, str]:
    """What a jump of the reference does to the filtered derivative."""
    rate = job.constants.get("rate")
    if rate is None:
        return {"peak_text": "0", "decay_text": "0"}
    return {
        "peak_text": f"{float(rate.gain):.3g}",
        "decay_text": f"{3 / (2 * math.pi * job.timing.rate_filter_hz):.2g}",
    }


def _law(job: Job, name: str) -> Law:
    rows = tuple(entries(name, job.constants[name], job.units))
    return Law(
        name, TITLES[name], START.get(name, ""), RATE.get(name, ""), rows,
        tuple(_structs(name, rows)), "\n".join(_initializer(rows, "    ")),
    )  # fmt: skip


def _structs(name: str, rows: tuple[Entry, ...]) -> Iterator[Struct]:
    fields = []
    for entry in rows:
        if isinstance(entry.value, tuple):
            yield from _structs(entry.name, entry.value)
            fields.append(Field(entry.name, f"eaid_{entry.name}_constants", entry.comment))
        else:
            fields.append(Field(entry.name, "uint32_t" if isinstance(entry.value, int) else "eaid_real", entry.comment))
    yield Struct(name, TITLES[name], tuple(fields))


def _initializer(rows: tuple[Entry, ...], indent: str) -> Iterator[str]:
    for entry in rows:
        if isinstance(entry.value, tuple):
            yield f"{indent}{{"
            yield from _initializer(entry.value, indent + "    ")
            yield f"{indent}}},"
            continue
        unit = f" {entry.unit}" if entry.unit else ""
        yield f"{indent}{hexadecimal(entry.value)}, /* {entry.name} = {decimal(entry.value)}{unit} */"


def _xml(text: str) -> str:
    from html import escape

    return escape(" ".join(str(text).split()))
