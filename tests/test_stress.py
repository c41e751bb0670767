"""Numerical stability: extreme frictions, units, sizes and degenerate geometries.

The quick cases run always, the long ones with -m stress.
"""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from packings import lattice, packed, reference

from granforce import measures
from granforce.explore.intervals import intervals
from granforce.explore.random_walk import walk
from granforce.forces.build import ensemble
from granforce.forces.nearest import nearest
from granforce.forces.nearest_piqp import nearest_piqp
from granforce.motion.gauss_seidel import gauss_seidel
from granforce.packing.compaction import pack
from granforce.packing.neighbours import find_pairs, separations
from granforce.records import NotJammedError, make_contacts, make_packing


def assert_sound(packing, overlap=1e-7):
    """Balanced, inside the cones, without overlap; returns the ensemble."""
    unit = packing.r.max()
    i, j, shift = find_pairs(packing.x, packing.r, packing.cell, 0.01 * unit)
    assert separations(packing.x, packing.r, packing.cell, i, j, shift)[2].min() > -overlap * unit
    S = ensemble(packing)
    assert S.residual(S.original) < 1e-10
    assert S.violation(S.original) < 1e-9
    return S


@pytest.mark.parametrize("mu", [0.0, 1e-8, 1e-4, 100.0, 1e3])
def test_friction_from_none_to_a_thousand(mu):
    S = assert_sound(pack(40, mu, 4))
    done = walk(S, 5, 0)
    assert done.counts["unconverged"] == done.counts["rejected"] == 0
    assert S.residual(done.states).max() < 1e-10
    # Indeterminacy is proportional to μ where μ is small.
    if mu <= 1e-4:
        assert measures.eta2(done.states) <= 100 * mu + 1e-9


@pytest.mark.parametrize("pressure", [1e-12, 1e12])
def test_any_unit_of_pressure(pressure):
    S = assert_sound(pack(30, 0.3, 1, pressure=pressure))
    done = walk(S, 5, 0)
    assert S.residual(done.states).max() < 1e-10
    same = ensemble(pack(30, 0.3, 1))
    assert measures.eta2(done.states) == pytest.approx(
        measures.eta2(walk(same, 5, 0).states), rel=1e-9
    )


@pytest.mark.parametrize("radii", ["bidisperse:0.05,1,0.3", "uniform:0.05,1", "uniform:1,1"])
def test_very_unequal_and_equal_disks(radii):
    assert_sound(pack(60, 0.3, 2, radii=radii))


@pytest.mark.parametrize("n", [4, 5, 8])
def test_few_disks(n):
    for seed in range(5):
        try:
            assert_sound(pack(n, 0.5, seed))
        except NotJammedError as error:
            assert "disks" in str(error) or "steps" in str(error)


def without_grain(packing, grain):
    """The packing with one grain's contacts gone: a vacancy."""
    keep = (packing.contacts.i != grain) & (packing.contacts.j != grain)
    contacts = packing.contacts.picked(keep)
    return packing._replace(contacts=contacts, forces=packing.forces[keep])


@pytest.mark.parametrize("triangular", [False, True])
@pytest.mark.parametrize("mu", [0.0, 0.2])
@pytest.mark.parametrize("vacancy", [False, True])
def test_crystals_with_dependent_equations(triangular, mu, vacancy, rng):
    packing = lattice(6, 6, mu, triangular)
    if vacancy:
        packing = without_grain(packing, 14)
    S = ensemble(packing)
    start = rng.uniform(-1, 2, S.original.shape)
    found = nearest_piqp(S, start)
    assert found.converged
    swept = gauss_seidel(S, start)
    assert swept.residual < 1e-10
    assert S.violation(found.forces) < 1e-9
    bounds = intervals(S, S.index[[0, 5]])
    assert bounds.max_gap <= 1e-8
    for forces in (found.forces, swept.forces):
        inside = forces[[0, 5]]
        assert np.all(inside >= bounds.low - 1e-7)
        assert np.all(inside <= bounds.high + 1e-7)


def test_a_box_much_longer_than_wide(rng):
    S = ensemble(lattice(60, 4, 0.3, triangular=True))
    assert nearest_piqp(S, rng.uniform(0, 2, S.original.shape)).converged
    assert gauss_seidel(S, rng.uniform(0, 2, S.original.shape)).residual < 1e-10


def test_nearly_touching_grains_are_no_contacts():
    packing = packed(60, 0.3)
    i, j, shift = find_pairs(packing.x, packing.r, packing.cell, 0.05)
    gap = separations(packing.x, packing.r, packing.cell, i, j, shift)[2]
    # Every pair closer than the tolerance is in the list, none that is farther away.
    listed = set(zip(packing.contacts.i, packing.contacts.j, strict=True))
    close = set(zip(i[gap < 1e-10], j[gap < 1e-10], strict=True))
    assert close <= listed
    far = set(zip(i[gap > 1e-6], j[gap > 1e-6], strict=True))
    assert not far & listed


def test_rounding_noise_on_the_geometry_stays_small(rng):
    packing = reference("n100_mu0.1_s11")
    c = packing.contacts
    start = rng.uniform(0, 2, packing.forces.shape)
    turn = 1e-12 * rng.normal(size=len(c.i))
    normal = c.normal + turn[:, None] * np.column_stack([-c.normal[:, 1], c.normal[:, 0]])
    shaken = make_packing(
        packing.x,
        packing.r,
        packing.box,
        make_contacts(c.i, c.j, normal, c.length, packing.r),
        packing.forces,
        packing.mu,
        packing.pressure,
    )
    S, T = ensemble(packing), ensemble(shaken)
    one, two = (nearest_piqp(E, start[E.index]).forces for E in (S, T))
    assert np.abs(one - two).max() < 1e-8 * S.force_scale


