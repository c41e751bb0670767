"""The smallest problems: one contact, one grain, one free contact, none."""

import numpy as np
import pytest
from packings import packed, two_disks

import granforce as gf
from granforce import measures
from granforce.cli.entry_point import main
from granforce.records import InputError, NotJammedError, make_contacts, make_packing
from granforce.study.kinds import slices


def pair(mu):
    """Two disks that loads press together, in the open."""
    r = np.full(2, 0.5)
    contact = make_contacts([0], [1], [[1.0, 0.0]], [1.0], r)
    load = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]
    box = [np.inf, np.inf]
    return make_packing([[0, 0], [1, 0]], r, box, contact, [[1.0, 0.0]], mu, load=load)


def lonely(box, **options):
    r = np.full(1, 0.5)
    none = make_contacts([], [], np.empty((0, 2)), [], r)
    return make_packing([[0.0, 0.0]], r, box, none, np.empty((0, 2)), 0.5, **options)


def one_free():
    packing = packed(20, 0.3)
    frozen = np.ones(len(packing.contacts.i), bool)
    S = gf.ensemble(packing)
    frozen[S.index[np.argmax(S.original[:, 0])]] = False
    return gf.ensemble(packing, frozen=frozen)


SMALL = {
    "one contact": lambda: gf.ensemble(pair(0.5)),
    "one frictionless contact": lambda: gf.ensemble(pair(0.0)),
    "one free contact": one_free,
    "two contacts": lambda: gf.ensemble(two_disks()),
    "two frictionless contacts": lambda: gf.ensemble(two_disks(), 0.0),
}


@pytest.fixture(scope="module", params=SMALL)
def S(request):
    return SMALL[request.param]()


def certain(S):
    """The only state of S, by a solver that nothing else here uses."""
    return S.to_forces(np.linalg.lstsq(S.A.toarray(), S.b, rcond=None)[0])


def test_one_point_is_found_by_everyone(S):
    assert S.dimension == 0
    only, start = certain(S), 2 * S.original + S.force_scale
    bounds = gf.intervals(S)
    assert bounds.converged
    found = {
        "walk": gf.walk(S, 3, 0).states,
        "billiard": gf.sample_uniform(S, 8).flat,
        "hit and run": gf.sample_uniform(S, 8, method="hit_and_run").flat,
        "lower": bounds.low,
        "upper": bounds.high,
        "nearest": gf.nearest(S, start).forces,
        "accelerated": gf.nearest(S, start).forces,
        "sweeps": gf.gauss_seidel(S, start).forces,
    }
    for name, states in found.items():
        expected = np.broadcast_to(only, states.shape)
        np.testing.assert_allclose(states, expected, atol=1e-7 * S.force_scale, err_msg=name)
    assert measures.eta1(found["walk"]) == pytest.approx(0.0, abs=1e-12)


def test_its_outline_and_its_limits_exist(S):
    assert gf.outline(S, np.stack([np.ones_like(S.original), S.original])).converged
    limit = gf.limit_loads(S)
    critical = gf.critical_force(S, S.index[0])
    assert 0 < critical.low <= limit[0] * (1 + 1e-9)
    assert gf.response(S, S.index[0], critical=critical).converged


def test_no_contact_asked_is_no_contact_answered(S):
    assert gf.intervals(S, []).converged and len(gf.intervals(S, []).low) == 0
    assert len(gf.limit_loads(S, [])) == 0


def all_frozen(prune):
    packing = packed(20, 0.3)
    return gf.ensemble(packing, frozen=np.ones(len(packing.contacts.i), bool), prune=prune)


def empty_slice():
    packing = packed(20, 0.3)
    return gf.ensemble(packing, frozen=slices.outside(packing, (0, 1e-9, 0, 1e-9)))


def without_scale():
    packing = packed(20, 0.3)
    return gf.ensemble(packing._replace(forces=0 * packing.forces, pressure=np.nan))


@pytest.mark.parametrize(
    "make, error, what",
    [
        (lambda: all_frozen(True), InputError, "no free contact"),
        (lambda: all_frozen(False), InputError, "no free contact"),
        (empty_slice, InputError, "no free contact"),
        (lambda: gf.ensemble(lonely([3, 3], pressure=1.0)), NotJammedError, "no contact"),
        (
            lambda: gf.ensemble(lonely([np.inf, np.inf], load=[[1.0, 0.0, 0.0]]), prune=False),
            NotJammedError,
            "no contact",
        ),
        (without_scale, InputError, "all forces are zero"),
        (lambda: measures.eta1(np.empty((0, 3, 2))), InputError, "nothing to measure"),
        (lambda: measures.eta2(np.empty((4, 0, 2))), InputError, "nothing to measure"),
        (lambda: measures.sampled_intervals(np.empty((0, 3, 2))), InputError, "nothing to measure"),
    ],
)
def test_nothing_to_explore_is_told_in_one_line(make, error, what):
    with pytest.raises(error, match=what) as caught:
        make()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("command", ["intervals", "limit-loads"])
def test_a_slice_without_contacts_ends_with_one_line(command, tmp_path, capsys):
    line = [command, "-n", "20", "--mu", "0.3", "--slice=0,1e-9,0,1e-9"]
    assert main([*line, "--cache", str(tmp_path)]) == 2
    assert "no free contact can carry a force" in capsys.readouterr().err


def test_a_contact_given_twice_is_refused():
    packing = packed(20, 0.3)
    c = packing.contacts
    # The second time from the other grain's side.
    turned = make_contacts(
        np.append(c.i, c.j[3]),
        np.append(c.j, c.i[3]),
        np.vstack([c.normal, -c.normal[3]]),
        np.append(c.length, c.length[3]),
        packing.r,
    )
    forces = np.vstack([packing.forces, packing.forces[3]])
    with pytest.raises(InputError, match=r"contacts 3 and .* are the same"):
        make_packing(packing.x, packing.r, packing.box, turned, forces, packing.mu, 1.0)
    assert len(two_disks().contacts.i) == 2  # two images of one disk are two contacts
