"""Every table of a fit, for the page and the terminal: those of its models, and those that judge it."""

from eaid.report.tables import checks, fits, recorded
from eaid.report.tables.table import Table
from eaid.results.fit import Fit


def model_tables(fit: Fit, asked: bool | None = None) -> list[Table]:
    """Values of each model, logs as recorded and single levels first; tables without rows are left out."""
    found = recorded.recorded_tables(fit)
    if fit.friction is not None:
        found.append(fits.levels_table(fit))
        if fit.friction.trends:
            found.append(fits.trends_table(fit, asked))
    found.append(fits.level_steps_table(fit))
    if fit.nonlinear is not None:
        found += [fits.table_iii(fit, asked), checks.estimates_table(fit)]
    if fit.linear is not None:
        found += [fits.linear_table(fit, asked), fits.input_gain_table(fit, asked)]
    if fit.release is not None:
        found.append(fits.release_table(fit))
    return [table for table in (*found, fits.held_out_table(fit), *fits.huber_tables(fit)) if table.rows]


def judging_tables(fit: Fit) -> list[Table]:
    """Whether the model is right, and whether another would be better; tables without rows are left out."""
    found = (checks.lack_of_fit_table(fit), checks.shapes_table(fit), checks.degrees_table(fit))
    return [table for table in found if table.rows]
