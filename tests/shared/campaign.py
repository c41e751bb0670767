"""A random campaign: small packings of every kind through every stage, judged from outside.

A case is a packing drawn from its number alone: μ from 0 to 10⁴, 2 to 60 disks, six distributions
of sizes, units of 10^±9. Five force spaces are made of each, and each goes through every stage.
Judges are `residual` and `violation`, scipy's linear programs for bounds, and the rule that
nothing may be called empty, or undecided, where a network of it is at hand.
"""

import io
from typing import NamedTuple

import numpy as np
import pandas as pd
from packings import two_disks
from scipy.optimize import linprog

import granforce as gf
from granforce.packing.masonry import rectangle
from granforce.records import Packing, make_packing
from granforce.tolerances import ADMISSIBLE, BALANCED, INTERVAL_GAP

SIZES = (
    *("uniform:0.5,1", "uniform:0.05,1", "uniform:1,1"),
    *("bidisperse:0.7,1,0.5", "bidisperse:0.2,1,0.1", "bidisperse:1,5,0.5"),
)
# What linprog's bounds may differ by from ours, in ⟨f_n⟩: its feasibility tolerance, 10⁻⁷ or, where
# it takes it, 10⁻¹⁰, magnified by how forces hang together.
_AS_BOUND = 1e-6


class Case(NamedTuple):
    """One packing of the campaign."""

    number: int
    packing: Packing
    rng: np.random.Generator


def case(number, most=60):
    """The Case of a number, of `most` disks; None where they did not jam within the steps."""
    rng = np.random.default_rng([25, number])
    n = 2 + int(
        (most - 1) * rng.random() ** 3
    )  # small ones are many: they cost least, and are strangest
    mu = 0.0 if rng.random() < 0.1 else float(10 ** rng.uniform(-8, 4))
    sizes, pressure = SIZES[rng.integers(len(SIZES))], float(10 ** rng.uniform(-9, 9))
    length, seed = float(10 ** rng.uniform(-9, 9)), int(rng.integers(2**31))
    if n == 2:
        return Case(number, two_disks(pressure)._replace(mu=mu), rng)
    try:
        packing = gf.pack(n, mu, seed, radii=sizes, pressure=pressure, max_steps=20_000)
    except gf.NotJammedError:
        return None
    return Case(number, _in_units(packing, length), rng)


def _in_units(packing, length):
    """The packing in another unit of length; its pressure, force per length, falls as it grows."""
    c = packing.contacts
    scaled = {name: length * getattr(c, name) for name in ("length", "gap", "arm_i", "arm_j")}
    return make_packing(
        *(length * packing.x, length * packing.r, length * packing.box, c._replace(**scaled)),
        *(packing.forces, packing.mu, packing.pressure / length),
        info=packing.info,
    )


def floor(number, most=25):
    """The Case of disks at rest on a floor, rough or smooth."""
    rng = np.random.default_rng([26, number])
    low, high = sorted(10 ** rng.uniform(-0.3, 0.3, 2) * 10 ** rng.uniform(-6, 6))
    n, mu, seed = int(rng.integers(3, most)), 10 ** rng.uniform(-2, 1), int(rng.integers(2**31))
    box = ("floor", "smooth floor")[number % 2]
    return Case(number, gf.pack(n, mu, seed, radii=f"uniform:{low:.9g},{high:.9g}", box=box), rng)


