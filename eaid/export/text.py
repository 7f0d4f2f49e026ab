"""Numbers and heads as the texts of a target have them."""

import math
import re
from typing import Any

import numpy as np


def hexadecimal(value: Any) -> str:
    """A C99 hex float, exact: float for a numpy.float32, double for a float; integers as unsigned."""
    if isinstance(value, int):
        return f"{value}U"
    suffix = "F" if isinstance(value, np.float32) else ""
    number = float(value)
    if math.isnan(number):
        return "EAID_NAN"
    if math.isinf(number):
        return "EAID_INF" if number > 0 else "-EAID_INF"
    mantissa, exponent = number.hex().split("p")
    head, _, rest = mantissa.partition(".")
    rest = rest.rstrip("0")
    return f"{head}.{rest or '0'}p{exponent}{suffix}"


def decimal(value: Any) -> str:
    """The shortest decimal that gives the number back, always with a point: YAML and C both take it for a real one."""
    if isinstance(value, int):
        return str(value)
    number = float(value)
    text = str(value) if isinstance(value, np.float32) else repr(number)
    if not math.isfinite(number):
        return {"nan": "NaN", "inf": "Inf", "-inf": "-Inf"}[text]
    mantissa, mark, exponent = text.partition("e")
    return f"{mantissa if '.' in mantissa else mantissa + '.0'}{mark}{exponent}"


def commented(lines: list[str], before: str) -> str:
    """The head's lines behind a comment mark; nothing in them can end the comment."""
    return "\n".join((before + harmless(line)).rstrip() for line in lines)


def harmless(text: str) -> str:
    """A text of one line that ends no comment and goes on to no next line, whatever a file or a unit is called."""
    return " ".join(text.split()).replace("*/", "* /").replace("/*", "/ *").rstrip("\\ ")


def unit_name(text: str) -> str:
    """A unit as any language may hold it: one short word, no quotes."""
    return harmless(re.sub(r"[\"'\\{}<>]", "", text))[:20] or "1"
