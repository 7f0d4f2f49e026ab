"""The apparatus that a fit.json names."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from eaid.apparatus import Apparatus


def apparatus_of(fit_data: Mapping[str, Any]) -> Apparatus:
    """The rig of the `data` part of a fit.json; the paper's values where it names none."""
    known = {f.name for f in fields(Apparatus)}
    given = {key: value for key, value in (fit_data.get("apparatus") or {}).items() if key in known}
    if "surfaces" not in given and str(fit_data.get("kind", "clutch")).startswith("friction"):
        given["surfaces"] = 1
    return Apparatus(**given)
