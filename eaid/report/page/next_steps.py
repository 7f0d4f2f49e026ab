"""What to do next, at most three things each with its command, and the commands that make the same files again."""

import shlex
from dataclasses import dataclass

from eaid.report.page.known import Known
from eaid.report.page.recording import what_to_record
from eaid.report.results import Given, Results
from eaid.report.tables.gains import called, conditions_of
from eaid.results.fit import Fit
from eaid.results.gains import Gains

MENDED = {"rho": "--alpha reached", "phi": "--phi data", "Q_M": "--reference multisine"}
"""Condition of the guarantee → the option by which tune-rc meets it."""


@dataclass(frozen=True)
class Step:
    """One thing to do next, and the command that does it."""

    why: str
    command: str


def next_steps(results: Results, known: Known) -> tuple[Step, ...]:
    """At most three things to do, each with its command."""
    clutch = next((fit for fit in results.fits if fit.result.data.kind == "clutch"), None)
    fit = clutch or next(iter(results.fits), None)
    if fit is None:
        return _without_fit(results)
    fit_json = shlex.quote(fit.path)
    stopped = any(found.severity == "stop" for found in known["model"])
    gains = None if stopped else next(iter(results.gains), None)
    steps: list[Step] = []
    if not results.gains and clutch is not None and may_be_controlled(clutch.result) and not stopped:
        steps.append(Step("Design the controllers", f"eaid tune-rc {fit_json} -o gains.json"))
    if gains is not None:
        steps += _better_gains(gains, fit_json)
        if not any(replay.result.head.scenario == "multisine" for replay in results.replays):
            line = f"eaid simulate {fit_json} --gains {shlex.quote(gains.path)} --scenario multisine -o multisine.h5"
            steps.append(Step("Try the controllers on the fitted model", line))
    if record := what_to_record(fit.result):
        why, options = record
        steps.append(Step(why, f"eaid plan {fit_json} {options}".rstrip() + " -o plan.csv"))
    if gains is not None:
        holds = all(row.holds for row in conditions_of(gains.result))
        why = "Take these gains to the rig" if holds else "Take these gains to the rig, without a guarantee"
        steps.append(Step(why, f"eaid export {shlex.quote(gains.path)} --as c -o rig"))
    return tuple(steps[:3])


def _better_gains(gains: Given[Gains], fit_json: str) -> list[Step]:
    """Gains whose guarantee holds, where an option of tune-rc meets a condition that is missed."""
    missing = [row for row in conditions_of(gains.result) if row.holds is False]
    options = " ".join(MENDED[row.name] for row in missing if row.name in MENDED)
    if not options:
        return []
    why = f"Ask for gains whose guarantee holds ({', '.join(called(row) for row in missing)})"
    return [Step(why, f"eaid tune-rc {fit_json} {options} -o {shlex.quote(gains.path)} --force")]


def may_be_controlled(fit: Fit) -> bool:
    """Whether tune-rc takes the fit: its linear model is known, and more input gives more output."""
    part = fit.linear
    return part is not None and part.identifiable is not False and part.a0 > 0 and part.b0 > 0


def _without_fit(results: Results) -> tuple[Step, ...]:
    """The data are fitted; a loop's log becomes a model where its input was recorded too."""
    if not results.edge_logs:
        return tuple(
            Step("Fit the data", f"eaid fit {shlex.quote(data.path)} -o fit.json") for data in results.data[:1]
        )
    file = next(data.path for data in results.data if data.result.recorded)
    if all(log.run.has_input for log in results.edge_logs):
        return (Step("Fit the log as it was recorded", f"eaid fit {shlex.quote(file)} -o fit.json"),)
    why = "For a model, record the input (what the controller commands) as one more column, then"
    return (Step(why, "eaid fit LOGS -o fit.json"),)


def commands(results: Results) -> list[str]:
    """Command lines that make these files again; a result of the Python API says so."""
    made = [("fit", fit.path, fit.result.command) for fit in results.fits]
    made += [("tune-rc", gains.path, gains.result.command) for gains in results.gains]
    made += [("simulate", replay.path, replay.result.head.command) for replay in results.replays]
    made += [("couple", walls.path, walls.result.command) for walls in results.couplings]
    lines = [f"eaid ingest LOGS -o {shlex.quote(data.path)}" for data in results.data]
    for command, path, words in made:
        line = shlex.join(["eaid", command, *words, "-o", path])
        lines.append(line if words else f"{path}: made in Python by eaid.{command.replace('-', '_')}")
    return [*lines, shlex.join(["eaid", "report", *(given.path for given in results.every), "-o", "report"])]
