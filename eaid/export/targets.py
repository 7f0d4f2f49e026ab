"""The table of targets, and the files that each makes."""

import hashlib
import io
import math
import platform
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from html import escape
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from eaid.export.constants import SERIES, commented, decimal, entries, hexadecimal, rounded
from eaid.export.job import TITLES, Job
from eaid.export.reference import InverseConstants, PIConstants, PlantConstants, RateConstants, RCConstants
from eaid.synth.files import input_column
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


# Law → the C type of its state
STATES = {
    "pi": "eaid_integral_state", "rc": "eaid_integral_state", "inverse": "eaid_inverse_state",
    "plant": "eaid_plant_state",
}  # fmt: skip


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
    made.filters |= {
        "lit": hexadecimal,
        "dec": decimal,
        "comment": commented,
        "xml": lambda text: escape(" ".join(str(text).split())),
    }
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
        "laws": [
            {
                "name": name,
                "title": TITLES[name],
                "start": START.get(name, ""),
                "rate": RATE.get(name, ""),
                "entries": entries(name, job.constants[name], units),
            }
            for name in names
        ],
        "names": names,
        "titles": TITLES,
        "states": STATES,
        "controllers": [name for name in names if name != "plant"],
        "plain_laws": bool(set(names) - {"plant"}),
        "integral_laws": bool({"pi", "rc"} & set(names)),
        "needs_series": bool({"rc", "inverse", "plant"} & set(names)),
        "series": rounded(SERIES[t.precision], t.precision),
        "rate": job.constants.get("rate"),
        "real": "float" if single else "double",
        "R": t.precision,
        "sqrt": "sqrtf" if single else "sqrt",
        "single": single,
        "timing": {name: rounded(getattr(t, name), t.precision) for name in ("dt_s", "duty_on_fault")},
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


# Every file of an export bears it near its beginning, an FMU at its end, vectors.csv its columns instead
MARK = b", made by eaid "
FLAGS = ("-O2", "-std=c99", "-fPIC", "-shared", "-ffp-contract=off", "-fvisibility=hidden")


@dataclass(frozen=True)
class Variable:
    """One variable of a modelDescription.xml; its value reference is its place in the list."""

    name: str
    causality: str
    kind: str  # Real, Integer or Boolean
    unit: str
    words: str
    start: str = ""


def variables(law: str, duty_on_fault: float) -> tuple[Variable, ...]:
    """The variables of a law's FMU; units as i and o."""
    status = Variable("status", "output", "Integer", "", "bits: 1 not ready, 2 bad input, 4, 8 limits, 32 wrong rate")
    if law == "plant":
        return (
            Variable("duty", "input", "Real", "i", "held over the step", "0"),
            Variable("torque", "output", "Real", "o", "after the step"),
            status,
        )
    return (
        Variable("reference", "input", "Real", "o", "wanted torque", "0"),
        Variable("reference_rate", "input", "Real", "o/s", "its slope; not read while use_rate_filter is true", "0"),
        Variable("torque", "input", "Real", "o", "measured torque", "0"),
        Variable("duty", "output", "Real", "i", "from these inputs, until the next step"),
        status,
        Variable("duty_on_fault", "parameter", "Real", "i", "given while an input is no number", repr(duty_on_fault)),
        Variable("use_rate_filter", "parameter", "Boolean", "", "take the reference's filtered derivative", "false"),
    )


def fmus(job: Job, files: Mapping[str, str | bytes]) -> Iterator[tuple[str, bytes]]:
    """An FMU for each law; `files` hold the C sources."""
    for law in job.laws:
        sources = {
            "eaid_control.h": str(files["eaid_control.h"]),
            "eaid_control.c": str(files["eaid_control.c"]),
            "fmi2_wrapper.c": rendered(job, "fmi2_wrapper.c.j2", law=law),
        }
        guid = hashlib.sha256("".join(sources.values()).encode()).hexdigest()[:32]
        sources["fmi2_wrapper.c"] = sources["fmi2_wrapper.c"].replace("@GUID@", guid)
        listed = variables(law, float(job.timing.duty_on_fault))
        description = rendered(job, "modelDescription.xml.j2", law=law, guid=guid, variables=listed)
        yield f"eaid_{law}.fmu", _zipped(f"eaid_{law}", description, sources)


def _zipped(name: str, description: str, sources: Mapping[str, str]) -> bytes:
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w", zipfile.ZIP_DEFLATED) as file:
        _put(file, "modelDescription.xml", description.encode())
        for path, text in sources.items():
            _put(file, f"sources/{path}", text.encode())
        made = binary(name, sources)
        if made is not None:
            _put(file, made[0], made[1])
        file.comment = name.encode() + MARK
    return whole.getvalue()


def _put(file: zipfile.ZipFile, path: str, data: bytes) -> None:
    entry = zipfile.ZipInfo(path, (1980, 1, 1, 0, 0, 0))
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.external_attr = 0o644 << 16
    file.writestr(entry, data)


def binary(name: str, sources: Mapping[str, str]) -> tuple[str, bytes] | None:
    """The shared library of this machine and its place in the FMU; None where no compiler is there, or none works."""
    place = {("linux", "x86_64"): ("linux64", ".so"), ("darwin", "x86_64"): ("darwin64", ".dylib")}
    platform_of = place.get((sys.platform, platform.machine()))
    compiler = next((path for path in map(shutil.which, ("cc", "gcc", "clang")) if path), None)
    if platform_of is None or compiler is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        for path, text in sources.items():
            (Path(folder) / path).write_text(text, encoding="utf-8")
        out = f"{name}{platform_of[1]}"
        done = subprocess.run(
            [compiler, *FLAGS, "-o", out, *(path for path in sources if path.endswith(".c")), "-lm"],
            cwd=folder, capture_output=True, check=False,
        )  # fmt: skip
        if done.returncode != 0:
            return None
        return f"binaries/{platform_of[0]}/{out}", (Path(folder) / out).read_bytes()


Files = Iterator[tuple[str, str | bytes]]
VECTOR_COLUMNS = "law,case,before,reference,reference_rate,torque,from_duty,expected,status"


def _common(job: Job) -> Files:
    lines = [VECTOR_COLUMNS]
    for v in job.vectors:  # `before` 1 is a reset, 2 a bumpless start from `from_duty`
        numbers = ",".join(decimal(x) for x in (v.reference, v.rate, v.torque, v.duty, v.expected))
        lines.append(f"{v.law},{v.case},{v.before},{numbers},{v.status}")
    yield "vectors.csv", "\n".join(lines) + "\n"
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


# Target → the files it makes: name and content
TARGETS: dict[str, Callable[[Job], Files]] = {
    "c": _c,
    "arduino": _arduino,
    "matlab": _matlab,
    "fmu": _fmu,
    "yaml": _yaml,
}
