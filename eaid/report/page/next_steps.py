"""What to do next, at most three things each with its command, and the commands that make the same files again."""

import shlex

from eaid.export.export import offered
from eaid.report.results import Given, Results
from eaid.report.tables.gains import BEYOND_GAINS, called, conditions_of
from eaid.results.gains import Gains

# Condition of the guarantee → the option by which tune-rc meets it
MENDED = {"rho": "--b-hat minimax", "phi": "--phi data", "Q_M": "--reference multisine"}


Step = tuple[str, str]  # What to do next, and the command that does it


def next_steps(results: Results) -> tuple[Step, ...]:
    """At most three things to do, each with its command."""
    clutch = next((fit for fit in results.fits if fit.result.data.kind == "clutch"), None)
    fit = clutch or next(iter(results.fits), None)
    if fit is None:
        return tuple(("Fit the data", f"eaid fit {shlex.quote(one.path)} -o fit.json") for one in results.data[:1])
    fit_json = shlex.quote(fit.path)
    usable = fit.result.verdict.usable
    gains = next(iter(results.gains), None) if usable else None
    steps: list[Step] = []
    linear = clutch.result.linear if clutch is not None and not results.gains and usable else None
    if linear is not None and linear.a0 > 0 and linear.b0 > 0:
        steps.append(("Design the controllers", f"eaid tune-rc {fit_json} -o gains.json"))
    if gains is not None:
        steps += _better_gains(gains, fit_json)
        if not any(replay.result.head.scenario == "multisine" for replay in results.replays):
            line = f"eaid simulate {fit_json} {shlex.quote(gains.path)} --scenario multisine -o multisine.h5"
            steps.append(("Try the controllers on the fitted model", line))
    if fit.result.nonlinear is not None or fit.result.friction_levels:
        logs = " --excitation" if fit.result.recorded is not None else ""
        why = "Plan what to record next: inputs, holds and repeats for narrower intervals"
        steps.append((why, f"eaid plan {fit_json}{logs} -o plan.csv"))
    if gains is not None:
        holds = all(row.holds for row in conditions_of(gains.result))
        why = "Take these gains to the rig" if holds else "Take these gains to the rig, without a guarantee"
        laws = offered(gains.result, fit.result)
        only = f" --law {','.join(laws)}" if laws else ""
        if laws != ():
            steps.append((why, f"eaid export {shlex.quote(gains.path)} --as c{only} -o rig"))
    return tuple(steps[:3])


def _better_gains(gains: Given[Gains], fit_json: str) -> list[Step]:
    """Gains whose guarantee holds, where an option of tune-rc meets a condition that is missed."""
    missing = [row for row in conditions_of(gains.result) if row.holds is False]
    if any(row.name in BEYOND_GAINS for row in missing):
        return []
    options = " ".join(MENDED[row.name] for row in missing if row.name in MENDED)
    if not options:
        return []
    why = f"Ask for gains whose guarantee holds ({', '.join(called(row) for row in missing)})"
    typed = shlex.join(gains.result.command) or fit_json  # what was asked for stays
    return [(why, f"eaid tune-rc {typed} {options} -o {shlex.quote(gains.path)} --force")]


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
