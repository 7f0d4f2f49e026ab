"""What `eaid fit` prints: the answer in a few lines, the tables of the report page on request."""

from eaid.cli import console
from eaid.report.tables.every import judging_tables, model_tables
from eaid.results.fit import Fit
from eaid.results.summary import fit_summary


def show(fit: Fit, tables: bool, verbose: bool) -> None:
    """The fit in a few lines, and all of its tables; with `verbose` those that judge the fit too."""
    for line in fit_summary(fit, findings=0):
        console.line(line)
    found = model_tables(fit, asked=False) if tables else []
    for table in [*found, *(judging_tables(fit) if tables and verbose else ())]:
        console.show(table)
