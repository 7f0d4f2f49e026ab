"""Tables of the report: results in, one `Table` out, for the terminal and for the page."""

from eaid.report.tables.table import SYMBOLS, Column, Name, Table, columns, interval, level, number, text

__all__ = ["SYMBOLS", "Column", "Name", "Table", "columns", "interval", "level", "number", "text"]
