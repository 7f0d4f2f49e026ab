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
from functools import cache
from html import escape
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from eaid.errors import UsageError
from eaid.export.constants import SERIES, commented, decimal, hexadecimal, namespace, rounded
from eaid.export.job import Job
from eaid.shown import input_word, output_word
from eaid.synth.files import input_column

# Every file of an export bears it near its beginning, an FMU at its end, vectors.csv its columns instead
MADE_BY = b", made by eaid "
COMPILER_FLAGS = ("-O2", "-std=c99", "-fPIC", "-shared", "-ffp-contract=off", "-fvisibility=hidden")
Files = Iterator[tuple[str, str | bytes]]
WHOLE_US = 0.0005  # Part of a period by which a whole number of microseconds may lie off it
VECTOR_COLUMNS = "law,case,before,reference,reference_rate,torque,from_duty,expected,status"


@cache
def environment() -> Environment:
    """The templates and their filters."""
    made = Environment(  # autoescape: sources are no markup; XML is escaped by its own filter
        loader=PackageLoader("eaid.export"), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        keep_trailing_newline=True, autoescape=False,
    )  # fmt: skip
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
    rig, names = job.rig, job.laws
    single = rig.precision == "single"
    series = rounded(SERIES[rig.precision], rig.precision)
    rate = namespace(job.constants["rate"], series) if "rate" in job.constants else None
    models = [job.constants["plant"]] if "plant" in names else []
    models += [e.value for e in job.constants.get("inverse", ()) if e.name == "plant"]
    return {
        "job": job,
        "rig": rig,
        "pi": math.pi,
        "head": list(job.head),
        "laws": {name: job.constants[name] for name in names},
        "names": names,
        "integrals": [name for name in names if name not in ("inverse", "plant")],
        "controllers": [name for name in names if name != "plant"],
        "series": series,
        "rate": rate,
        "plant": {e.name: e.value for model in models[:1] for e in model},
        "pieces": [e.name[:-5] for model in models[:1] for e in model if e.name.endswith("_from")],
        "single": single,
        "timing": {name: rounded(getattr(rig, name), rig.precision) for name in ("dt_s", "duty_on_fault")},
        "dt_text": decimal(rig.dt_s),
        "law": next((name for name in ("rc", "pi", "pi_feedforward", "inverse") if name in names), "plant"),
        "log_header": log_header(rig.input, rig.output),
    }  # fmt: skip


def log_header(into: str, out: str) -> str:
    """Columns of a log, as `eaid` finds them by name, with the units of input and output."""
    torque, reference = ("torque_nm", "reference_nm") if out == "N·m" else (f"output ({out})", f"reference ({out})")
    return f"time_s,{input_column('clutch', into)},{torque},{reference}"


def _zipped(name: str, description: str, sources: Mapping[str, str]) -> bytes:
    whole, made = io.BytesIO(), binary(name, sources)
    texts = {"modelDescription.xml": description, **{f"sources/{path}": text for path, text in sources.items()}}
    with zipfile.ZipFile(whole, "w") as file:
        for path, data in [*((path, text.encode()) for path, text in texts.items()), *filter(None, [made])]:
            entry = zipfile.ZipInfo(path)  # dated 1980
            entry.external_attr = 0o644 << 16
            file.writestr(entry, data, zipfile.ZIP_DEFLATED)
        file.comment = name.encode() + MADE_BY
    return whole.getvalue()


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
            [compiler, *COMPILER_FLAGS, "-o", out, *(path for path in sources if path.endswith(".c")), "-lm"],
            cwd=folder, capture_output=True, check=False,
        )  # fmt: skip
        if done.returncode != 0:
            return None
        return f"binaries/{platform_of[0]}/{out}", (Path(folder) / out).read_bytes()


def _common(job: Job) -> Files:
    lines = [VECTOR_COLUMNS]
    for v in job.vectors:  # `before` 1 is a reset, 2 a bumpless start from `from_duty`
        numbers = ",".join(decimal(x) for x in (v.reference, v.rate, v.torque, v.duty, v.expected))
        lines.append(f"{v.law},{v.case},{v.before},{numbers},{v.status}")
    yield "vectors.csv", "\n".join(lines) + "\n"
    words = input_word(job.rig.input), output_word(job.rig.output)
    yield "README.md", rendered(job, "README.md.j2", target=job.target, words=words)


def _c(job: Job) -> Files:
    for name in ("eaid_control.h", "eaid_control.c", "check.c", "vectors.h", "Makefile"):
        yield name, rendered(job, f"{name}.j2")
    yield from _common(job)


def _arduino(job: Job) -> Files:
    yield from _c(job)
    if set(job.laws) - {"plant"}:
        step_us = job.rig.dt_s * 1e6
        if abs(round(step_us) - step_us) > WHOLE_US * step_us:
            near = " or ".join(f"{1e6 / whole:.8g}" for whole in (math.ceil(step_us), math.floor(step_us)) if whole)
            raise UsageError(
                f"«rate_hz» {1 / job.rig.dt_s:.8g}: an Arduino counts whole microseconds, and {step_us:.6g}, its "
                f"period, is none; give {near}"
            )
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
    files = dict(_c(job))
    for law in job.laws:
        sources = {
            "eaid_control.h": str(files["eaid_control.h"]),
            "eaid_control.c": str(files["eaid_control.c"]),
            "fmi2_wrapper.c": rendered(job, "fmi2_wrapper.c.j2", law=law),
        }
        guid = hashlib.sha256("".join(sources.values()).encode()).hexdigest()[:32]
        sources["fmi2_wrapper.c"] = sources["fmi2_wrapper.c"].replace("@GUID@", guid)
        description = rendered(job, "modelDescription.xml.j2", law=law, guid=guid)
        yield f"eaid_{law}.fmu", _zipped(f"eaid_{law}", description, sources)
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
