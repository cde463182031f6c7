"""Roots of functions of one number.  Importing SciPy for this would take 0.2 s."""

from __future__ import annotations

from collections.abc import Callable


def root(function: Callable[[float], float], low: float, high: float, tolerance: float) -> float:
    """Find the root of a continuous function between two places where its signs differ.

    The method is false position with the Illinois rule: the value at an end that does not move is
    halved.  Both ends then approach the root, faster than linearly.

    Parameters
    ----------
    function : callable
        Function of one number.
    low, high : float
        Ends of the interval.
    tolerance : float
        Length of the interval at which the search stops.

    Raises
    ------
    ValueError
        If the signs at the ends are the same.

    Examples
    --------
    >>> round(root(lambda x: x * x - 2.0, 0.0, 2.0, 1e-12), 9)
    1.414213562

    References
    ----------
    M. Dowell, P. Jarratt, "A modified regula falsi method for computing the root of an equation",
    BIT 11 (1971) 168-174.
    """
    still, last = low, high
    at_still, at_last = function(still), function(last)
    if at_still * at_last > 0.0:
        raise ValueError(f"the function has the same sign at {low:g} and {high:g}")
    while at_last and abs(last - still) > tolerance:
        new = last - at_last * (last - still) / (at_last - at_still)
        at_new = function(new)
        if at_new * at_last < 0.0:
            still, at_still = last, at_last
        else:
            at_still /= 2.0
        last, at_last = new, at_new
    return last
