"""Sentences about exports: what stands at the head of every exported file."""

from eaid.findings.row import Row, Values, caution, note, stop


def _margins(v: Values) -> str:
    told = []
    for law in ("rc", "pi"):
        units = (("gain_db", "dB"), ("phase_deg", "° of phase"), ("delay_s", "s of delay"))
        parts = [f"{v[f'{law}_{key}']:.3g} {unit}" for key, unit in units if v.get(f"{law}_{key}") is not None]
        told += [f"{law.upper()} {', '.join(parts)}"] if parts else []
    return f"least margins around the fitted duties: {'; '.join(told)}"


def _guarantee(v: Values) -> str:
    missing = f" (missing: {v['missing']})" if v["missing"] else ""
    return f"RC: the Lyapunov guarantee does not hold on this rig{missing}; the margins are what speaks for these gains"


ROWS: dict[str, Row] = {
    "export-unstable": stop(
        "{subject}: the loop is unstable at {rate_hz:g} Hz around {levels} {unit}; ask for slower gains"
    ),
    "export-unidentified": stop("the {subject} rest on a fit that is not identifiable: {why}"),
    "export-not-converged": stop("the nonlinear model did not converge; fit it again before a rig runs on it"),
    "export-guarantee-holds": note("RC: ρ covers what the fit knows of the rig, Eq. (15)"),
    "export-guarantee-missing": caution(_guarantee),
    "export-guarantee-unknown": caution("RC: these gains do not say whether the guarantee holds"),
    "export-margins": note(_margins),
    "export-other-rate": caution(
        "exported for {rate_hz:g} Hz, the gains were made for {made_hz:g} Hz: their margins are not these"
    ),
    "export-no-release": caution(
        "no release was fitted: how the torque falls to rest is an assumption of the {subject}"
    ),
    "export-fault-outside": caution(
        "the duty on fault, {duty:g} {unit}, lies outside the duty limits {low:g} to {high:g} {unit}"
    ),
    "export-anyway": caution("EXPORTED ANYWAY: a finding of severity stop stands; do not run it on a person"),
}
