"""Factors of A K Aᵀ: what dense algebra gives, in every lane, with any number of global rows."""

import itertools
from itertools import pairwise

import numpy as np
import pytest
from numba import njit

from granforce.numerics import (
    cholesky,
    contact_matrix,
    contact_program,
    elimination,
    interior_point,
    lu,
)
from granforce.numerics.blocks import NO_PIVOT
from granforce.numerics.lanes import LANES, MANY, ONE, load

pytestmark = pytest.mark.fast

NEVER = np.zeros(1, dtype=bool)


@njit
def solved(network, K, diagonal, least, factors, x, y, stop, lanes):
    contact_matrix.begin(network, diagonal, factors, lanes)
    for c in range(len(network.high)):
        nn, nt, tt = load(K, 4 * c, lanes), load(K, 4 * c + 1, lanes), load(K, 4 * c + 3, lanes)
        contact_matrix.add(network, c, nn, nt, tt, factors, lanes)
    cholesky.factor(network, least, factors, stop, lanes)
    cholesky.solve(network, factors, x, y, lanes)


@njit
def solved_skew(network, K, diagonal, least, factors, x, y, stop, lanes):
    contact_matrix.begin(network, diagonal, factors, lanes)
    for c in range(len(network.high)):
        nn, nt = load(K, 4 * c, lanes), load(K, 4 * c + 1, lanes)
        tn, tt = load(K, 4 * c + 2, lanes), load(K, 4 * c + 3, lanes)
        contact_matrix.add_skew(network, c, nn, nt, tn, tt, factors, lanes)
    lu.factor(network, factors, stop, lanes)
    lu.solve(network, factors, x, y, lanes)


def random_network(rng, grains=30, contacts=70, borders=1):
    i, j = rng.integers(grains, size=(2, contacts))
    i, j = i[i != j], j[i != j]
    parts = rng.normal(size=(2, len(i), 3, 2))
    border = rng.normal(size=(len(i), borders, 2))
    network = contact_matrix.make_network(rng.random((grains, 2)), i, j, *parts, border)
    A = np.zeros((3 * grains + borders, 2 * len(i)))
    for c in range(len(i)):
        for grain, part in ((i[c], parts[0, c]), (j[c], parts[1, c])):
            place = 3 * network.layout.position[grain]
            A[place : place + 3, 2 * c : 2 * c + 2] = part
        A[3 * grains :, 2 * c : 2 * c + 2] = border[c]
    return network, A


@pytest.mark.parametrize("borders", [0, 1, 3])
@pytest.mark.parametrize("lanes", [ONE, MANY])
@pytest.mark.parametrize("symmetric", [True, False])
def test_factors_solve_what_dense_algebra_solves(symmetric, lanes, borders):
    rng = np.random.default_rng(1)
    network, A = random_network(rng, borders=borders)
    width, contacts, rows = len(lanes), len(network.high), len(A) - borders
    K = rng.normal(size=(width, contacts, 2, 2))
    K = K @ K.transpose(0, 1, 3, 2)
    if not symmetric:
        K += 0.3 * rng.normal(size=K.shape)
    x, y = rng.normal(size=(rows, width)), rng.normal(size=(borders, width))
    right = np.concatenate([x, y])
    diagonal = rng.uniform(0.5, 1.0, rows)
    factors = contact_matrix.make_factors(network, width, symmetric)
    flat = np.ascontiguousarray(K.reshape(width, -1).T)
    least = np.full(rows, NO_PIVOT)
    solver = solved if symmetric else solved_skew
    solver(network, flat, diagonal, least, factors, x, y, NEVER, lanes)
    for lane in range(width):
        dense = np.zeros((2 * contacts, 2 * contacts))
        for c in range(contacts):
            dense[2 * c : 2 * c + 2, 2 * c : 2 * c + 2] = K[lane, c]
        matrix = A @ dense @ A.T + np.diag(np.append(diagonal, np.zeros(borders)))
        expected = np.linalg.solve(matrix, right[:, lane])
        found = np.concatenate([x[:, lane], y[:, lane]])
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_one_grain_is_factored_as_worked_out_in_words():
    none = np.zeros(0, dtype=np.int64)
    parts = np.zeros((2, 0, 3, 2))
    network = contact_matrix.make_network(np.zeros((1, 2)), none, none, *parts, np.zeros((0, 0, 2)))
    factors = contact_matrix.make_factors(network, 1)
    factors.lower[:, 0] = [4, 2, 0, 2, 5, 4, 0, 4, 5]
    cholesky.factor(network, np.full(3, NO_PIVOT), factors, NEVER, ONE)
    assert factors.lower[[0, 3, 4, 6, 7, 8], 0].tolist() == [0.5, 1, 0.5, 0, 2, 1]


