"""The few lines that a person wants at the end of a sweep."""

from __future__ import annotations

from collections import Counter

import numpy as np

from fecm.sweeps.result import SweepResult

# Reasons of failed cases that are told one by one.
TOLD = 5


def summary(result: SweepResult) -> list[str]:
    """Summarise a sweep: its cases, the smallest and the largest peak force, why cases failed."""
    fine = result.fine
    lines = [f"cases             {len(result)}"]
    force = np.where(fine, result["peak_force"], np.nan)
    if np.isfinite(force).any():
        for word, case in (("smallest", np.nanargmin(force)), ("largest", np.nanargmax(force))):
            values = ", ".join(f"{name} {values[case]}" for name, values in result.cases.items())
            peak = f"{force[case]:.6g} {result.unit('peak_force')}".rstrip()
            lines.append(f"{word + ' peak':17} {peak} ({values})")
    reasons = Counter(result["status"][~fine].tolist())
    for reason, times in reasons.most_common(TOLD):
        lines.append(f"failed            {times}: {reason}")
    if len(reasons) > TOLD:
        lines.append(f"failed            for {len(reasons) - TOLD} other reasons")
    return lines


def verdict(result: SweepResult) -> str:
    """Count the cases, those that failed, and those whose numbers are in doubt."""
    unsettled = 0 if result.unsettled is None else int((result.unsettled > 0)[result.fine].sum())
    counts = (
        (int(result.still.sum()), "still in contact at the end"),
        (unsettled, "with a contact iteration that did not converge"),
        (int((~result.fine).sum()), "failed"),
    )
    told = ", ".join(f"{count} {what}" for count, what in counts if count)
    return f"{len(result)} case{'' if len(result) == 1 else 's'}: {told or 'all ok'}"
