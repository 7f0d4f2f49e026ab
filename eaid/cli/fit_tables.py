"""What `eaid fit` prints: the answer in a few lines, the tables of the report page on request, and a small plot."""

from eaid.cli import console
from eaid.report.tables import checks, fits
from eaid.report.tables.table import Table
from eaid.results.fit import Fit
from eaid.results.summary import fit_summary


def show(fit: Fit, tables: bool, verbose: bool) -> None:
    """The fit in a few lines, or all of its tables."""
    for line in fit_summary(fit, findings=0):
        console.line(line)
    for table in tables_of(fit, verbose) if tables else ():
        if table.rows:
            console.show(table)


def tables_of(fit: Fit, verbose: bool) -> list[Table]:
    """The tables of each model; with `verbose` those that judge the fit too."""
    found: list[Table] = []
    if fit.friction is not None:
        found.append(fits.levels_table(fit))
        if fit.friction.trends:
            found.append(fits.trends_table(fit, asked=False))
    if fit.nonlinear is not None:
        found += [fits.table_iii(fit, asked=False), checks.estimates_table(fit)]
    if fit.linear is not None:
        found += [fits.linear_table(fit, asked=False), fits.input_gain_table(fit, asked=False)]
    if fit.release is not None:
        found.append(fits.release_table(fit))
    found += [fits.level_steps_table(fit), fits.held_out_table(fit), *fits.huber_tables(fit)]
    if verbose:
        found += [checks.lack_of_fit_table(fit), checks.shapes_table(fit), checks.degrees_table(fit)]
    if fit.recorded is not None:
        from eaid.report.tables.recorded import recorded_tables

        found += recorded_tables(fit)
    return found
