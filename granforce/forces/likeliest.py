"""The most likely admissible network given measured forces m with standard errors σ.

It minimises χ² = Σ ((f − m)/σ)² over S, as a contact program with weights 1/σ² for each component
(`contact_program`). Measured pressures of grains weigh sums of forces; PIQP minimises their χ².
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import sparse

from granforce.forces.contact_problem import forces_of, problem_of
from granforce.forces.ensemble import Ensemble
from granforce.forces.grain_pressures import Rows, no_rows
from granforce.forces.nearest import nearest
from granforce.forces.nearest_piqp import likeliest_piqp
from granforce.numerics import certificates, contact_program, interior_point
from granforce.numerics.contact_program import PINNED
from granforce.numerics.highs import symmetric_factor
from granforce.numerics.interior_point import OPTIMUM
from granforce.numerics.lanes import LANES, MANY, ONE
from granforce.records import InputError, positive
from granforce.system import cancelling
from granforce.tolerances import BALANCED, ERRORS, MEASURED
from granforce.types import Floats

# Default standard error, in ⟨f_n⟩, with which unmeasured components count as 0: among networks that
# the measurement cannot distinguish, it selects the one with the smallest forces. In an unbounded S
# it is all that limits some forces, and so a usual force.
UNMEASURED, UNMEASURED_UNBOUNDED = 1e3, 1.0
_PARTS = "f_n", "f_t"
# Steps of the contact program; it ends balanced, with a mean product of forces and multipliers
# (in ⟨f_n⟩², the largest weight 1) which gives forces to its square root. Bounds on single forces
# leave fewer digits: beyond, rounding makes the multipliers diverge.
_MOST_STEPS, _BALANCE, _CLOSED, _CLOSED_BETWEEN_BOUNDS = 150, BALANCED / 4, 1e-24, 1e-11
# Coordinates y (in ⟨f_n⟩) up to this lie on the wall of their cone.
_ON_THE_WALL = 1e-6
# Largest change of a force by the final correction of balance, in ⟨f_n⟩.
_NEAR = 1e-6
# Added to a diagonal of 1: above rounding, and below any significant entry.
_SHIFTS = 1e-12, 1e-10


class Likeliest(NamedTuple):
    """The network that fits a measurement best, and how well."""

    forces: Floats  # (N_c, 2) the admissible network with the least χ², force
    chi_square: float  # its Σ ((f − m)/σ)²
    freedom: int  # degrees of freedom: measured components less directions of S it can follow
    deviation: Floats  # (N_c, 2) its (f − m)/σ, NaN where nothing was measured
    of_rows: Floats  # (k,) the same of Rows


def spread_of(ensemble: Ensemble, given: float | None, bounded: float = UNMEASURED) -> float:
    """The standard error of unmeasured components, in ⟨f_n⟩: the given one, or the default of S.

    bounded: the default in a bounded S.
    """
    if given is not None:
        return given
    return bounded if ensemble.bounded else UNMEASURED_UNBOUNDED


def likeliest(
    ensemble: Ensemble,
    measured: npt.ArrayLike | None,
    sigma: npt.ArrayLike | None,
    unmeasured: float = UNMEASURED,
    rows: Rows | None = None,
) -> Likeliest:
    """The network of S with the least Σ ((f − m)/σ)²; a Likeliest.

    measured, sigma: m and σ as `checked` takes them. unmeasured: standard error, in ⟨f_n⟩, with
    which components that were not measured count as 0; they are not part of χ². rows: measured sums
    of forces.

    Raises InputError as `checked` does, NotJammedError where S is empty.
    """
    m, s = checked(ensemble, measured, sigma)
    if not 1 / ERRORS <= positive(unmeasured, "unmeasured") <= ERRORS:
        words = f"must be from {1 / ERRORS:g} to {ERRORS:g}, got {unmeasured}"
        raise InputError.of("unmeasured", unmeasured, words)
    rows = rows or no_rows(ensemble)
    forces = fitted(ensemble, m, s, unmeasured, rows)
    deviation, of_rows = (forces - m) / s, rows.deviation(forces)
    measured_numbers = int(np.isfinite(deviation).sum()) + len(of_rows)
    freedom = measured_numbers - _adapted(ensemble, m, forces, rows)
    chi_square = float(np.nansum(deviation**2) + of_rows @ of_rows)
    return Likeliest(forces, chi_square, freedom, deviation, of_rows)


def checked(
    ensemble: Ensemble, measured: npt.ArrayLike | None, sigma: npt.ArrayLike | None
) -> tuple[Floats, Floats]:
    """m and σ (N_c, 2), NaN in both where nothing was measured.

    measured (N_c, 2), force; sigma likewise, or one number, or two for f_n and f_t; None for both
    if no force was measured. Raises
    InputError for shapes that do not fit, infinite numbers, σ ≤ 0, and sizes beyond MEASURED or
    ERRORS.
    """
    shape = (len(ensemble.index), 2)
    if measured is None and sigma is None:
        measured = sigma = np.full(shape, np.nan)
    try:
        m = np.array(measured, dtype=np.float64)
        s = np.array(np.broadcast_to(np.asarray(sigma, dtype=np.float64), shape))
    except (TypeError, ValueError):
        raise InputError(f"measured and sigma must be numbers of shape {shape}") from None
    if m.shape != shape:
        raise InputError(f"measured must have shape {shape}, got {m.shape}")
    if np.isnan(s).all() and not np.isnan(m).all():
        raise InputError("every sigma is NaN: give the standard errors of the measured forces")
    nothing = np.isnan(m) | np.isnan(s)
    m[nothing] = s[nothing] = np.nan
    if np.isinf(m).any() or np.isinf(s).any():
        raise InputError("measured forces and errors must be finite, or NaN where not measured")
    for c, part in np.argwhere(s <= 0)[:1]:
        raise InputError(
            f"the error of {_PARTS[part]} on contact {ensemble.index[c]} is {s[c, part]:g}; errors "
            "must be above 0"
        )
    unit = ensemble.force_scale
    for c, part in np.argwhere(np.abs(m) > MEASURED * unit)[:1]:
        raise InputError(
            f"{_PARTS[part]} measured on contact {ensemble.index[c]} is {m[c, part]:g}, more than "
            f"{MEASURED:g} times the mean normal force {unit:.3g}; check the unit"
        )
    for c, part in np.argwhere((s < unit / ERRORS) | (s > unit * ERRORS))[:1]:
        raise InputError(
            f"the error of {_PARTS[part]} on contact {ensemble.index[c]} is {s[c, part]:g}, a "
            f"factor of more than {ERRORS:g} from the mean normal force {unit:.3g}; check the unit"
        )
    return m, s


def fitted(
    ensemble: Ensemble,
    m: Floats,
    s: Floats,
    unmeasured: float = UNMEASURED,
    rows: Rows | None = None,
) -> Floats:
    """The forces (N_c, 2) of `likeliest`, for m and σ that were checked."""
    if rows is None or not len(rows.values):
        return fitted_many(ensemble, m[None], s, unmeasured)[0]
    return _by_piqp(ensemble, m, s, unmeasured, rows)


def fitted_many(
    ensemble: Ensemble, many: Floats, s: Floats, unmeasured: float = UNMEASURED
) -> Floats:
    """Forces (k, N_c, 2) of `likeliest` for k ≤ LANES measurements (k, N_c, 2), in lanes.

    All measure the same components. Each gives the same network as alone.
    """
    problem, unit = problem_of(ensemble), ensemble.force_scale
    m, width = many[0], 1 if len(many) == 1 else LANES
    # Tangential forces are kept as f_t/μ.
    weight = np.column_stack([np.ones(len(s)), ensemble.slopes**2])
    w = np.where(np.isnan(m), unmeasured, s / unit) ** -2.0 * weight
    scale = w.max(initial=0.0)
    problem = problem._replace(w=np.where(problem.w < PINNED, w.ravel() / scale, PINNED))
    at = contact_program.make_iterate(problem, width)
    work = contact_program.make_workspace(problem, width)
    for lane, values in enumerate(many):
        target = np.nan_to_num(values / unit) / ensemble.units
        pulls = np.where(problem.w.reshape(w.shape) < PINNED, w / scale * target, 0.0)
        at.c[: w.size : 2, lane] = -0.5 * (pulls[:, 0] + pulls[:, 1])
        at.c[1 : w.size : 2, lane] = -0.5 * (pulls[:, 0] - pulls[:, 1])
    work.going[:] = 0.0
    work.going[0, : len(many)] = 1.0
    closed = (_CLOSED_BETWEEN_BOUNDS if len(problem.side) else _CLOSED) * len(at.y)
    lanes = ONE if width == 1 else MANY
    for _ in range(_MOST_STEPS):
        cancelling.check("inference")
        interior_point.look(problem, False, at, work, lanes)
        solved = (work.unbalance[0] <= _BALANCE) & (work.product[0] <= closed)
        work.going[0, solved] = 0.0
        if not work.going[0].any():
            break
        interior_point.advance(problem, False, OPTIMUM, at, work, lanes)
    forces = np.stack([forces_of(ensemble, at.y[:-1, lane]) for lane in range(len(many))])
    for lane in np.flatnonzero(~(ensemble.residual(forces) <= BALANCED)):
        forces[lane] = _otherwise(ensemble, forces[lane], many[lane], s, unmeasured)
    return forces


def _otherwise(
    ensemble: Ensemble, forces: Floats, m: Floats, s: Floats, unmeasured: float
) -> Floats:
    """The most likely network if the steps ended just outside S, or did not converge."""
    relaxed = nearest(ensemble, forces) if np.isfinite(forces).all() else None
    if relaxed is not None and relaxed.converged and relaxed.residual <= BALANCED:
        if np.abs(relaxed.forces - forces).max() <= _NEAR * ensemble.force_scale:
            return relaxed.forces
    return _by_piqp(ensemble, m, s, unmeasured)


def _by_piqp(
    ensemble: Ensemble, m: Floats, s: Floats, unmeasured: float, rows: Rows | None = None
) -> Floats:
    """The most likely network by PIQP; the error that can be proved if there is none."""
    spread = np.where(np.isnan(m), unmeasured * ensemble.force_scale, s)
    forces = likeliest_piqp(ensemble, 1 / spread, m, rows)
    if ensemble.admits(forces):
        return forces
    if ensemble.member is not None and ensemble.dimension == 0:
        return ensemble.member
    raise certificates.why_unsolved(*ensemble.scaled_form[:2], slack=ensemble.slack)


def _adapted(ensemble: Ensemble, m: Floats, forces: Floats, rows: Rows) -> int:
    """Dimensions in which the measured part of a network could follow the measurement.

    The rank of the measured components and rows on the null space of the balance, with cone
    coordinates held that are 0 there.
    """
    free = np.flatnonzero(ensemble.coordinates(forces) > _ON_THE_WALL)
    A, _, T = ensemble.scaled_form
    sums = sparse.csr_matrix(rows.unknowns(ensemble) @ T)[:, free]
    A, T = sparse.csc_matrix(A)[:, free], sparse.csr_matrix(T)[:, free]
    T = T[np.flatnonzero(np.isfinite(ensemble.to_vector(m)))]
    if ensemble.mu > 0:
        T.data = np.sign(T.data)  # a rank does not depend on units
    return _rank(sparse.vstack([A, T, sums], format="csr")) - _rank(A)


def _rank(rows: sparse.csr_matrix) -> int:
    """The rank of a sparse matrix R.

    With ε added to the diagonal of R Rᵀ (in which a row that meets all contacts fills one row only)
    its determinant grows like ε to the number of dependent rows, in any order of elimination.
    """
    square = rows @ rows.T
    diagonal = square.diagonal()
    positive = np.flatnonzero(diagonal > 0)
    if not len(positive):
        return 0
    scale, unit = sparse.diags(1 / np.sqrt(diagonal[positive])), sparse.identity(len(positive))
    square = scale @ square[positive][:, positive] @ scale
    less, more = (cancelling.apart(_log_determinant, square + shift * unit) for shift in _SHIFTS)
    return len(positive) - round((more - less) / np.log(_SHIFTS[1] / _SHIFTS[0]))


def _log_determinant(square: sparse.csc_matrix) -> float:
    return np.log(np.abs(symmetric_factor(square).U.diagonal())).sum()
