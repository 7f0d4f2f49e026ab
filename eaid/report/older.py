"""fit.json and gains.json of the commands that still write texts in place of findings, as their types."""

import json
from pathlib import Path
from typing import Any

from eaid.errors import DataError
from eaid.findings import Finding, finding
from eaid.results import codec
from eaid.results.fit import Fit
from eaid.results.gains import Condition, Gains, Guarantee


def read_fit(path: Path) -> tuple[Fit, tuple[Finding, ...]]:
    """A fit; agreement that is no list is left out, warnings become findings."""
    found: list[Finding] = []
    try:
        fit, left = codec.read(path, "fit", Fit)
        found += left
    except DataError:
        if not path.is_file():
            raise
        content = json.loads(path.read_text(encoding="utf-8"))
        parts = [content.get(name) for name in ("nonlinear", "linear")] if isinstance(content, dict) else []
        old = [part for part in parts if isinstance(part, dict) and isinstance(part.get("agreement"), dict)]
        if not old:
            raise
        for part in old:
            del part["agreement"]
        fit = codec.from_plain(content, Fit, str(path), found)
    content = json.loads(path.read_text(encoding="utf-8"))
    return _with_findings(fit, content, ("friction", "nonlinear", "linear", "release")), tuple(found)


def read_gains(path: Path) -> tuple[Gains, tuple[Finding, ...]]:
    """Gains; warnings become findings, the guarantee's conditions are gathered where the file has none."""
    gains, found = codec.read(path, "gains", Gains)
    gains = _with_findings(gains, json.loads(path.read_text(encoding="utf-8")), ())
    if gains.guarantee is None and gains.rc is not None:
        import msgspec

        gains = msgspec.structs.replace(gains, guarantee=_guarantee(gains))
    return gains, found


def _with_findings(result: Any, content: dict[str, Any], parts: tuple[str, ...]) -> Any:
    import msgspec

    if "findings" in content:
        return result
    texts = [("said-by-the-file", "fit" if parts else "rc", text) for text in content.get("warnings") or []]
    for name in parts:
        part = content.get(name) or {}
        texts += [("not-settled", name, text) for text in part.get("not_identifiable_because") or []]
        texts += [("said-by-the-file", name, text) for key in ("warnings", "open") for text in part.get(key) or []]
    once = dict.fromkeys(one for one in texts if isinstance(one[2], str))
    return msgspec.structs.replace(result, findings=tuple(finding(code, part, text=t) for code, part, t in once))


def _guarantee(gains: Gains) -> Guarantee:
    rc = gains.rc
    assert rc is not None
    needed, slope = rc.rho.needed, rc.reference_slope_nm_s
    if slope is None and gains.replayed is not None:
        slope = gains.replayed.slope_nm_s
    span = gains.actuator
    q_holds = rc.Q_M_holds if rc.Q_M_holds is not None or slope is None or rc.Q_M is None else slope <= rc.Q_M
    rows = [
        Condition("rho", rc.guaranteed, needed.constant if needed else None, rc.rho.constant, f"{gains.output_unit}/s"),
        Condition("phi", rc.phi_holds, rc.phi_needed_pct, rc.phi_honest_pct, gains.input_unit),
        Condition("Q_M", q_holds, slope, rc.Q_M, f"{gains.output_unit}/s"),
    ]
    if span is not None and span.robust_term_pct is not None and span.span_pct is not None:
        holds = span.robust_term_pct <= span.span_pct
        rows.append(Condition("duty-limit", holds, span.robust_term_pct, span.span_pct, gains.input_unit))
    states = [row.holds for row in rows]
    return Guarantee(False if False in states else None if None in states else True, tuple(rows))
