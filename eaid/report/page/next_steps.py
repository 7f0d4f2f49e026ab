"""What to do next, at most three things each with its command, and the commands that make the same files again."""

import shlex
from dataclasses import dataclass

from eaid.report.page.known import Known
from eaid.report.page.recording import what_to_record
from eaid.report.results import Results
from eaid.report.tables.gains import called, conditions_of
from eaid.results.fit import Fit

MENDED = {"rho": "--alpha reached", "phi": "--phi data", "Q_M": "--reference multisine"}
"""Condition of the guarantee → the option by which tune-rc meets it."""


@dataclass(frozen=True)
class Step:
    """One thing to do next, and the command that does it."""

    why: str
    command: str


def next_steps(results: Results, known: Known) -> tuple[Step, ...]:
    """At most three things to do, each with its command."""
    clutch = next((one for one in results.fits if one.result.data.kind == "clutch"), None)
    fit = clutch or next(iter(results.fits), None)
    if fit is None and results.edge_logs:
        return _of_loop(results)
    if fit is None:
        return tuple(Step("Fit the data", f"eaid fit {shlex.quote(one.path)} -o fit.json") for one in results.data[:1])
    name, gains = shlex.quote(fit.path), next(iter(results.gains), None)
    stopped = any(one.severity == "stop" for one in known["model"])
    found: list[Step] = []
    if gains is None and clutch is not None and may_be_controlled(clutch.result) and not stopped:
        found.append(Step("Design the controllers", f"eaid tune-rc {name} -o gains.json"))
    if gains is not None and not stopped:
        given = shlex.quote(gains.path)
        missing = [row for row in conditions_of(gains.result) if row.holds is False]
        mended = " ".join(MENDED[row.name] for row in missing if row.name in MENDED)
        if mended:
            why = f"Ask for gains whose guarantee holds ({', '.join(called(row) for row in missing)})"
            found.append(Step(why, f"eaid tune-rc {name} {mended} -o {given} --force"))
        if not any(one.result.head.scenario == "multisine" for one in results.replays):
            line = f"eaid simulate {name} --gains {given} --scenario multisine -o multisine.h5"
            found.append(Step("Try the controllers on the fitted model", line))
    if record := what_to_record(fit.result):
        why, options = record
        found.append(Step(why, f"eaid plan {name} {options}".rstrip() + " -o plan.csv"))
    if gains is not None and not stopped:
        told = "" if all(row.holds for row in conditions_of(gains.result)) else ", without a guarantee"
        found.append(Step(f"Take these gains to the rig{told}", f"eaid export {shlex.quote(gains.path)} --as c -o rig"))
    return tuple(found[:3])


def may_be_controlled(fit: Fit) -> bool:
    """Whether tune-rc takes the fit: its linear model is known, and more input gives more output."""
    part = fit.linear
    return part is not None and part.identifiable is not False and part.a0 > 0 and part.b0 > 0


def _of_loop(results: Results) -> tuple[Step, ...]:
    """A loop's log becomes a model where its input was recorded too."""
    file = next(one.path for one in results.data if one.result.recorded)
    if all(log.run.has_input for log in results.edge_logs):
        return (Step("Fit the log as it was recorded", f"eaid fit {shlex.quote(file)} -o fit.json"),)
    why = "For a model, record the input (what the controller commands) as one more column, then"
    return (Step(why, "eaid fit LOGS -o fit.json"),)


def commands(results: Results) -> list[str]:
    """Command lines that make these files again; a result of the Python API says so."""
    made = [("fit", one.path, one.result.command) for one in results.fits]
    made += [("tune-rc", one.path, one.result.command) for one in results.gains]
    made += [("simulate", one.path, one.result.head.command) for one in results.replays]
    made += [("couple", one.path, one.result.command) for one in results.couplings]
    lines = [f"eaid ingest LOGS -o {shlex.quote(data.path)}" for data in results.data]
    for name, path, words in made:
        line = shlex.join(["eaid", name, *words, "-o", path])
        lines.append(line if words else f"{path}: made in Python by eaid.{name.replace('-', '_')}")
    return [*lines, shlex.join(["eaid", "report", *(one.path for one in results.every), "-o", "report"])]
