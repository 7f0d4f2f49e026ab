"""FMI 2.0 co-simulation: one FMU a law, its C sources inside, and a binary where this machine has a C compiler.

An FMU is a zip of modelDescription.xml, sources/ and binaries/PLATFORM/. Time stamps are fixed: the same export, the
same bytes.
"""

import hashlib
import io
import platform
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from eaid.export.job import Job
from eaid.export.render import rendered

COMPILERS = ("cc", "gcc", "clang")
FLAGS = ("-O2", "-std=c99", "-fPIC", "-shared", "-ffp-contract=off", "-fvisibility=hidden")
STAMP = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True)
class Variable:
    """One variable of a modelDescription.xml; its value reference is its place in the list."""

    name: str
    causality: str
    kind: str
    """Real, Integer or Boolean."""
    unit: str
    words: str
    start: str = ""


def variables(law: str, duty_on_fault: float) -> tuple[Variable, ...]:
    """The variables of a law's FMU; units as i and o."""
    status = Variable("status", "output", "Integer", "", "bits: 1 not ready, 2 bad input, 4 and 8 limits, 16 stuck")
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
        own = variables(law, float(job.timing.duty_on_fault))
        description = rendered(job, "modelDescription.xml.j2", law=law, guid=guid, variables=own)
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
    return whole.getvalue()


def _put(file: zipfile.ZipFile, path: str, data: bytes) -> None:
    entry = zipfile.ZipInfo(path, STAMP)
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.external_attr = 0o644 << 16
    file.writestr(entry, data)


def binary(name: str, sources: Mapping[str, str]) -> tuple[str, bytes] | None:
    """The shared library of this machine and its place in the FMU; None where no compiler is there, or none works."""
    place = {("linux", "x86_64"): ("linux64", ".so"), ("darwin", "x86_64"): ("darwin64", ".dylib")}
    found = place.get((sys.platform, platform.machine()))
    compiler = next((path for path in map(shutil.which, COMPILERS) if path), None)
    if found is None or compiler is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        for path, text in sources.items():
            (Path(folder) / path).write_text(text, encoding="utf-8")
        out = f"{name}{found[1]}"
        done = subprocess.run(
            [compiler, *FLAGS, "-o", out, *(path for path in sources if path.endswith(".c")), "-lm"],
            cwd=folder, capture_output=True, check=False,
        )  # fmt: skip
        if done.returncode != 0:
            return None
        return f"binaries/{found[0]}/{out}", (Path(folder) / out).read_bytes()
