"""Prescribed, known and measured quantities: bounds beside HiGHS, pulls and inference beside PIQP.

All methods get the same programs; rows include the error of their results.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import highspy
import numpy as np
from scipy import sparse

from granforce.bench.exact import plain_loop
from granforce.bench.runner import Methods, Row, compared, note, packings
from granforce.explore.intervals import intervals
from granforce.explore.pull import pull
from granforce.explore.uniform import sample_uniform
from granforce.forces.build import ensemble
from granforce.forces.ensemble import Ensemble
from granforce.forces.knowledge import Known
from granforce.forces.likeliest import checked, fitted
from granforce.numerics import highs as programs
from granforce.types import Floats, Integers

# Fraction of contacts with known forces, and the width of their bounds; values of a pull, as
# fractions of its interval.
KNOWN_PART, KNOWN_WITHIN = 0.1, 0.1
VALUES = np.linspace(0.05, 0.95, 8)
# Errors of f_n and f_t in ⟨f_n⟩, and the time limit of HiGHS in seconds.
ERRORS, PATIENCE = (0.2, 0.1), 120.0


def knowledge(
    n: int = 400, mu: float = 0.1, seed: int = 1, every: int = 6, pulled: int = 3, repeats: int = 3
) -> list[Row]:
    """Rows: seconds of the same programs by granforce and by the baseline, and their errors.

    Bounds are those of every n-th contact (`every`). ratio: seconds of the baseline, HiGHS or PIQP,
    over those of the row. gap: largest certified duality gap; off: how far a bound of the baseline
    is outside the certified ones, or the largest difference between forces; residual: largest
    unbalance, all in ⟨f_n⟩; above: largest relative excess of the minimised sum of squares over
    that of the other method.
    """
    ((case, S),) = packings("knowledge", n, [mu], seed)
    rng = np.random.default_rng(seed)
    ensembles = {
        "bounds, pressure prescribed": S,
        "bounds, stress prescribed": ensemble(S.packing, prescribed="stress"),
        "bounds, a tenth of the forces known": ensemble(S.packing, known=_known(S, rng)),
    }
    rows = []
    for task, one in ensembles.items():
        rows += _bounds(case | {"task": task}, one, one.index[::every])
    contacts = rng.choice(S.index, pulled, replace=False)
    rows += _pulls(case, S, contacts, repeats)
    m, sigma = _measurement(S, rng, seed)
    methods: Methods = {
        "granforce": lambda: contact_program(S, m, sigma)[None],
        "PIQP": lambda: piqp(S, m, sigma)[None],
    }
    case = case | {"task": "inference, everything measured", "programs": 1}
    return rows + _networks(case, S, methods, lambda f: ((f - m) / sigma) ** 2, repeats)


def _known(S: Ensemble, rng: np.random.Generator) -> Known:
    """Normal forces of some contacts, within a tenth of the packing's own."""
    count = max(1, round(KNOWN_PART * len(S.index)))
    places = np.sort(rng.choice(len(S.index), count, replace=False))
    forces = S.original[places]
    reach = np.full_like(forces, np.inf)
    reach[:, 0] = KNOWN_WITHIN * forces[:, 0]
    return Known(S.index[places], forces - reach, forces + reach)


def _measurement(S: Ensemble, rng: np.random.Generator, seed: int) -> tuple[Floats, Floats]:
    """A uniform state of S measured with ERRORS, and the errors (2,)."""
    sigma = np.array(ERRORS) * S.force_scale
    truth = sample_uniform(S, 8, seed=seed).flat[-1]
    return truth + sigma * rng.standard_normal(truth.shape), sigma


def _bounds(case: Row, S: Ensemble, contacts: Integers) -> list[Row]:
    note(f"knowledge: {case['task']}")
    intervals(S, contacts[:1])  # compiles
    S = replace(S)  # without prepared data
    methods: Methods = {
        "granforce": lambda: intervals(S, contacts),
        "HiGHS": lambda: plain_loop(S, contacts),
    }

    def measure(name: str, results: Row) -> Row:
        exact, bounds = results.values()
        if name == "granforce":
            return {"gap": exact.max_gap}
        # The optimum is between the value attained and its bound.
        beyond = np.abs([bounds[0] - exact.low, bounds[1] - exact.high]) / S.force_scale
        outside = np.maximum(beyond - np.moveaxis(exact.gap, -1, 0), 0.0)
        return {"off": float(outside.max())}

    return compared(case | {"programs": 4 * len(contacts)}, methods, measure, "HiGHS")


def _pulls(case: Row, S: Ensemble, contacts: Integers, repeats: int) -> list[Row]:
    note("knowledge: pulls")
    exact = intervals(S, contacts)
    ends = zip(contacts, exact.low[:, 0], exact.high[:, 0], strict=True)
    targets = [(int(c), low + VALUES * (high - low)) for c, low, high in ends]
    methods: Methods = {
        "granforce": lambda: np.concatenate(
            [pull(S, c, values, S.original).states for c, values in targets]
        ),
        "PIQP": lambda: np.array(
            [_pulled_by_piqp(S, c, value) for c, values in targets for value in values]
        ),
    }
    case = case | {"task": "pulls", "programs": len(targets) * len(VALUES)}
    return _networks(case, S, methods, lambda states: (states - S.original) ** 2, repeats)


