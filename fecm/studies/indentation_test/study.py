"""Fit of a contact law to an indentation test."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fecm._errors import StudyError, warn
from fecm._measured_tables import IN_MEMORY, Record
from fecm._record_faults import record_faults
from fecm._typing import Floats
from fecm.authoring.contact import Contact
from fecm.authoring.parameters import check_positive
from fecm.mechanics.contact_law import ACR_POWER
from fecm.studies.indentation_test import constants
from fecm.studies.indentation_test.constants import ContactLawFit, Cycle, fit_contact_law
from fecm.studies.indentation_test.curves import LIMITS_Q, FittedValue
from fecm.studies.indentation_test.turns import Test, read_test


@dataclass(frozen=True, eq=False)
class IndentationFit:
    """Contact law fitted to an indentation test; ``str()`` is the page of `fecm indent fit`.

    A fitted value has a `value` and its standard `error`, which is 0 for a prescribed value. It is
    None if the test does not determine it.

    Attributes
    ----------
    indentation, force : ndarray (points,)
        The test, in `units`.
    units : Mapping of str to str
        Names of the units of length and force; empty if they are unknown.
    stated : tuple of str
        Units of both columns in the file.
    fit : ContactLawFit
        Curves and parameters of the fit, for pictures.
    record : Record
        Name and SHA-256 (`file`, `sha256`) of the file of the test; empty texts for arrays.
    """

    indentation: Floats
    force: Floats
    units: Mapping[str, str]
    stated: tuple[str, str]
    fit: ContactLawFit
    record: Record = IN_MEMORY

    @property
    def k(self) -> FittedValue:
        """Contact coefficient with n = 3/2 (equation 3-1), force/length^1.5."""
        return self.fit.k

    @property
    def n(self) -> FittedValue:
        """Power of the first loading if it is fitted too."""
        return self.fit.free.n

    @property
    def k_with_n(self) -> FittedValue:
        """Contact coefficient with the power `n`, force/length^n."""
        return self.fit.free.k

    @property
    def q(self) -> FittedValue | None:
        """Power of the unloading (equation 3-3)."""
        return self.fit.q

    @property
    def s_p(self) -> FittedValue | None:
        """Slope of the permanent over the largest indentation (equation 3-8)."""
        return self.fit.line.s_p if self.fit.line else None

    @property
    def alpha_p(self) -> FittedValue | None:
        """Critical indentation of equation 3-8, length."""
        return self.fit.line.alpha_p if self.fit.line else None

    @property
    def alpha_cr(self) -> FittedValue | None:
        """Critical indentation of equation 3-7, length."""
        return self.fit.critical.alpha_cr if self.fit.critical else None

    @property
    def cycles(self) -> tuple[Cycle, ...]:
        """Largest and permanent indentation of each cycle, and its reloading rigidity."""
        return self.fit.cycles

    @property
    def r_squared(self) -> dict[str, float | None]:
        """Share of the variance that a curve explains, by curve."""
        return self.fit.r_squared

    @property
    def scatter(self) -> float:
        """Root mean square of the residuals over the largest force."""
        return self.fit.scatter

    @property
    def notes(self) -> tuple[str, ...]:
        """Reasons to doubt the law, from the fit and from the records."""
        faults = (
            *record_faults("the force", self.force),
            *record_faults("the indentation", self.indentation),
        )
        return (*faults, *constants.fit_notes(self.fit))

    @property
    def law(self) -> Contact | None:
        """Contact law for `fecm.impact`, rounded as on the card; None if it is not determined."""
        return constants.law(self.fit)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, as printed by `fecm indent fit --format json`."""
        plain = constants.plain(self.fit) | {"notes": list(self.notes)}
        return {"record": self.record._asdict(), "units": dict(self.units) or None, **plain}

    def __repr__(self) -> str:
        return f"<fecm fit of an indentation test of {len(self.force)} points>"

    def __str__(self) -> str:
        units = tuple(self.units.values())
        stated = (
            "" if self.stated in (("", ""), units) else f" (the test: {', '.join(self.stated)})"
        )
        unit_names = f"{', '.join(units)}{stated}" if units else "not named in the test"
        card = constants.card(self.fit)
        record = [f"record          {self.record}"] if self.record.file else []
        lines = [*constants.fit_lines(self.fit), *record, f"units           {unit_names}"]
        return "\n".join([*lines, card] if card else lines)


