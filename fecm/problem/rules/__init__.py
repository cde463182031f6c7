"""Rules of a problem, by subject: a function for each code, which yields its findings.

A rule takes the :class:`~fecm.problem.problem.Problem`, or only a segment where that suffices. Each
module ends with the order in which ``fecm/problem/check.py`` applies its rules.
"""
