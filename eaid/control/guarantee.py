"""One verdict on the guarantee: what the Lyapunov argument needs, beside what is there.

rho          ρ(0) covers Eq. (15) with the α really reached
phi          |η − η̂| that the data show ≤ what φ allows
Q_M          largest slope of the reference ≤ Q_M
duty-limit   B̂ρ(0), what the robust term asks for outside the boundary layer ≤ what the actuator spans
dead-time    none: the argument is about a plant that answers at once; a row only where the steps show one
"""

from collections.abc import Sequence

from eaid.results.gains import Condition, Guarantee

WITHIN = 1e-9
"""Share by which the needed may exceed the available: rounding."""


def condition(name: str, needed: float | None, available: float | None, unit: str) -> Condition:
    """One condition; it cannot be told where one of the two is not known."""
    known = needed is not None and available is not None
    holds = None if needed is None or available is None else bool(needed <= available * (1 + WITHIN))
    return Condition(name, holds if known else None, needed, available, unit)


def guarantee(conditions: Sequence[Condition]) -> Guarantee:
    """It holds where every condition does; it cannot be told where none fails and one is not known."""
    verdicts = [each.holds for each in conditions]
    holds = False if False in verdicts else None if None in verdicts else True
    return Guarantee(holds, tuple(conditions))