def _networks(
    case: Row, S: Ensemble, methods: Methods, squares: Callable[[Floats], Floats], repeats: int
) -> list[Row]:
    """Rows of two methods for the same networks (k, N_c, 2), which minimise a sum of squares."""

    def measure(name: str, results: Row) -> Row:
        sums = {name: squares(states).sum(axis=(1, 2)) for name, states in results.items()}
        ours, theirs = results.values()
        return {
            "off": float(np.abs(ours - theirs).max() / S.force_scale),
            "residual": float(np.max(S.residual(results[name]))),
            "above": float(np.max(sums[name] / np.minimum(*sums.values()) - 1)),
        }

    return compared(case, methods, measure, "PIQP", repeats=repeats + 1)  # the first run compiles


def _pulled_by_piqp(S: Ensemble, contact: int, value: float) -> Floats:
    """The network nearest to the original with this f_n."""
    A, b, T = S.scaled_form
    normal = T.tocsr()[S.per_contact * S.positions([contact])]
    solver = programs.quadratic_solver(400)
    solver.setup(
        sparse.csc_matrix(T.T @ T),
        -(T.T @ S.to_vector(S.original)) / S.force_scale,
        sparse.vstack([A, normal], format="csc"),
        np.append(b, value / S.force_scale),
        x_l=np.zeros(A.shape[1]),
    )
    solver.solve()
    return S.to_forces(T @ np.maximum(solver.result.x, 0.0) * S.force_scale)


def inference(
    n: int = 400, frictions: Sequence[float] = (0.01, 0.1, 0.5), seed: int = 1, repeats: int = 3
) -> list[Row]:
    """Rows: seconds of one inference (the least of some), and its difference from the first method.

    A uniform state of S is measured completely with ERRORS. ratio: time over that of the contact
    program; chi_square: of the forces reached; off: largest difference of a force, in ⟨f_n⟩.
    """
    rows = []
    for case, S in packings("inference", n, frictions, seed):
        given = (S, *_measurement(S, np.random.default_rng(seed), seed))
        methods = {name: partial(solve, *given) for name, solve in SOLVERS.items()}
        rows += compared(
            case | {"unknowns": S.A.shape[1]},
            methods,
            partial(_errors, *given),
            "contact program",
            repeats=repeats + 1,  # the first run compiles
            over_baseline=True,
        )
    return rows


def _errors(S: Ensemble, m: Floats, sigma: Floats, name: str, results: Row) -> Row:
    forces = results[name]
    if forces is None:
        return {"note": f"ended without an optimum (limit {PATIENCE:g} s)"}
    off = np.abs(forces - results["contact program"]).max() / S.force_scale
    chi_square = float(np.sum(((forces - m) / sigma) ** 2))
    return {"chi_square": chi_square, "off": float(off), "residual": S.residual(forces)}


def contact_program(S: Ensemble, m: Floats, sigma: Floats) -> Floats:
    """The forces by `granforce.infer`."""
    return fitted(S, *checked(S, m, sigma))


def _program(S: Ensemble, m: Floats, sigma: Floats) -> tuple[Any, ...]:
    """½ y·Q y + c·y over A y = b, y ≥ 0: (Q, c, A, b, T), scaled to a largest weight of 1."""
    A, b, T = S.scaled_form
    weight = np.tile(sigma.min() / sigma, len(m))[: T.shape[0]] ** 2
    weighted = sparse.diags(weight) @ T
    target = S.to_vector(m) / S.force_scale
    return sparse.csc_matrix(T.T @ weighted), -(weighted.T @ target), A, b, T


def piqp(S: Ensemble, m: Floats, sigma: Floats) -> Floats:
    """The forces by PIQP's sparse interior-point method."""
    Q, c, A, b, T = _program(S, m, sigma)
    solver = programs.quadratic_solver(400)
    solver.setup(Q, c, A, b, x_l=np.zeros(len(c)))
    solver.solve()
    return S.to_forces(T @ np.maximum(solver.result.x, 0.0)) * S.force_scale


def highs(S: Ensemble, m: Floats, sigma: Floats) -> Floats | None:
    """The forces by the active-set method of HiGHS; None on time-out."""
    Q, c, A, b, T = _program(S, m, sigma)
    model = programs.standard_form(A, b)
    programs.set_cost(model, c)
    hessian, lower = highspy.HighsHessian(), sparse.csc_matrix(sparse.tril(Q))
    hessian.dim_ = len(c)
    hessian.format_ = highspy.HessianFormat.kTriangular
    hessian.start_, hessian.index_ = lower.indptr, lower.indices
    hessian.value_ = lower.data
    model.passHessian(hessian)
    model.setOptionValue("time_limit", PATIENCE)
    status, y = programs.solve(model)
    if status != programs.OPTIMAL:
        return None
    return S.to_forces(T @ np.maximum(y, 0.0)) * S.force_scale


SOLVERS: dict[str, Callable[..., Floats | None]] = {
    "contact program": contact_program,
    "PIQP": piqp,
    "HiGHS": highs,
}