def parts(number, most=12):
    """The Case of a wall of stones in two parts each: rectangles, or L that interlock."""
    rng = np.random.default_rng([27, number])
    rows, columns = int(rng.integers(1, 4)), int(rng.integers(1, 1 + most // 6))
    unit, cut = 10 ** rng.uniform(-6, 6), rng.uniform(0.5, 1.5)
    stones = []
    for row, column in np.ndindex(rows, columns):
        x, y = 2 * column, 3 * row
        if number % 2:
            stones.append([rectangle(x, y, x + 1, y + 2), rectangle(x + 1, y, x + 2, y + 1)])
            x2, y2, y3 = x + 2, y + 2, y + 3
            stones.append([rectangle(x, y2, x + 1, y3), rectangle(x + 1, y + 1, x2, y3)])
        else:
            x += 0.7 * (row % 2)
            halves = rectangle(x, y, x + cut, y + 3), rectangle(x + cut, y, x + 2, y + 3)
            stones.append(list(halves))
    bodies = [*stones, [rectangle(-2, -1, 2 * columns + 2, 0)]]
    bodies = [[unit * np.array(part) for part in body] for body in bodies]
    mu, weights = (
        10 ** rng.uniform(-1, 0),
        10 ** rng.uniform(-6, 6) * rng.uniform(0.5, 2, len(bodies)),
    )
    packing = gf.blocks(bodies, mu, fixed=[len(stones)], weights=weights)
    return Case(number, packing, rng)


def spaces(one):
    """Force spaces of a case, {name: (its ensemble, a network (contacts, 2) that lies in it)}.

    Of packings without a pressure those alone that are bounded.
    """
    packing, rng = one.packing, one.rng
    S = gf.ensemble(packing)
    if not S.has_pressure_row and not S.bounded:
        return {}
    member = S.expand(gf.walk(S, 1, 0).states[0] if one.number % 2 else _own(S))
    found = {"own": (S, member)}
    wider = min(1e4, max(1e-6, packing.mu) * 10 ** rng.uniform(0, 2))
    asked = {"opened": {"mu": wider}}
    asked |= {"stress": {"prescribed": "stress"}} if S.has_pressure_row else {}
    frozen = rng.permutation(len(packing.contacts.i))[: len(packing.contacts.i) // 2]
    asked["frozen"] = {"frozen": frozen}
    own = packing.forces if S.admits(S.original) else None
    for name, options in asked.items():
        if own is not None:
            found[name] = gf.ensemble(packing, **options), own
    state = S.expand(gf.sample_uniform(S, 2, 1, seed=one.number).flat[-1])
    held = rng.choice(S.index, min(4, len(S.index)), replace=False)
    width = np.where(rng.random((len(held), 2)) < 0.3, 0.0, 0.1) * np.abs(state[held])
    known = gf.Known(held, state[held] - width, state[held] + width)
    found["known"] = gf.ensemble(packing, known=known), state
    return {name: one for name, one in found.items() if S.has_pressure_row or one[0].bounded}


def _own(S):
    return S.original if S.admits(S.original) else gf.nearest(S, S.original).forces


def walks(S, rng):
    done = gf.walk(S, 4, 1)
    _balanced(S, done.states)
    assert done.counts["rejected"] == 0, done.counts


def sweeps(S, rng):
    """Sweeps claim no more than they reach."""
    if S.prescribed == "stress" or S.known is not None or S.packing.shapes is not None:
        return  # contact dynamics knows none of these
    found = gf.gauss_seidel(S, S.original)
    if found.converged and found.residual <= 1e-6:
        assert S.violation(found.forces) <= ADMISSIBLE


def nearests(S, rng):
    start = S.original + S.force_scale * rng.normal(size=S.original.shape)
    found = gf.nearest(S, start)
    if found.converged:
        _balanced(S, found.forces)


def uniform_states(S, rng):
    sample = gf.sample_uniform(S, 8)
    _balanced_or_told(S, sample.states, sample.reached)


def hit_and_run(S, rng):
    sample = gf.sample_uniform(S, 4, method="hit_and_run")
    _balanced_or_told(S, sample.states, sample.reached)


def bounds(S, rng):
    """Certified, around all states, and those of linprog."""
    some = np.sort(rng.permutation(len(S.index))[:4])
    found = gf.intervals(S, S.index[some])
    assert found.converged, f"uncertified: {int(np.sum(~(found.gap <= 1e-8)))} bounds"
    witness = linprog_bounds(S, int(some[0]))
    ours = np.stack([found.low[0], found.high[0]], axis=1) / S.force_scale
    off = np.abs(ours - witness)
    assert not np.any(off > _AS_BOUND * np.maximum(1, np.abs(witness))), f"linprog: off {off}"
    if (own := _member(S)) is not None:
        inside = own[some]
        slack = 1e-7 * S.force_scale
        assert np.all(inside >= found.low - slack), "a member lies below its bound"
        assert np.all(inside <= found.high + slack), "a member lies above its bound"


def limit_loads(S, rng):
    """Not below 0; NaN, which says uncertified, only where more is asked than the packing's own."""
    contacts = S.index[rng.permutation(len(S.index))[:3]]
    load = gf.limit_loads(S, contacts)
    assert not np.any(load < -INTERVAL_GAP * S.force_scale), load
    plain = S.prescribed == "pressure" and S.known is None
    assert not plain or np.all(np.isfinite(load)), f"uncertified: {load}"


def reaches(S, rng):
    contact = S.index[rng.integers(len(S.index))]
    found = gf.reach(S, contact)
    _balanced(S, found.states)


def pulls(S, rng):
    contact = S.index[rng.integers(len(S.index))]
    reach = gf.reach(S, contact)
    done = gf.pull(S, contact, np.linspace(reach.low, reach.high, 3))
    _balanced(S, done.states)


def outlines(S, rng):
    axes = rng.normal(size=(2, len(S.index), 2))
    assert gf.outline(S, axes, tolerance=0.1).converged, "uncertified"


def stress_outlines(S, rng):
    if S.prescribed == "pressure":
        assert gf.stress_outline(S, 8).friction >= 0


def inferences(S, rng):
    own = _member(S)
    if own is None:
        return
    sigma = 0.1 * S.force_scale
    measured = own + sigma * rng.normal(size=own.shape)
    measured[rng.random(len(measured)) < 0.2] = np.nan
    found = gf.infer(S, measured, sigma, states=8)
    _balanced(S, found.forces)
    _balanced_or_told(S, found.draws.flat, found.draws.reached)


def pressures(S, rng):
    """Measured pressures of grains fit no worse than the network from which they were made."""
    own = _member(S)
    if own is None:
        return
    true = gf.grain_pressures(S, own)
    grains = np.flatnonzero(np.isfinite(true))
    sigma = 0.1 * np.abs(true[grains]).mean()
    noise = rng.normal(size=len(grains))
    given = gf.GrainPressures(grains, true[grains] + sigma * noise, sigma)
    found = gf.infer(S, pressures=given, states=8, unmeasured=1e3)
    _balanced(S, found.forces)
    _balanced_or_told(S, found.draws.flat, found.draws.reached)
    usual = np.sum((own / (1e3 * S.force_scale)) ** 2)
    assert found.chi_square <= noise @ noise + usual + 1e-6, f"χ² {found.chi_square}"


def total_forces(one):
    """A packing is read again from tables of its grains and total forces."""
    packing, c = one.packing, one.packing.contacts
    fx, fy = (packing.forces[:, :1] * c.normal + packing.forces[:, 1:] * c.tangent).T
    grains = pd.DataFrame({"x": packing.x[:, 0], "y": packing.x[:, 1], "r": packing.r})
    links = pd.DataFrame({"i": c.i, "j": c.j, "fx": fx, "fy": fy})
    files = [io.StringIO(table.to_csv(index=False)) for table in (grains, links)]
    again = gf.read_table(*files, box=packing.box, mu=packing.mu)
    off = np.abs(again.forces - packing.forces).max(initial=0.0)
    assert off <= 1e-6 * np.abs(packing.forces).max(initial=0.0), f"off by {off:.1e}"


def carries(S, rng):
    own = _member(S)
    if own is not None:
        gf.carrying(S, own, 0.1 * S.force_scale, S.index[:2])


def next_measurements(S, rng):
    try:
        gf.informative(S, 2, states=40, check=1)
    except gf.InputError as error:
        if "nothing to measure" not in str(error):
            raise


def pushes(S, rng):
    contact = S.index[rng.integers(len(S.index))]
    if S.known is None and S.prescribed == "pressure" and S.mu == S.packing.mu:
        critical = gf.critical_force(S, contact)
        limit = gf.limit_loads(S, [contact])[0]
        assert critical.low <= limit * (1 + 1e-9) + 1e-9 * S.force_scale
        if critical.moving is not None:
            gf.response(S, contact, critical=critical)


# Words with which a stage says that it reached no certificate: honest, and counted.
UNDECIDED = "UndecidedError", "uncertified", "not certified", "cannot be certified"

STAGES = (
    *(walks, sweeps, nearests, uniform_states, hit_and_run, bounds, limit_loads, reaches, pulls),
    *(outlines, stress_outlines, inferences, pressures, carries, next_measurements, pushes),
)


def faults(number, make=case, every=1, **options):
    """What did not stand in a case, [(space, stage, what)], and how many stages were gone through.

    A refusal is a fault, as every space has a network that is at hand. every: of each space only
    one stage in so many is gone through, by turns.
    """
    one, wrong, done = make(number, **options), [], 0
    if one is None:
        return wrong, done
    try:
        found = spaces(one)
    except Exception as error:
        return [("", "spaces", _told(error))], 1
    for turn, (name, (S, member)) in enumerate(found.items()):
        try:
            inside = member[S.index]
            assert S.residual(inside) <= 2 * BALANCED, "what is at hand is not balanced"
        except Exception as error:
            wrong.append((name, "member", _told(error)))
        for stage in STAGES[(number + turn) % every :: every]:
            done += 1
            try:
                stage(S, np.random.default_rng([number, done]))
            except Exception as error:
                wrong.append((name, stage.__name__, _told(error)))
    return wrong, done


def _told(error):
    return f"{type(error).__name__}: {str(error)[:160]}"


def _balanced_or_told(S, states, reached):
    """With frozen or known forces S may be so thin that samples miss balance, and report it."""
    if (len(S.frozen) or S.known is not None) and not reached:
        assert np.max(S.residual(states)) <= 1e-7
    else:
        _balanced(S, states)


def _balanced(S, states):
    residual, violation = np.max(S.residual(states)), np.max(S.violation(states))
    assert residual <= BALANCED, f"unbalance of {residual:.1e}"
    assert violation <= ADMISSIBLE, f"violation of {violation:.1e}"


def _member(S):
    return S.original if S.admits(S.original) else None


def linprog_bounds(S, c):
    """Least and largest f_n and f_t (2, 2) of the contact at position c, ⟨f_n⟩, by linprog."""
    A, b, T = S.scaled_form
    T = T.tocsr()
    found = np.zeros((2, 2))
    for component in range(S.per_contact):
        row = T[S.per_contact * c + component].toarray().ravel()
        for side, sign in enumerate((1, -1)):
            scale = np.abs(row).max()
            # Its tolerance is that of a cost of order 1, which f_t has times μ.
            done = linprog(
                *(sign * row / scale, None, None, A, b, (0, None)),
                options={f"{which}_feasibility_tolerance": 1e-10 for which in ("primal", "dual")},
            )
            value = sign * done.fun * scale if done.status == 0 else np.nan
            found[component, side] = value
    return found
