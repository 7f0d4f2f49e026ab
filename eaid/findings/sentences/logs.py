"""Sentences about logs: what reading had to do, and what is doubtful in what was read."""

from eaid.findings.row import Row, Values, caution, note, stop


def _held(values: Values) -> str:
    left = f"; {values['left_out']} samples before the first left out" if values["left_out"] else ""
    return f"{values['columns']} recorded at other times than the output: held between samples{left}"


ROWS: dict[str, Row] = {
    "rows-dropped": caution("«repair» dropped {dropped} of {count} rows", size="dropped", always=True),
    "step-row-dropped": caution(
        "«repair» dropped row {row}, at which the input changes ({at_s:.10g} s): the step counts from the next row; "
        "say «step_at» {at_s:.10g} if it began there"
    ),
    "columns-by-place": caution("its columns have no names: taken as {order}"),
    "columns-without-numbers": note("{columns} hold no real numbers and are left out"),
    "input-by-its-steps": caution(
        "{column} is taken as the input, since {still} never steps; say it with «columns» input=NAME"
    ),
    "input-unnamed": caution(
        "{column} is taken as the input, the only column that steps; say it with «columns» input=NAME"
    ),
    "level-times-trigger": note("{column} says when the input is on, the file name that it is {level:g}"),
    "level-contradicted": caution(
        "its name says level {level:g}, its input column goes to {found:g} {unit}: the column counts"
    ),
    "unit-assumed": note("no unit is given for {role} {column}: {unit} assumed; say it with «units» {role}=UNIT"),
    "unit-unknown": caution(
        "no unit is given for {role} {column}: its numbers stay as they are; say it with «units» {role}=UNIT", rank=1
    ),
    "unit-g-unclear": caution(
        "{role} {column} is in {unit}, an acceleration or a weight: its numbers stay as they are; a weight is said by "
        "«units» {role}=gf or kgf"
    ),
    "time-since-1970": note("{column} counts {unit} since 1970, as its first stamp tells"),
    "time-in-days": caution(
        "{column} counts days, as Excel and MATLAB do, by its first stamp and its sample time; else say its unit with "
        "«units» time=UNIT"
    ),
    "time-too-fast": stop(
        "no unit fits {column}: in seconds its rate would be {rate_hz:.3g} Hz; say it with «units» time={likely} or "
        "what it is"
    ),
    "time-too-long": stop(
        "no unit is given for {column}, whole numbers {usual_s:g} apart: in seconds the log would take {span_s:.4g} s; "
        "say it with «units» time={likely} or time=s"
    ),
    "time-in-whole-numbers": caution(
        "no unit is given for {column}, whole numbers {usual_s:g} apart: seconds assumed; if they are ms or samples, "
        "say «units» time={likely} or «rate_hz» HZ"
    ),
    "torque-too-large": stop(
        "the torque reaches {largest:.4g} N·m, beyond any clutch: counts, or another unit; say «units» output=UNIT"
    ),
    "input-in-fractions": stop(
        "its input stays within 1 while that of other logs goes to {other:g} %: a fraction is read apart with «units» "
        "input=fraction; if all are in %, say «units» input=%"
    ),
    "log-given-twice": caution("{path} is the same log as {first} (equal SHA-256): it counts once"),
    "signals-held": caution(_held),
    "logs-joined": note("joined with {others}"),
    "log-changed": caution("the log has changed since its manifest was written"),
}
