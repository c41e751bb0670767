"""Where resultants can pass at the joints of bodies: against another solver and random networks."""

import numpy as np
import pytest
from scipy.optimize import linprog

import granforce as gf
from granforce.explore.thrust import thrust


@pytest.fixture(scope="module")
def S():
    return gf.ensemble(gf.scene("arch", voussoirs=7, thickness=0.15))


def test_the_ends_are_those_of_programs_scaled_to_a_joint_force_of_1(S):
    """After Charnes and Cooper (1962): forces y = F/N and 1/N, so that the position is linear."""
    found, count = thrust(S), len(S.index)
    assert len(found.low) == 8 and found.gap.max() < 1e-6
    A = S.A.toarray()
    cones = np.zeros((2 * count, 2 * count + 1))
    for c in range(count):
        cones[2 * c : 2 * c + 2, 2 * c : 2 * c + 2] = [[-S.mu, 1], [-S.mu, -1]]
    for (a, b), low, high in zip(found.contacts, found.low, found.high, strict=True):
        of_joint = np.zeros(2 * count + 1)
        of_joint[[2 * a, 2 * b]] = 1.0
        position = np.zeros(2 * count + 1)
        position[2 * b] = 1.0
        equal = np.vstack([np.column_stack([A, -S.b]), of_joint])
        right = np.append(np.zeros(len(S.b)), 1.0)
        bounds = [*[(0, None), (None, None)] * count, (0, None)]
        for sign, end in ((1, low), (-1, high)):
            program = linprog(sign * position, cones, np.zeros(2 * count), equal, right, bounds)
            assert sign * program.fun == pytest.approx(end, abs=1e-6)


def test_every_line_of_thrust_lies_within(S):
    found, forces = thrust(S), gf.walk(S, 50, seed=0).states[..., 0]
    a, b = (forces[:, found.contacts[:, k]] for k in (0, 1))
    part = b / (a + b)
    assert np.all((part >= found.low - 1e-6) & (part <= found.high + 1e-6))
    assert np.all(np.ptp(part, axis=0) > 0.2 * (found.high - found.low))


def test_the_thinnest_arch_that_stands_touches_its_faces_at_five_places():
    """Outer, inner, outer, inner, outer, as Heyman's semicircular arch; 24 voussoirs."""
    thinnest = 0.107096436
    with pytest.raises(gf.NotJammedError):
        gf.scene("arch", 0.8, voussoirs=24, thickness=thinnest - 1e-6)
    S = gf.ensemble(gf.scene("arch", 0.8, voussoirs=24, thickness=1.0005 * thinnest))
    found = thrust(S)
    a, b = (S.packing.contact_points[S.index[found.contacts[:, k]]] for k in (0, 1))
    outward = np.hypot(*b.T) > np.hypot(*a.T)
    depth = (
        np.where(outward, found.low, 1 - found.high),
        np.where(outward, found.high, 1 - found.low),
    )
    angle = np.degrees(np.arctan2(a[:, 0], a[:, 1]))
    touching = {
        "inner": sorted(angle[depth[0] < 1e-6].round(1)),
        "outer": sorted(angle[depth[1] > 1 - 1e-6].round(1)),
    }
    assert touching == {"inner": [-52.5, 52.5], "outer": [-90.0, 0.0, 90.0]}
    assert np.max(depth[1] - depth[0]) < 2e-3  # one line, almost