def fit_indentation(
    test: str | Path | tuple[ArrayLike, ArrayLike],
    *,
    q: float | None = None,
    acr: bool = False,
    turn: float | None = None,
    columns: Sequence[str] | None = None,
    units: tuple[str, str] | None = None,
) -> IndentationFit:
    """Fit the contact law to an indentation test (report, chapter 3).

    The rows are in the order of measurement: first loading, then unloading and reloading in any
    number of cycles. The notes of the result are :class:`FecmWarning`.

    Parameters
    ----------
    test : str, Path or tuple of array_like
        Table with columns of indentation and force, or both as arrays (points,), positive in
        compression.
    q : float, optional
        Prescribed power of the unloading; fitted by default.
    acr : bool
        Fit alpha_cr of the law with one unloading rigidity (equation 3-7, q = 5/2) instead of s_p
        and alpha_p.
    turn : float, optional
        Decrease of the indentation that counts as a turn, length. By default it is 2 % of the
        range, or 8 standard deviations of the noise if that is more.
    columns : sequence of str, optional
        Names or numbers (from 1) of the columns of indentation and force in a table. A minus before
        a name or number changes the sign of the column.
    units : tuple of str, optional
        Units of length and force. A table that names its units is converted to them, by default to
        in and lbf, mm and N, or m and N, whichever is nearest to the units of the table. For
        arrays, they are the units of the arrays.

    Returns
    -------
    IndentationFit
        Parameters with their errors, and the law.

    Raises
    ------
    StudyError
        If the numbers are not an indentation test, a column is missing, or a unit is unknown.
    ValueError
        If `q` or `turn` is out of range.
    OSError
        If the table can't be read.

    Examples
    --------
    >>> import fecm
    >>> fit = fecm.fit_indentation(fecm.examples.path("indentation-test"), units=("in", "lbf"))
    >>> print(f"k = {fit.k.value:.4g} ± {fit.k.error:.2g} lbf/in^1.5")
    k = 1.331e+06 ± 1.7e+03 lbf/in^1.5
    >>> fit.law
    Contact(k=1330500.0, alpha_p=0.00076098, s_p=0.10378, q=2.4795, word='')
    """
    fit = fit_law(_measured(test, columns or (), units), q=q, acr=acr, turn=turn)
    warn(*fit.notes)
    return fit


def fit_law(
    test: Test, *, q: float | None = None, acr: bool = False, turn: float | None = None
) -> IndentationFit:
    """Fit the law to a test in consistent units.

    Raises StudyError or ValueError like :func:`fit_indentation`.
    """
    check_positive(turn=turn)
    if acr and q not in (None, ACR_POWER):
        raise StudyError("`acr` needs q = 5/2: equation 3-7 holds for no other power")
    if q is not None and not LIMITS_Q[0] <= q <= LIMITS_Q[1]:
        raise StudyError(f"`q` is {q:g}, not between {LIMITS_Q[0]:g} and {LIMITS_Q[1]:g}")
    peak = int(np.abs(test.force).argmax())
    for name, values in (("force", test.force), ("indentation", test.indentation)):
        if values[peak] < 0.0:
            raise StudyError(
                f"{name} is {values[peak]:g} at the largest force; both are positive in "
                f"compression: a minus before a name or number of `columns` changes the sign"
            )
    fit = fit_contact_law(test.indentation, test.force, retreat=turn, q=q, acr=acr)
    return IndentationFit(test.indentation, test.force, test.units, test.stated, fit, test.record)


def _measured(
    test: str | Path | tuple[ArrayLike, ArrayLike],
    columns: Sequence[str],
    units: tuple[str, str] | None,
) -> Test:
    """Return a test from a table or from arrays."""
    for name, pair in (("columns", columns), ("units", units)):
        if pair and (isinstance(pair, str) or len(pair) != 2):
            raise StudyError(f"`{name}` is {pair!r}, not two names: of indentation and of force")
    if isinstance(test, str | Path):
        return read_test(Path(test), columns, units)
    names = {} if units is None else dict(zip(("length", "force"), units, strict=True))
    try:
        indentation, force = (np.asarray(values, dtype=np.float64) for values in test)
    except (TypeError, ValueError):
        raise StudyError("a test is a path, or arrays of indentation and force") from None
    if not (np.isfinite(indentation).all() and np.isfinite(force).all()):
        raise StudyError("indentation and force have values that are not finite")
    return Test(indentation, force, names, ("", ""))
