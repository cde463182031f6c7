"""The contact law of the printed program."""

from __future__ import annotations

from dataclasses import dataclass

from fecm.mechanics.contact_law import (
    LOADING_POWER,
    RELOADING,
    UNLOADING,
    VIRGIN,
    ContactPoint,
    LoadingHistory,
    MeasuredLaw,
    Number,
    any_case,
    branch_force,
    choose_history,
    filled_like,
    unloading_branch,
)


@dataclass(frozen=True)
class ListingLaw(MeasuredLaw[Number]):
    """The printed program's law (the slip ``reload``), which never returns to an earlier branch.

    The first trial whose force is below the last accepted one ends loading; the first trial on the
    unloading curve whose force is not below it starts reloading.  Trials that the contact iteration
    discards count.
    """

    def trial(
        self, memory: LoadingHistory[Number], last: ContactPoint[Number], indentation: Number
    ) -> tuple[Number, LoadingHistory[Number]]:
        """Return the contact force at a trial indentation, and the history after the trial."""
        m, c = memory, self.constants
        force = branch_force(m, indentation)
        leaves = (m.branch == VIRGIN) & (force < last.force)
        if any_case(leaves):
            a, f = last
            down = unloading_branch(c.q, last, f, peak=a, peak_force=f, permanent=c.permanent(a))
            m = choose_history(leaves, down, m)
            force = branch_force(m, indentation)
        turns = (m.branch == UNLOADING) & (indentation > m.permanent) & (force >= last.force)
        if any_case(turns):
            f = m.peak_force * (m.w > 0.0)
            up = m._replace(
                branch=filled_like(f, RELOADING),
                f=f,
                b=m.permanent,
                p=filled_like(f, LOADING_POWER),
            )
            m = choose_history(turns, up, m)
            force = branch_force(m, indentation)
        return force, m

    def accept(
        self, memory: LoadingHistory[Number], last: ContactPoint[Number], indentation: Number
    ) -> LoadingHistory[Number]:
        """Return the loading history after a step, as its trials have left it."""
        return memory
