"""A job's texts: one Jinja environment for all languages, and what its templates are given."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from eaid.export.entries import Entry, entries
from eaid.export.job import TITLES, Job
from eaid.export.numbers import commented, decimal, hexadecimal, rounded, series
from eaid.export.reference import InverseConstants, PIConstants, PlantConstants, RateConstants, RCConstants
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


STATES = {
    "pi": "eaid_integral_state", "rc": "eaid_integral_state", "inverse": "eaid_inverse_state",
    "plant": "eaid_plant_state",
}  # fmt: skip
"""Law → the C type of its state."""


@dataclass(frozen=True)
class Law:
    """One law as the templates need it."""

    name: str
    title: str
    start: str
    rate: str
    entries: tuple[Entry, ...]


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


def context(job: Job) -> Mapping[str, object]:
    """What every template may use."""
    t, names, units = job.timing, job.laws, job.units
    single = t.precision == "single"
    return {
        "job": job,
        "head": list(job.head),
        "laws": laws(job),
        "names": names,
        "titles": TITLES,
        "states": STATES,
        "controllers": [name for name in names if name != "plant"],
        "plain_laws": bool(set(names) - {"plant"}),
        "integral_laws": bool({"pi", "rc"} & set(names)),
        "needs_series": bool({"rc", "inverse", "plant"} & set(names)),
        "series": rounded(series(t.precision), t.precision),
        "rate": job.constants.get("rate"),
        "real": "float" if single else "double",
        "R": t.precision,
        "sqrt": "sqrtf" if single else "sqrt",
        "single": single,
        "timing": {
            **{name: rounded(getattr(t, name), t.precision) for name in ("dt_s", "duty_on_fault", "stuck_s")},
            "stuck_samples": t.stuck_samples,
        },
        "dt_text": decimal(t.dt_s),
        "filter_text": decimal(t.rate_filter_hz),
        "input_unit": units[0],
        "output_unit": units[1],
        "vectors": job.vectors,
        "folder": job.name,
        "version_line": job.head[0],
        "law": next((name for name in ("rc", "pi", "inverse") if name in names), "plant"),
        "duty_max_text": decimal(float(_limits(job)[1])) + "F",
        "limits": _limits(job),
        "log_header": log_header(units),
        "plant_header": log_header(units).rsplit(",", 1)[0],
        **_jump(job),
    }


def laws(job: Job) -> list[Law]:
    """The laws of a job as the templates need them."""
    return [
        Law(name, TITLES[name], START.get(name, ""), RATE.get(name, ""), entries(name, job.constants[name], job.units))
        for name in job.laws
    ]


def log_header(units: tuple[str, str]) -> str:
    """Columns of a log, as `eaid` finds them by name, with their units."""
    into, out = (UNKNOWN if unit == "1" else unit for unit in units)
    torque, reference = ("torque_nm", "reference_nm") if out == "N·m" else (f"output ({out})", f"reference ({out})")
    return f"time_s,{input_column('clutch', into)},{torque},{reference}"


def _limits(job: Job) -> tuple[float, float]:
    for one in job.constants.values():
        if isinstance(one, PIConstants | RCConstants | InverseConstants):
            return float(one.duty_min), float(one.duty_max)
    plant = job.constants["plant"]
    assert isinstance(plant, PlantConstants)
    return 0.0, float(plant.u_high)


def _jump(job: Job) -> dict[str, str]:
    """What a jump of the reference does to the filtered derivative."""
    rate = job.constants.get("rate")
    if not isinstance(rate, RateConstants):
        return {"peak_text": "0", "decay_text": "0"}
    return {
        "peak_text": f"{float(rate.gain):.3g}",
        "decay_text": f"{3 / (2 * math.pi * job.timing.rate_filter_hz):.2g}",
    }


def _xml(text: str) -> str:
    from html import escape

    return escape(" ".join(str(text).split()))
