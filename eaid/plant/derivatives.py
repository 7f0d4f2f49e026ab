"""How what a plant answers to a held input changes with every unknown, exactly.

Between two changes of the input the states go to their ends as in `eaid.plant.dynamics`; with g = 1 − e^(−dt/τ) and
S = ∂x/∂p a state in parallel, its target w = part · T_s, moves by

    x ← x − g (x − w),   S ← (1 − g) S + g ∂w/∂p − (x − w) ∂g/∂p

and one of two in series, or ringing, by Φ = e^(A dt) in place of 1 − g, with e = (1, 0). The input's changes act θ
later: each moves the states' rates from x'(old) to x'(new) at one instant, so S_θ grows by x'(old) − x'(new) there.
Dead times are any number of samples: `eaid.plant.drive.delayed` puts the changes between the samples, as rows of weight
0.
"""

import math

import numpy as np

from eaid.arrays import Array
from eaid.plant.drive import AT_DEAD, AT_EXCESS, AT_FALL, AT_IDLE, AT_REST, AT_SHARE, AT_START, Drive, Integers, Tables
from eaid.plant.dynamics import swing
from eaid.plant.machine_code import machine_code

# What a state still has of its start is 0 below this: a number near the least that there is takes fifty times as long
NEXT_TO_NOTHING, LOOKED_FOR_ROWS = 1e-250, 64


@machine_code()
def drop_nothing(sens: Array) -> None:
    """Put 0 for derivatives of states, (2, n), that are next to it."""
    for s in range(2):
        for j in range(sens.shape[1]):
            if abs(sens[s, j]) < NEXT_TO_NOTHING:
                sens[s, j] = 0.0


@machine_code()
def acting_tau(
    tau: float, falls: bool, rest: float, at_rest: float, factor: float
) -> tuple[float, float, float, float]:
    """τ of a state, and its derivatives by the τ of rises, `at_rest` and `factor`."""
    if falls and rest >= 1.0:
        return tau * factor, factor, 0.0, tau
    if falls and at_rest > 0.0:
        return rest * tau + (1.0 - rest) * at_rest, rest, 1.0 - rest, 0.0
    return tau, 1.0, 0.0, 0.0


@machine_code(nogil=True, fastmath={"contract"})
def derivatives(
    drive: Drive, tables: Tables, scalars: Array, place: Integers, state: Array, first_row: int, end: int
) -> Array:
    """√w times the derivatives by p unknowns, then √w times the residual, of the rows that count of some of a drive's
    from `first_row` on, (N, p + 1).

    One lag, or two in parallel. The coefficients of T_s, τ1 and τ2 come first. `place` has the columns of `scalars`,
    (10,); what is no unknown has the column −1, the last, which nobody reads. `state`, (2, p + 3), is taken from the
    rows before and left for those behind: as `at_first` has it, the states' derivatives, themselves and their rates.
    """
    n_s, weights, share = tables.by_steady.shape[1], drive.w, scalars[AT_SHARE]
    count = state.shape[1] - 3
    sens, x, rate = state[:, : count + 1].copy(), state[:, count + 1].copy(), state[:, count + 2].copy()
    before, g, last_step = np.zeros(2), np.zeros(2), 0.0
    out, row = np.empty((np.count_nonzero(weights[first_row:end]), count + 1)), 0
    for k in range(first_row, end):
        if weights[k] > 0.0:
            root = np.sqrt(weights[k])
            for j in range(count):
                out[row, j] = root * (sens[0, j] + sens[1, j])
            if place[AT_IDLE] >= 0:
                out[row, place[AT_IDLE]] = root
            out[row, count] = root * (x[0] + x[1] + scalars[AT_IDLE] - drive.y[k])
            row += 1
        if k % LOOKED_FOR_ROWS == 0:
            drop_nothing(sens)
        i, step, fallen = drive.which[k], drive.dt_s[k], drive.rising[k] < 0
        moved = place[AT_DEAD] >= 0 and k > 0 and (i != drive.which[k - 1] or drive.rising[k] != drive.rising[k - 1])
        excess = 1.0 + scalars[AT_EXCESS] if fallen else 1.0
        total, first = tables.steady[i] * excess, n_s
        for s in range(2):
            by_curve = tables.by_tau2 if s else tables.by_tau1
            part, risen = (1.0 - share, tables.tau2[i]) if s else (share, tables.tau1[i])
            off = x[s] - part * total
            tau, by_risen, by_rest, by_fall = acting_tau(
                risen,
                off < 0.0 if s and share > 1.0 else off > 0.0,
                tables.rest[i],
                scalars[AT_REST + s],
                scalars[AT_FALL + s],
            )
            if moved:  # x'(old) − x'(new)
                sens[s, place[AT_DEAD]] += rate[s] + off / tau
            if tau != before[s] or step != last_step:
                g[s], before[s] = -np.expm1(-step / tau), tau
            by_tau = off * (1.0 - g[s]) * step / (tau * tau)
            for j in range(count + 1):
                sens[s, j] *= 1.0 - g[s]
            for j in range(n_s):
                sens[s, j] += g[s] * part * excess * tables.by_steady[i, j]
            for j in range(by_curve.shape[1]):
                sens[s, first + j] += by_tau * by_risen * by_curve[i, j]
            sens[s, place[AT_SHARE]] += -g[s] * total if s else g[s] * total
            sens[s, place[AT_REST + s]] += by_tau * by_rest
            sens[s, place[AT_FALL + s]] += by_tau * by_fall
            if fallen:
                sens[s, place[AT_EXCESS]] += g[s] * part * tables.steady[i]
            x[s] -= g[s] * off
            rate[s] = -(off - g[s] * off) / tau
            first += by_curve.shape[1]
        last_step = step
    state[:, : count + 1], state[:, count + 1], state[:, count + 2] = sens, x, rate
    return out


