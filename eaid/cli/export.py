"""`eaid export`: gains and fit → source for a rig."""

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, cast

import typer

from eaid.cli import console
from eaid.cli.options import Force, Json, Output, Quiet
from eaid.errors import UsageError

if TYPE_CHECKING:
    from eaid.results.fit import Fit
    from eaid.results.gains import Gains

Read = Annotated[
    list[Path], typer.Argument(metavar="GAINS [FIT]", help="gains.json, and fit.json for inverse and plant.")
]
As = Annotated[str, typer.Option("--as", help="c, arduino, matlab, fmu, yaml, json, python or modelica.")]
Law = Annotated[str | None, typer.Option("--law", help="pi,rc,inverse,plant; default: all that the files hold.")]
Precision = Annotated[str, typer.Option("--precision", help="double or single.")]
RateHz = Annotated[float | None, typer.Option("--rate-hz", help="Control rate, baked in [Hz]; default: the gains'.")]
Corner = Annotated[
    float | None,
    typer.Option("--rate-filter-hz", help="Corner of the reference's filtered derivative [Hz]; default 25."),
]
OnFault = Annotated[float, typer.Option("--duty-on-fault", help="Duty while an input is no number.")]
Stuck = Annotated[float, typer.Option("--stuck-s", help="The status tells of a reading unchanged for so long [s].")]
Anyway = Annotated[bool, typer.Option("--anyway", help="Export what would be refused; its files are marked.")]
Verbose = Annotated[bool, typer.Option("--verbose", help="Tell all findings.")]


def command(
    read: Read,
    target: As = "c",
    law: Law = None,
    precision: Precision = "double",
    rate_hz: RateHz = None,
    rate_filter_hz: Corner = None,
    duty_on_fault: OnFault = 0.0,
    stuck_s: Stuck = 0.5,
    anyway: Anyway = False,
    output: Output = None,
    json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
    verbose: Verbose = False,
) -> None:
    """Controllers and plant as source for a rig: a folder with test vectors, a check program and a page how to begin.

    Exit code 5: a loop is unstable at the rate, or a result marked stop is behind it; --anyway exports it, marked.
    """
    console.be_quiet(quiet)
    from eaid.export.export import export
    from eaid.export.options import ExportOptions
    from eaid.files import sha256_of
    from eaid.results.common import Input

    gains, fit, paths = _read(read)
    options = ExportOptions(
        target=target, folder=output or Path("export"), force=force,
        laws=tuple(name.strip() for name in law.split(",")) if law is not None else None,
        precision=cast(Literal["double", "single"], precision), rate_hz=rate_hz, rate_filter_hz=rate_filter_hz,
        duty_on_fault=duty_on_fault, stuck_s=stuck_s, anyway=anyway,
        command=shlex.join(["eaid", *sys.argv[1:]]) if sys.argv[1:2] == ["export"] else "",
        inputs=tuple(Input(str(path), sha256_of(path)) for path in paths),
    )  # fmt: skip
    made = export(gains, fit, options)
    console.tell(made.findings, verbose)
    if json:
        named = {"target": made.target, "laws": list(made.laws), "files": list(made.files), "dt_s": made.dt_s}
        console.print_json({"folder": str(made.path), **named, "findings": [one.code for one in made.findings]})
    console.say(f"{made.path}: {', '.join(made.laws)} as {made.target}, {len(made.files)} files; begin with README.md")


def _read(paths: list[Path]) -> "tuple[Gains | None, Fit | None, list[Path]]":
    """Gains, a fit, or both; the fit that the gains name is taken where it lies beside them, unchanged."""
    from eaid.export.read import fit_beside, kind_of, read_fit, read_gains

    kinds = [kind_of(path) for path in paths]
    if len(set(kinds)) < len(kinds):
        raise UsageError(f"{paths[-1]}: a second {kinds[-1]}.json; give one gains.json and one fit.json at most")
    found = dict(zip(kinds, paths, strict=True))
    gains, told = read_gains(found["gains"]) if "gains" in found else (None, ())
    if gains is not None and "fit" not in found:
        beside = fit_beside(gains, found["gains"])
        if beside is not None:
            found["fit"] = beside
            console.say(f"with {beside}, which the gains were made from")
    fit, more = read_fit(found["fit"]) if "fit" in found else (None, ())
    console.tell((*told, *more))
    return gains, fit, list(found.values())
