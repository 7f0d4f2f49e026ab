"""`eaid tune-rc`: a fit → gains of both controllers, and what may be expected of them."""

from pathlib import Path

import eaid
from eaid.cli import console
from eaid.cli.form import Common, argument, stamped, takes, tell_result, written
from eaid.declared import any_text, option
from eaid.files import refuse_to_overwrite
from eaid.options import ROBUST, TRACKED, TuneOptions


@takes
def command(
    args: Common, how: TuneOptions,
    fit: Path = argument("FIT", "fit.json of eaid fit; only its linear part is needed."),
    reference: str | None = option(
        None, "Q_M is taken from it, or judged by it.", ROBUST, words=TRACKED, read=any_text, shown="FILE|WORD"
    ),
    output: Path = written("gains.json"),
) -> None:  # fmt: skip
    """Gains of the robust controller and of a PI from a fit, with one verdict on the guarantee.

    Exit code 5: the fit or the wishes are not physical, out of reach, or unstable on the linear model.

    Example: eaid tune-rc fit.json --b-hat minimax --phi data -o gains.json
    """
    from eaid.report.tables import gains as tables
    from eaid.results import codec
    from eaid.results.summary import of_fit

    file = Path(reference) if reference and reference not in TRACKED else None
    fitted, warnings = codec.read(fit, eaid.Fit)
    refuse_to_overwrite(output, args.force, filter(None, (fit, file)))
    gains = stamped(eaid.tune_rc(fitted, how, reference=reference), args, fit=fit, reference=file)
    gains.save(output, args.force)
    shown = tables.tables_of(gains)[: None if args.verbose else 1]
    tell_result(args, gains, [*of_fit(fitted), *tables.guarantee_story(gains), *shown], [*gains.findings, *warnings])
    console.done(output, f"gains of {' and '.join(gains.laws)}", ("simulate", fit, output))
