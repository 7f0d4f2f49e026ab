"""Sixteen plants at once: the loop of `eaid.replay.loop` with time outermost, in a form that becomes vectors.

The same controller steps and `plant_pull` are called; two things make them vector instructions (docs/replay.md):

1. All that a block remembers lies in one flat array, row after row of sixteen; every distance between two accesses is
   then a constant, and the compiler sees without a test at run time that no row overlaps another.
2. No call is left. 1 − e^(−x) on 0 ≤ x ≤ 1 is x·P13(x), P13 the Taylor series of (1 − e^(−x))/x telescoped to degree 13
   by Chebyshev polynomials: relative error 2e-16, thirteen multiply-adds. It holds for dt ≤ τ, and τ is never below
   1 ms. tanh is made of it: e^y − 1 for −64 ≤ y ≤ 0 from y/64 by doubling it six times.
"""

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.chebyshev import cheb2poly, chebadd, chebmulx
from numpy.polynomial.polynomial import polyval

from eaid.arrays import Array
from eaid.replay.controllers import Step
from eaid.replay.loop import Inputs
from eaid.replay.plant import PlantParameters, plant_pull

LANES = 16
"""Plants in a block."""
_PLANT = len(PlantParameters._fields)
_X1, _X2, _SEEN, _DUTY, _STATE, _NEXT = (_PLANT + row for row in range(6))
ROWS = _PLANT + 6
"""Rows of the flat array: the plant's parameters, its states, the filtered torque, the duty, the controller's state
before and after."""


def telescoped(degree: int, terms: int = 26) -> list[float]:
    """Coefficients of (1 − e^(−x))/x on 0 ≤ x ≤ 1, lowest power first: Taylor's, written in the Chebyshev polynomials
    T_n(2x − 1) and cut after `degree`; in exact fractions, rounded once."""
    taylor = [Fraction((-1) ** n, math.factorial(n + 1)) for n in range(terms)]
    x, y = Polynomial([Fraction(1, 2), Fraction(1, 2)]), Polynomial([Fraction(-1), Fraction(2)])  # y = 2x − 1
    in_y: Any = polyval(x, taylor)  # a polynomial of a polynomial is one
    chebyshev: Any = [Fraction(0)]
    for coefficient in in_y.coef[::-1]:
        chebyshev = chebadd(chebmulx(chebyshev), [coefficient])
    in_x: Any = polyval(y, cheb2poly(chebyshev[: degree + 1]))
    return [float(value) for value in in_x.coef]


P0, P1, P2, P3, P4, P5, P6, P7, P8, P9, P10, P11, P12, P13 = telescoped(13)


def expm1_to_minus_one(y: float) -> float:
    """e^y − 1 for −1 ≤ y ≤ 0, without a call: −x·P13(x), x = −y."""
    x = -y
    p = P7 + x * (P8 + x * (P9 + x * (P10 + x * (P11 + x * (P12 + x * P13)))))
    return -x * (P0 + x * (P1 + x * (P2 + x * (P3 + x * (P4 + x * (P5 + x * (P6 + x * p)))))))


def tanh_within(x: float) -> float:
    """tanh x for |x| ≤ 32, without a call: −m/(2 + m), m = e^(−2|x|) − 1, with the sign of x."""
    m = expm1_to_minus_one(-abs(x) / 32.0)
    # e^(2y) − 1 = (e^y − 1)(e^y + 1)
    m = m * (m + 2.0)
    m = m * (m + 2.0)
    m = m * (m + 2.0)
    m = m * (m + 2.0)
    m = m * (m + 2.0)
    m = m * (m + 2.0)
    return math.copysign(-m / (2.0 + m), x)


def short_step(parameters: PlantParameters, x1: float, x2: float, duty: float, dt: float) -> tuple[float, float]:
    """`plant_step` for dt ≤ τ, without a call."""
    fast, slow, tau1, tau2 = plant_pull(parameters, x1, x2, duty)
    return x1 - expm1_to_minus_one(-dt / tau1) * fast, x2 - expm1_to_minus_one(-dt / tau2) * slow


def block_of(law: Step, State: Any, sources: str = "") -> Callable[..., None]:
    """The block's loop around one law whose state, made by `State`, is a tuple of one float."""

    def block(
        gains: Any, start: Any, plants: Array, memory: float, dt: float, inputs: Inputs, torque: Array, duty: Array
    ) -> None:
        """Fill torque and duty, shapes (n, 16), for plants (16 numbers, 16): a rig with no delay, latch, resolution."""
        sources  # noqa: B018 - what a closure holds is part of numba's key
        reference, rate, disturbance, factor = inputs
        lanes = np.zeros(ROWS * LANES)
        for row in range(_PLANT):
            for i in range(LANES):
                lanes[row * LANES + i] = plants[row, i]
        for i in range(LANES):
            lanes[_STATE * LANES + i] = start[0]
        for k in range(len(reference)):
            r = reference[k]
            v = rate[k]
            d = disturbance[k]
            f = factor[k]
            for i in range(LANES):
                true = (lanes[_X1 * LANES + i] + lanes[_X2 * LANES + i]) * f
                filtered = true + memory * (lanes[_SEEN * LANES + i] - true)
                state, u = law(gains, State(lanes[_STATE * LANES + i]), r, v, filtered + d, dt)
                lanes[_SEEN * LANES + i] = filtered
                lanes[_NEXT * LANES + i] = state[0]
                lanes[_DUTY * LANES + i] = u
            for i in range(LANES):
                parameters = PlantParameters(
                    lanes[i], lanes[1 * LANES + i], lanes[2 * LANES + i], lanes[3 * LANES + i],
                    lanes[4 * LANES + i], lanes[5 * LANES + i], lanes[6 * LANES + i], lanes[7 * LANES + i],
                    lanes[8 * LANES + i], lanes[9 * LANES + i], lanes[10 * LANES + i], lanes[11 * LANES + i],
                    lanes[12 * LANES + i], lanes[13 * LANES + i], lanes[14 * LANES + i], lanes[15 * LANES + i],
                )  # fmt: skip
                u = lanes[_DUTY * LANES + i]
                x1 = lanes[_X1 * LANES + i]
                x2 = lanes[_X2 * LANES + i]
                torque[k, i] = (x1 + x2) * f
                duty[k, i] = u
                x1, x2 = short_step(parameters, x1, x2, u, dt)
                lanes[_X1 * LANES + i] = x1
                lanes[_X2 * LANES + i] = x2
                lanes[_STATE * LANES + i] = lanes[_NEXT * LANES + i]

    return block
