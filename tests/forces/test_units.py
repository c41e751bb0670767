"""S and what follows from it depend neither on the units of length and force nor on directions."""

import numpy as np
import pytest
from packings import packed

import granforce as gf
from granforce.forces.nearest_piqp import nearest_piqp
from granforce.packing.scenes import BLOCKS, SCENES

# Factors of lengths and forces, and angles by which open boxes are turned.
UNITS = [
    *((1e-3, 1.0, 0.0), (1e3, 1e3, 0.0), (1e-6, 1e6, 0.0), (1e6, 1e-6, 0.0)),
    *((1e-10, 1e-20, 0.7), (1e10, 1.0, 2.1), (1.0, 1e-10, 4.0), (1.0, 1e10, 0.0)),
]
PACKINGS = [name for name in SCENES | BLOCKS if name not in ("many", "wall")]


def in_units(packing, length, force, angle):
    """The same packing in other units of length and force, turned if its box is open."""
    turn = np.eye(2)
    if not np.isfinite(packing.box).any():
        cos, sin = np.cos(angle), np.sin(angle)
        turn = np.array([[cos, sin], [-sin, cos]])
    c, shapes = packing.contacts, packing.shapes
    lengths = {
        name: getattr(c, name) * length
        for name in ("length", "gap", "arm_i", "arm_j", "levers")
        if getattr(c, name) is not None
    }
    if shapes is not None:
        shapes = shapes._replace(
            corners=shapes.corners @ turn * length,
            mass=shapes.mass * length**2,
            inertia=shapes.inertia * length**4,
        )
    load = np.column_stack([packing.load[:, :2] @ turn, packing.load[:, 2] * length]) * force
    other = packing._replace(
        x=packing.x @ turn * length,
        r=packing.r * length,
        box=packing.box * length,
        tilt=packing.tilt * length,
        contacts=c._replace(normal=c.normal @ turn, **lengths),
        forces=packing.forces * force,
        pressure=packing.pressure * force / length,
        load=load,
        shapes=shapes,
    )
    return other, turn


def results(packing, length, force, turn):
    """Results in units that do not depend on those of the packing."""
    S = gf.ensemble(packing)
    bounds, contact = gf.intervals(S), int(S.index[0])
    low, high = bounds.low[0, 0] / force, bounds.high[0, 0] / force
    yield "contacts", S.index
    yield "dimension", S.dimension
    yield "flat directions", S.flat_directions
    yield "low", bounds.low / force
    yield "high", bounds.high / force
    yield "certified", bounds.converged
    yield "limit loads", gf.limit_loads(S) / force
    start = 1.1 * S.original + 0.1 * S.force_scale
    yield "nearest", gf.nearest(S, start).forces / force
    yield "nearest by PIQP", nearest_piqp(S, start).forces / force
    yield "at rest", gf.rest(packing).at_rest
    if np.isfinite(high):
        middle = force * (0.3 * low + 0.7 * high)
        yield "pulled", gf.pull(S, contact, [middle]).states / force
        critical = gf.critical_force(S, contact)
        yield "critical force", np.array([critical.low, critical.high]) / force
    if S.has_pressure_row:
        yield "stress", gf.stress_outline(S, 8).support
    else:
        load = np.zeros_like(packing.load)
        load[np.isfinite(packing.load[:, 0]), :2] = force * np.array([1.0, 0.0]) @ turn
        yield "load factor", gf.load_factor(S, load).factor
    if packing.shapes is None:
        yield "contacts are certain", gf.margin(packing).certain


def assert_same_in_all_units(packing):
    own = list(results(packing, 1.0, 1.0, np.eye(2)))
    for length, force, angle in UNITS:
        other, turn = in_units(packing, length, force, angle)
        for (name, value), (_, new) in zip(own, results(other, length, force, turn), strict=True):
            np.testing.assert_allclose(
                np.asarray(new, dtype=float),
                np.asarray(value, dtype=float),
                rtol=1e-5,
                atol=1e-6,
                err_msg=f"{name} in units of {length:g} and {force:g}, turned by {angle:g}",
            )


@pytest.mark.parametrize("name", PACKINGS)
def test_scenes_have_the_same_results_in_all_units(name):
    assert_same_in_all_units(gf.scene(name))


@pytest.mark.parametrize("mu", [0.0, 0.3, 3.0])
def test_packings_have_the_same_results_in_all_units(mu):
    assert_same_in_all_units(packed(20, mu))


def test_a_tilted_cell_has_the_same_results_in_all_units():
    assert_same_in_all_units(gf.pack(16, 0.5, 1, box="isotropic"))
