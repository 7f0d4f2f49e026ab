"""The path nearest to a reference when each sample may only move so far: exact, in one pass backwards and one forwards.

    minimise  Σ w_k (T_k − r_k)²   with   T_0 given,   fall_k T_k + fall0_k ≤ T_{k+1} ≤ rise_k T_k + rise0_k

The least cost from sample k on is a convex function of T_k with a piecewise linear derivative. Backwards, its two
halves move apart by the two limits (T ← (T − rise0)/rise left of its minimum, T ← (T − fall0)/fall right of it), and
2 w (T − r) is added. The corners of each half lie on a stack, nearest to the minimum on top; moving a half is one
change of its scale, so a sample costs a constant number of operations. Forwards, each sample goes as near to its
minimum as the limits let it.
"""

import numpy as np

from eaid.arrays import Array

UNDONE = 8.0
"""A stack whose scale has grown by this is written out anew, and what left the range of the reference is dropped."""


def taut_path(
    reference: Array,
    weight: Array,
    fall: Array,
    fall0: Array,
    rise: Array,
    rise0: Array,
    start: float,
    path: Array,
) -> float:
    """Fill the path (all arrays of shape (n,), factors in (0, 1], weights ≥ 0) and return its cost."""
    n = len(reference)
    bottom = min(reference.min(), start) - 1.0
    top = max(reference.max(), start) + 1.0
    # corners (place, change of slope), in the scale of their stack: place = scale·p + shift, change = share·c
    left = np.empty((2 * n + 2, 2))
    right = np.empty((2 * n + 2, 2))
    lefts = 0
    rights = 0
    l_scale, l_shift, l_share = 1.0, 0.0, 1.0
    r_scale, r_shift, r_share = 1.0, 0.0, 1.0
    least = np.empty(n)  # the minimum at each sample, or the stretch of minima
    most = np.empty(n)
    for k in range(n - 1, -1, -1):
        # between the two stacks the derivative is slope·(T − zero)
        slope = 2.0 * weight[k]
        zero = reference[k]
        if slope > 0.0:
            while lefts > 0:
                place = l_scale * left[lefts - 1, 0] + l_shift
                if zero >= place:
                    break
                lefts -= 1
                change = l_share * left[lefts, 1]
                zero = (slope * zero + change * place) / (slope + change)
                slope += change
                right[rights, 0] = (place - r_shift) / r_scale
                right[rights, 1] = -change / r_share
                rights += 1
            while rights > 0:
                place = r_scale * right[rights - 1, 0] + r_shift
                if zero <= place:
                    break
                rights -= 1
                change = r_share * right[rights, 1]
                zero = (slope * zero + change * place) / (slope + change)
                slope += change
                left[lefts, 0] = (place - l_shift) / l_scale
                left[lefts, 1] = -change / l_share
                lefts += 1
            least[k] = zero
            most[k] = zero
        else:
            least[k] = l_scale * left[lefts - 1, 0] + l_shift if lefts > 0 else bottom
            most[k] = r_scale * right[rights - 1, 0] + r_shift if rights > 0 else top
        if k == 0:
            break
        if slope > 0.0:
            left[lefts, 0] = (zero - l_shift) / l_scale
            left[lefts, 1] = slope / l_share
            lefts += 1
            right[rights, 0] = (zero - r_shift) / r_scale
            right[rights, 1] = slope / r_share
            rights += 1
        factor, constant = rise[k - 1], rise0[k - 1]
        l_scale, l_shift, l_share = l_scale / factor, (l_shift - constant) / factor, l_share * factor * factor
        factor, constant = fall[k - 1], fall0[k - 1]
        r_scale, r_shift, r_share = r_scale / factor, (r_shift - constant) / factor, r_share * factor * factor
        if l_scale > UNDONE or abs(l_shift) > UNDONE * (top - bottom):
            lefts = written_anew(left, lefts, l_scale, l_shift, l_share, bottom, np.inf)
            l_scale, l_shift, l_share = 1.0, 0.0, 1.0
        if r_scale > UNDONE or abs(r_shift) > UNDONE * (top - bottom):
            rights = written_anew(right, rights, r_scale, r_shift, r_share, -np.inf, top)
            r_scale, r_shift, r_share = 1.0, 0.0, 1.0
    path[0] = start
    cost = weight[0] * (start - reference[0]) ** 2
    for k in range(n - 1):
        wanted = min(max(path[k], least[k + 1]), most[k + 1])
        path[k + 1] = min(max(wanted, fall[k] * path[k] + fall0[k]), rise[k] * path[k] + rise0[k])
        cost += weight[k + 1] * (path[k + 1] - reference[k + 1]) ** 2
    return float(cost)


def written_anew(stack: Array, count: int, scale: float, shift: float, share: float, low: float, high: float) -> int:
    """The corners of a stack in a scale of 1, those between two places alone; how many they are."""
    kept = 0
    for i in range(count):
        place = scale * stack[i, 0] + shift
        if low < place < high:
            stack[kept, 0] = place
            stack[kept, 1] = share * stack[i, 1]
            kept += 1
    return kept
