"""Measured forces of a packing's contacts and pressures of its grains, as tables (CSV)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np

from granforce.fields import record
from granforce.forces.grain_pressures import GrainPressures
from granforce.packing.importers.text import MISSING, Source, read_csv
from granforce.records import InputError, positive
from granforce.types import Floats, Integers

COLUMNS = ("f_n", "f_t", "sigma_n", "sigma_t")


class Calibration(NamedTuple):
    """A pressure a g + b ± sigma of a measured quantity g, such as G²."""

    a: float
    b: float
    sigma: float

    def pressures(self, values: Floats) -> tuple[Floats, Floats]:
        """Pressures and their standard errors (k,) of values (k,)."""
        return self.a * values + self.b, np.full(len(values), self.sigma)


def checked_calibration(numbers: Sequence[float] | None) -> Calibration:
    """The Calibration of three numbers; InputError for others."""
    if numbers is None or len(numbers) != 3 or not np.isfinite(numbers).all() or not numbers[0]:
        raise InputError(
            "a column of G² needs its calibration a,b,sigma: the pressure is a G² + b with this "
            "standard error, a not 0 (1,0,sigma for a column of pressures)"
        )
    return Calibration(*numbers)._replace(sigma=positive(numbers[2], "sigma of the calibration"))


@record
class Measurement(NamedTuple):
    """Forces measured on k contacts; NaN for components that were not measured."""

    contacts: Annotated[Integers, "(k,) their numbers in the packing"]
    forces: Annotated[Floats, "(k, 2) f_n, f_t, force"]
    sigma: Annotated[Floats, "(k, 2) standard errors"]

    def on(self, count: int) -> tuple[Floats, Floats]:
        """Forces and σ of all contacts of a packing, two arrays (count, 2); NaN if not measured.

        count: the number of contacts of the packing (not of S: pick those by `Ensemble.index`).
        Raises InputError for contacts that the packing does not have.
        """
        if self.contacts.max(initial=0) >= count:
            raise InputError(
                f"contact {self.contacts.max()} was measured, but the packing's contacts are "
                f"numbered 0 … {count - 1}; is it the right packing?"
            )
        forces, sigma = np.full((2, count, 2), np.nan)
        forces[self.contacts], sigma[self.contacts] = self.forces, self.sigma
        return forces, sigma


def read_measurement(source: Source) -> Measurement:
    """The Measurement in a CSV file; its `on` gives the arrays that `infer` takes.

    Parameters
    ----------
    source : path or open file
        Columns: contact (its number in the packing), f_n, f_t, sigma_n, sigma_t in the packing's
        unit, which names may end with: ``f_n [packing]``. Fields of components that were not
        measured are empty or nan. Contacts without a line were not measured.

    Returns
    -------
    Measurement
        Forces and standard errors of the measured contacts.

    Raises
    ------
    InputError
        Naming file and line.
    """
    table = read_csv(source).in_packing_unit(COLUMNS)
    contacts = table.whole("contact")
    table.index("contact")  # each occurs once
    values = np.column_stack([table.numbers(name, MISSING) for name in COLUMNS])
    forces, sigma = values[:, :2], values[:, 2:]
    if not np.isfinite(forces + sigma).any():
        raise InputError(f"{table.name}: no component has both a force and a standard error")
    for row in np.flatnonzero((sigma <= 0).any(axis=1))[:1]:
        raise InputError(f"{table.place(row)}: a standard error is not above 0")
    return Measurement(contacts, forces, sigma)


def read_pressures(
    source: Source, column: str | None = None, calibration: Sequence[float] | None = None
) -> GrainPressures:
    """The GrainPressures in a CSV file.

    Parameters
    ----------
    source : path or open file
        Columns: grain (its number in the packing), pressure and sigma, in the packing's unit; empty
        or nan where not measured.
    column : str, optional
        Column of another quantity, such as G², instead of pressure and sigma.
    calibration : (a, b, sigma), with column
        The pressure is a times this quantity plus b, with standard error sigma.

    Returns
    -------
    GrainPressures
        Of the grains in the file.

    Raises
    ------
    InputError
        Naming file and line, and for a column without calibration, or a calibration without column.
    """
    table = read_csv(source)
    grains = table.whole("grain")
    table.index("grain")  # each occurs once
    if column is None and calibration is None:
        values, sigma = (table.numbers(name, MISSING) for name in ("pressure", "sigma"))
    elif column is None:
        raise InputError("a calibration needs the name of the column that it applies to")
    else:
        of_column = checked_calibration(calibration)
        values, sigma = of_column.pressures(table.numbers(column.strip().lower(), MISSING))
    return GrainPressures(grains, values, sigma)
