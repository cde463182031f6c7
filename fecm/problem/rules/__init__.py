"""Rules of a problem, by subject: a function for each code, which yields what is wrong.

A rule takes the :class:`~fecm.problem.problem.Problem` and asks it for what it needs, or a segment
alone where that suffices.  Each module ends with the order in which its rules are applied by
``fecm/problem/check.py``.
"""
