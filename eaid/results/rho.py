"""The size ρ of the robust term, Eq. (15), in both readings, and what it is made of."""

from eaid.results.common import Number, Result


class RhoLine(Result, frozen=True):
    """ρ(ξ) = constant + slope ‖ξ‖ [N·m/s]."""

    constant: Number
    slope: Number


class RhoTerms(Result, frozen=True):
    """The shares of ρ's constant [N·m/s]."""

    reference_nm_s: Number | None = None
    phi_nm_s: Number | None = None


class RhoReading(Result, frozen=True):
    """ρ under one reading of Eq. (15) with the same number φ."""

    phi: Number | None = None
    phi_term_nm_s: Number | None = None
    phi_honest_pct: Number | None = None
    constant: Number | None = None
    slope: Number | None = None


class RhoReadings(Result, frozen=True):
    """ρ under both readings."""

    paper: RhoReading | None = None
    textbook: RhoReading | None = None


class Rho(Result, frozen=True):
    """ρ(ξ) = constant + slope ‖ξ‖ [N·m/s] in the chosen reading, and what Eq. (15) needs with the α reached."""

    constant: Number
    slope: Number
    convention: str = "paper"
    alpha: Number | None = None
    terms: RhoTerms | None = None
    needed: RhoLine | None = None
    readings: RhoReadings | None = None