def at_first(scalars: Array, place: Integers, count: int) -> Array:
    """The states at the first row of a drive, with their derivatives by `count` unknowns before and rates behind them,
    (2, count + 3)."""
    sens = np.zeros((2, count + 1))
    sens[0, place[AT_START]] = sens[1, place[AT_START + 1]] = 1.0
    return np.column_stack([sens, scalars[AT_START:], np.zeros(2)])


swung = machine_code()(swing)


@machine_code()
def by_damping(zeta: float, s: float, c: float, n: float) -> tuple[float, float]:
    """∂c/∂ζ and ∂n/∂ζ of `swing`: ζ s n − s c, and ζ (s c − n)/(ζ² − 1) − s n."""
    d = zeta * zeta - 1.0
    z = d * s * s
    if abs(z) < 1e-2:
        e = math.exp(-zeta * s)
        meets = e * s * s * s * (1.0 / 3.0 + z * (1.0 / 30.0 + z * (1.0 / 840.0 + z / 45360.0)))
    else:
        meets = (s * c - n) / d
    return zeta * s * n - s * c, zeta * meets - s * n


@machine_code(nogil=True, fastmath={"contract"})
def swinging(
    drive: Drive, tables: Tables, scalars: Array, place: Integers, state: Array, first_row: int, end: int
) -> Array:
    """The same of two lags in series, or ringing: `tables` has 1/ω as τ1 and ζ as τ2, `scalars` z in place of C."""
    n_s, weights, z = tables.by_steady.shape[1], drive.w, scalars[AT_SHARE]
    n_t, count = tables.by_tau1.shape[1], state.shape[1] - 3
    sens, (x1, x2, rate1, rate2) = state[:, : count + 1].copy(), state[:, count + 1 :].T.ravel()
    out, row = np.empty((np.count_nonzero(weights[first_row:end]), count + 1)), 0
    c, n, c_zeta, n_zeta, last, last_tau, last_zeta = 1.0, 0.0, 0.0, 0.0, -1.0, -1.0, -1.0
    for k in range(first_row, end):
        if weights[k] > 0.0:
            root = np.sqrt(weights[k])
            for j in range(count):
                out[row, j] = root * (sens[0, j] + z * sens[1, j])
            if place[AT_SHARE] >= 0:
                out[row, place[AT_SHARE]] += root * x2
            if place[AT_IDLE] >= 0:
                out[row, place[AT_IDLE]] = root
            out[row, count] = root * (x1 + z * x2 + scalars[AT_IDLE] - drive.y[k])
            row += 1
        if k % LOOKED_FOR_ROWS == 0:
            drop_nothing(sens)
        i, step = drive.which[k], drive.dt_s[k]
        tau, zeta, away = tables.tau1[i], tables.tau2[i], x1 - tables.steady[i]
        if place[AT_DEAD] >= 0 and k > 0 and i != drive.which[k - 1]:
            sens[0, place[AT_DEAD]] += rate1 - x2 / tau
            sens[1, place[AT_DEAD]] += rate2 + (away + 2.0 * zeta * x2) / tau
        if step != last or tau != last_tau or zeta != last_zeta:
            c, n = swung(zeta, step / tau)
            c_zeta, n_zeta = by_damping(zeta, step / tau, c, n)
            last, last_tau, last_zeta = step, tau, zeta
        f11, f12, f21, f22 = c + zeta * n, n, -n, c - zeta * n
        to1, to2 = f11 * away + f12 * x2, f21 * away + f22 * x2
        by_zeta1 = (c_zeta + n + zeta * n_zeta) * away + n_zeta * x2
        by_zeta2 = -n_zeta * away + (c_zeta - n - zeta * n_zeta) * x2
        by_tau1, by_tau2 = to2 * (-step / (tau * tau)), (-to1 - 2.0 * zeta * to2) * (-step / (tau * tau))
        for j in range(count + 1):
            one, two = sens[0, j], sens[1, j]
            sens[0, j], sens[1, j] = f11 * one + f12 * two, f21 * one + f22 * two
        for j in range(n_s):
            sens[0, j] += (1.0 - f11) * tables.by_steady[i, j]
            sens[1, j] -= f21 * tables.by_steady[i, j]
        for j in range(n_t):
            sens[0, n_s + j] += by_tau1 * tables.by_tau1[i, j]
            sens[1, n_s + j] += by_tau2 * tables.by_tau1[i, j]
        for j in range(tables.by_tau2.shape[1]):
            sens[0, n_s + n_t + j] += by_zeta1 * tables.by_tau2[i, j]
            sens[1, n_s + n_t + j] += by_zeta2 * tables.by_tau2[i, j]
        x1, x2 = tables.steady[i] + to1, to2
        rate1, rate2 = to2 / tau, -(to1 + 2.0 * zeta * to2) / tau
    state[:, : count + 1] = sens
    state[0, count + 1], state[1, count + 1], state[0, count + 2], state[1, count + 2] = x1, x2, rate1, rate2
    return out