@pytest.mark.parametrize("one", [nearest_piqp, nearest])
@pytest.mark.parametrize("other", [nearest_piqp, nearest])
def test_order_of_contacts_does_not_matter_between_solvers(one, other, rng):
    packing = reference("n100_mu1_s12")
    order = rng.permutation(len(packing.contacts.i))
    contacts = packing.contacts.picked(order)
    mixed = packing._replace(contacts=contacts, forces=packing.forces[order])
    start = rng.uniform(0, 2, packing.forces.shape)
    S, T = ensemble(packing), ensemble(mixed)
    found = S.expand(one(S, start[S.index]).forces)
    again = T.expand(other(T, start[order][T.index]).forces)
    assert np.abs(found[order] - again).max() < 1e-9 * S.force_scale


@pytest.mark.parametrize("pressure", [1e-12, 1e12])
def test_forces_scale_with_the_pressure_between_solvers(pressure, rng):
    packing = reference("n100_mu0.1_s11")
    scaled = packing._replace(
        forces=packing.forces * pressure, pressure=packing.pressure * pressure
    )
    start = rng.uniform(0, 2, packing.forces.shape)
    S, T = ensemble(packing), ensemble(scaled)
    one = nearest_piqp(S, start[S.index]).forces
    two = nearest(T, pressure * start[T.index]).forces / pressure
    assert np.abs(one - two).max() < 1e-9 * S.force_scale


@pytest.mark.parametrize("mu", [0.0, 0.5])
def test_one_contact_short_of_rigidity_fails_loudly(mu):
    """Without friction every contact of a jammed packing is needed; with it, some can be spared."""
    packing = packed(40, mu)
    failed = 0
    while not failed:
        S = ensemble(packing)
        strongest = S.index[np.argmax(S.original[:, 0])]
        keep = np.arange(len(packing.contacts.i)) != strongest
        contacts = packing.contacts.picked(keep)
        packing = packing._replace(contacts=contacts, forces=packing.forces[keep])
        try:
            T = ensemble(packing)
            packing = packing._replace(forces=T.expand(nearest_piqp(T, T.original).forces))
        except NotJammedError as error:
            assert "grain" in str(error)
            failed += 1
            continue
        assert mu > 0 and T.dimension < S.dimension
    whole = ensemble(packing, prune=False)
    for relax in (nearest_piqp, nearest):
        assert not relax(whole, whole.original).converged
    with pytest.raises(NotJammedError):
        walk(whole, 3, 0)


def test_a_gap_at_the_tolerance_opens_or_closes_a_contact():
    """Moved apart by less than the tolerance two grains still touch, by more they do not."""
    packing = packed(60, 0.3)
    i, j, shift = find_pairs(packing.x, packing.r, packing.cell, 1e-9)
    gap = separations(packing.x, packing.r, packing.cell, i, j, shift)[2]
    touching = np.flatnonzero(np.abs(gap) < 1e-10)
    c = touching[0]
    for move, seen in ((0.5e-9, True), (2e-9, False)):
        r = packing.r.copy()
        r[i[c]] -= move
        pairs = find_pairs(packing.x, r, packing.cell, 1e-9)
        listed = set(zip(pairs[0].tolist(), pairs[1].tolist(), strict=True))
        assert ((int(i[c]), int(j[c])) in listed) == seen


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    amplitude=st.floats(1e-9, 1e3),
    mu=st.sampled_from([0.001, 0.02, 0.3, 5.0]),
)
@example(seed=500, amplitude=64.0, mu=0.02)  # hard for regularised linear systems
def test_any_start_is_relaxed_into_s(seed, amplitude, mu):
    S = ensemble(packed(30, mu))
    start = np.random.default_rng(seed).normal(size=S.original.shape) * amplitude
    found = nearest_piqp(S, start)
    assert found.converged
    assert S.violation(found.forces) == pytest.approx(0, abs=1e-9)
    # Nearest: no admissible state on the way to the original is closer.
    ahead = found.forces + 1e-3 * (S.original - found.forces)
    assert np.linalg.norm(start - found.forces) <= np.linalg.norm(start - ahead) * (1 + 1e-9)


@pytest.mark.stress
@pytest.mark.parametrize("mu", [0.01, 0.3, 3.0])
def test_ten_thousand_steps_without_drift(mu):
    S = ensemble(packed(100, mu))
    done = walk(S, 10_000, 0)
    assert done.counts["rejected"] + done.counts["unconverged"] == 0
    early, late = done.residual[:1000].max(), done.residual[-1000:].max()
    assert late < 1e-10
    assert late < 100 * early
    centre = measures.mean_network(done.states)
    away = measures.distances(done.states, centre)
    assert away[-1000:].mean() < 3 * away[:1000].mean()


@pytest.mark.stress
@pytest.mark.parametrize("n", [3, 10, 30, 100, 1000, 3000])
def test_sizes(n):
    for seed in range(3 if n < 1000 else 1):
        try:
            assert_sound(pack(n, 0.2, seed))
        except NotJammedError:
            assert n == 3  # three disks need not jam before the box is as small as a disk


@pytest.mark.stress
@pytest.mark.parametrize("mu", [0.0, 1e-8, 1e-6, 1e-3, 0.1, 1.0, 30.0, 1e3])
@pytest.mark.parametrize("seed", range(4))
def test_friction_and_seeds(mu, seed):
    assert_sound(pack(150, mu, seed))
