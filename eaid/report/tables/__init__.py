"""Tables of the report: results in, one `Table` out, for the terminal and for the page."""