def test_a_lane_gives_what_it_gives_alone_bit_for_bit():
    rng = np.random.default_rng(2)
    network, A = random_network(rng)
    K = rng.normal(size=(LANES, len(network.high), 2, 2))
    K = (K @ K.transpose(0, 1, 3, 2)).reshape(LANES, -1).T
    diagonal, least = np.ones(len(A) - 1), np.full(len(A) - 1, NO_PIVOT)
    right = rng.normal(size=(len(A), LANES))
    results = []
    for lanes, columns in ((MANY, [slice(None)]), (ONE, [slice(k, k + 1) for k in range(LANES)])):
        for part in columns:
            factors = contact_matrix.make_factors(network, len(lanes))
            x, y = right[:-1, part].copy(), right[-1:, part].copy()
            own = np.ascontiguousarray(K[:, part])
            solved(network, own, diagonal, least, factors, x, y, NEVER, lanes)
            results.append(np.concatenate([x, y]))
    assert np.array_equal(results[0], np.concatenate(results[1:], axis=1))


def test_rows_that_follow_from_others_are_found():
    rng = np.random.default_rng(3)
    grains = 12
    i, j = np.arange(grains), (np.arange(grains) + 1) % grains
    # Unit forces ±1 on both grains: the rows of each direction add up to nothing.
    part = np.zeros((grains, 3, 2))
    part[:, 0, 0] = part[:, 1, 1] = 1.0
    network = contact_matrix.make_network(
        rng.random((grains, 2)), i, j, part, -part, np.zeros((grains, 0, 2))
    )
    rows, idle = np.zeros(3 * grains), np.tile([0.0, 0.0, 1.0], grains)
    problem = contact_program.make_problem(
        network, rows, rows[:0], idle, np.arange(3 * grains), np.ones(grains), 1e-11
    )
    out = interior_point.dependent_rows(problem, idle)
    assert out.sum() == 2
    found = contact_program.without_rows(problem, idle, out)
    assert np.array_equal(found.diagonal, np.where(out, 1.0, idle))


def dense_fill(pattern, pairs):
    """Lower fill of the elimination by the definition: neighbours of what goes are joined."""
    count = len(pattern.position)
    there = np.eye(count, dtype=bool)
    for a, b in pattern.position[pairs]:
        there[a, b] = there[b, a] = True
    for k in range(count):
        below = k + 1 + np.flatnonzero(there[k + 1 :, k])
        there[np.ix_(below, below)] = True
    return np.tril(there)


@pytest.mark.parametrize("grains", [1, 2, 5, 40])
def test_the_pattern_is_the_fill_of_its_order(grains):
    rng = np.random.default_rng(grains)
    pairs = rng.integers(grains, size=(2 * grains, 2))
    pattern = elimination.pattern(rng.random((grains, 2)), *pairs.T)
    assert sorted(pattern.position) == list(range(grains))
    there = np.zeros((grains, grains), dtype=bool)
    for k in range(grains):
        rows = pattern.row[pattern.start[k] : pattern.start[k + 1]]
        assert rows[0] == k and np.all(np.diff(rows) > 0)
        there[rows, k] = True
    assert np.array_equal(there, dense_fill(pattern, pairs))
    assert pattern.panel[0] == 0 and pattern.panel[-1] == grains
    number = 0
    for first, end in pairwise(pattern.panel):
        below = pattern.row[pattern.start[end - 1] + 1 : pattern.start[end]]
        for k in range(first, end):
            rows = pattern.row[pattern.start[k] : pattern.start[k + 1]]
            assert np.array_equal(rows, [*range(k, end), *below])
        for q, a in itertools.combinations_with_replacement(range(len(below)), 2):
            block = pattern.target[number]
            assert pattern.row[block] == below[a]
            assert pattern.start[below[q]] <= block < pattern.start[below[q] + 1]
            number += 1
    assert number == len(pattern.target)


def test_an_empty_pattern():
    nothing = np.zeros(0, dtype=np.int64)
    pattern = elimination.pattern(np.zeros((0, 2)), nothing, nothing)
    assert list(pattern.start) == list(pattern.panel) == [0] and not len(pattern.row)
