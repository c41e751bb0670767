"""Measured forces of a packing's contacts, as tables (CSV)."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from granforce.fields import record
from granforce.packing.importers.text import MISSING, Source, read_csv
from granforce.records import InputError
from granforce.types import Floats, Integers

COLUMNS = ("f_n", "f_t", "sigma_n", "sigma_t")


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
