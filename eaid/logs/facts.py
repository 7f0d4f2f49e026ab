"""What stands above a table of numbers: facts in comment and metadata lines, among them the sample rate."""

import re

from eaid.logs.marks import COMMENT, number
from eaid.logs.units import unit_of


def facts_of(lines: list[str], delimiter: str | None) -> dict[str, str]:
    """Facts in the lines above the table: `key: value`, `key = value`, `key<delimiter>value`."""
    said = {}
    for line in lines:
        bare = line.strip().lstrip("#%/ ").strip()
        found = re.match(r"([^:=]{1,60}?)\s*[:=]\s*(\S.*)$", bare)
        if not found and delimiter and bare.count(delimiter):
            found = re.match(
                rf"([^{re.escape(delimiter)}]{{1,60}}){re.escape(delimiter)}+([^{re.escape(delimiter)}]+)", bare
            )
        if found:
            said[found.group(1).strip().lower()] = found.group(2).strip().strip('"')
        elif bare and line.lstrip().startswith(COMMENT):
            said[""] = f"{said.get('', '')} {bare}".strip()
    return said


def rate_said(said: dict[str, str]) -> float | None:
    """Sample rate told in a comment [Hz]: `sampling rate: 1 kHz`, `dt = 0.001 s`, `sampled at 500 Hz`; else None."""
    for key, value in said.items():
        free = re.search(r"([\d.,]+(?:[eE][+-]?\d+)?)\s*(k|m)?(hz|s/s|sps|samples)\b", value, re.IGNORECASE)
        if not key and free and re.search(r"sampl|abtast|rate|fs\b|daq|acqui", value, re.IGNORECASE):
            amount = number(free.group(1).replace(",", "."), ".", "")
            if amount and amount > 0:
                return amount * {"k": 1e3, "m": 1e6}.get((free.group(2) or "").lower(), 1.0)
        found = re.match(r"([\d.,]+(?:[eE][+-]?\d+)?)\s*([a-zA-Zµμ/]*)", value)
        amount = number(found.group(1).replace(",", "."), ".", "") if found else None
        if not found or not amount or amount <= 0:
            continue
        unit = found.group(2) or "".join(re.findall(r"[\[(]\s*([a-zA-Zµμ]+)\s*[\])]", key))
        if re.search(r"(sampl|abtast|acquisition|scan).*(rate|freq|hz)|^(fs|f_s|rate|frequency)\b", key):
            factor = {"khz": 1e3, "mhz": 1e6}.get(unit.lower(), 1.0)
            return amount * factor
        if re.search(r"(sampl|scan).*(time|interval|period|step)|^(dt|delta[_ ]?[xt])\b", key):
            known = unit_of(unit) if unit else None
            return 1.0 / (amount * (known.factor if known and known.quantity == "time" else 1.0))
    return None
