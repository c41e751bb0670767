"""Pressures of grains, and their measurement.

The pressure of a grain is half the trace of its stress, over its contacts at points p:

    p_g = −(1/2A_g) Σ F · (p − x_g),   (1/2A_g) Σ f_n a for a disk.

It is linear in the forces, so a measured pressure is a weighted sum of forces. Contacts that are
not in the packing would add to the pressure of a grain whose balance is left open (at a wall, say):
such a grain has none here.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import sparse

from granforce.fields import record
from granforce.forces import balance
from granforce.forces.ensemble import Ensemble
from granforce.records import InputError, Packing, are_whole, real_array, takes
from granforce.tolerances import ERRORS, MEASURED
from granforce.types import Floats, Integers


@record
class GrainPressures(NamedTuple):
    """Pressures measured on k grains."""

    grains: Annotated[Integers, "(k,) positions in packing.x"]
    values: Annotated[Floats, "(k,) measured pressures, force/length; NaN if not measured"]
    sigma: Annotated[Floats, "(k,) standard errors, or one for all"]


class Rows(NamedTuple):
    """Sums of forces measured with errors: `matrix` times forces (2 N_c,) is about `values`."""

    grains: Integers  # (k,) whose pressures they are
    matrix: sparse.csr_matrix  # (k, 2 N_c)
    values: Floats  # (k,)
    sigma: Floats  # (k,)

    def deviation(self, forces: Floats) -> Floats:
        """(matrix · forces − values)/σ (k,) of forces (N_c, 2)."""
        return (self.matrix @ forces.ravel() - self.values) / self.sigma

    def unknowns(self, ensemble: Ensemble) -> sparse.csr_matrix:
        """The matrix for vectors of unknown forces, as `Ensemble.to_vector` gives them."""
        return self.matrix if ensemble.per_contact == 2 else self.matrix[:, ::2]


@takes(Ensemble)
def grain_pressures(ensemble: Ensemble, forces: npt.ArrayLike) -> Floats:
    """The pressures of all grains in one or several networks.

    Parameters
    ----------
    ensemble : Ensemble
        S.
    forces : (…, N_c, 2) array
        f_n, f_t of its contacts, force.

    Returns
    -------
    (…, N) array
        p_g = (1/2A_g) Σ f_n a, force/length; 0 for grains without forces, NaN for grains whose
        balance is left open.

    Raises
    ------
    InputError
        For forces of another shape.
    """
    networks = ensemble.networks(forces)
    columns = networks.reshape(-1, 2 * len(ensemble.index)).T
    pressures = (_matrix(ensemble.packing, ensemble.index) @ columns).T + _frozen(ensemble)
    pressures[:, balance.left_open_in(ensemble.packing)] = np.nan
    return pressures.reshape(*networks.shape[:-2], -1)


def no_rows(ensemble: Ensemble) -> Rows:
    """Rows of nothing."""
    none = np.zeros(0)
    return Rows(none.astype(np.int64), sparse.csr_matrix((0, 2 * len(ensemble.index))), none, none)


def rows_of(ensemble: Ensemble, pressures: GrainPressures | None) -> Rows:
    """The Rows of measured pressures of grains; none where nothing was measured.

    Raises InputError for grains that do not exist or whose balance is left open, numbers that do
    not fit, and σ ≤ 0.
    """
    if pressures is None:
        return no_rows(ensemble)
    grains, values, sigma = _checked(ensemble.packing, pressures)
    unit = ensemble.force_scale / (2 * np.sqrt(np.median(ensemble.packing.areas) / np.pi))
    measured = np.isfinite(values)
    for g in np.flatnonzero(measured & (np.abs(values) > MEASURED * unit))[:1]:
        raise InputError(
            f"the pressure of grain {grains[g]} is {values[g]:g}, more than {MEASURED:g} times the "
            f"mean normal force over a diameter, {unit:.3g}; check the calibration and its unit"
        )
    for g in np.flatnonzero(measured & ((sigma < unit / ERRORS) | (sigma > unit * ERRORS)))[:1]:
        raise InputError(
            f"the error {sigma[g]:g} of the pressure of grain {grains[g]} is a factor of more than "
            f"{ERRORS:g} from the mean normal force over a diameter, {unit:.3g}; check the unit"
        )
    for g in grains[measured & balance.left_open_in(ensemble.packing)[grains]][:1]:
        raise InputError(
            f"grain {g} need not balance: forces that are not in the packing, such as those of a "
            "wall, may add to its pressure; leave it out"
        )
    grains, values, sigma = grains[measured], values[measured], sigma[measured]
    matrix = _matrix(ensemble.packing, ensemble.index)[grains]
    return Rows(grains, matrix, values - _frozen(ensemble)[grains], sigma)


def _checked(packing: Packing, pressures: GrainPressures) -> tuple[Integers, Floats, Floats]:
    """Grains, values and σ (k,) each; InputError for other shapes, or grains that do not exist."""
    if not isinstance(pressures, GrainPressures):
        raise InputError(
            "pressures must be gf.GrainPressures(grains, values, sigma), as in "
            "gf.GrainPressures([0, 1], [1.1, 0.9], 0.05)"
        )
    grains, values, sigma = (
        np.atleast_1d(real_array(given, name)) for name, given in pressures._asdict().items()
    )
    if grains.ndim != 1 or values.shape != grains.shape or sigma.shape not in ((1,), grains.shape):
        raise InputError(
            f"grains and values must have one shape (k,), and sigma this or none; got "
            f"{grains.shape}, {values.shape} and {sigma.shape}"
        )
    sigma = np.broadcast_to(sigma, values.shape)
    for grain in grains[~are_whole(grains, len(packing.r) - 1)][:1]:
        raise InputError(
            f"grain {grain:g} does not exist; the packing's grains are 0 … {len(packing.r) - 1}"
        )
    unique, times = np.unique(grains, return_counts=True)
    for grain in unique[times > 1][:1]:
        raise InputError(f"grain {grain:g} has several pressures; give their mean and its error")
    values = np.where(np.isnan(sigma), np.nan, values)
    if np.isinf(values).any() or np.isinf(sigma).any():
        raise InputError("pressures and errors must be finite, or NaN where not measured")
    for g in np.flatnonzero(sigma <= 0)[:1]:
        raise InputError(
            f"the error of the pressure of grain {grains[g]:g} is {sigma[g]:g}; errors must be "
            "above 0"
        )
    return grains.astype(np.int64), values, sigma


def _matrix(packing: Packing, contacts: Integers) -> sparse.csr_matrix:
    """The pressures of all grains as rows (N, 2 k) of the forces f_n, f_t of contacts (k,)."""
    c = packing.contacts.picked(contacts)
    double = 2 * packing.areas
    data = np.stack([c.arm_i, c.offsets[:, 0], c.arm_j, -c.offsets[:, 1]], axis=1)
    grain = np.stack([c.i, c.i, c.j, c.j], axis=1)
    column = 2 * np.arange(len(contacts))[:, None] + [0, 1, 0, 1]
    entries = ((data / double[grain]).ravel(), (grain.ravel(), column.ravel()))
    matrix = sparse.csr_matrix(entries, shape=(len(packing.r), 2 * len(contacts)))
    matrix.eliminate_zeros()
    return matrix


def _frozen(ensemble: Ensemble) -> Floats:
    """The pressures (N,) by the contacts that are held at their original forces."""
    forces = ensemble.packing.forces[ensemble.frozen]
    return _matrix(ensemble.packing, ensemble.frozen) @ forces.ravel()
