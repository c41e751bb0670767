"""Records of the public interface: equality, declared fields, and warnings about results."""

import pydoc
import warnings

import numpy as np
import pytest
from packings import packed

import granforce as gf
from granforce.docs import hooks
from granforce.fields import fields
from granforce.labelled import table, to_dataset
from granforce.quantities import QUANTITIES
from granforce.records import ResultWarning
from granforce.study.bounds import intervals_dataset
from granforce.study.schema import VARIABLES


def test_records_are_equal_if_their_fields_are():
    p = packed(8, 0.3)
    q = p._replace(x=p.x.copy(), info=dict(p.info), contacts=p.contacts._replace(i=p.contacts.i))
    assert p == q and not p != q and p.contacts == q.contacts
    assert p != p._replace(x=p.x + 1e-16 + 1.0) and p != p._replace(mu=0.4) and p != "p"
    assert p == tuple(p) and p != p._replace(x=p.x[:-1])
    open_one = gf.scene("groove", mu=0.5)
    assert np.isnan(open_one.pressure) and open_one == gf.scene("groove", mu=0.5)
    S = gf.ensemble(p)
    assert gf.intervals(S) == gf.intervals(S) and gf.walk(S, 2) == gf.walk(S, 2, seed=0)
    assert gf.walk(S, 2) != gf.walk(S, 2, seed=1)


def test_a_sample_that_cannot_be_relied_on_warns_where_it_was_drawn():
    S = gf.ensemble(packed(20, 0.3))
    assert S.dimension
    with pytest.warns(ResultWarning, match="unreliable: .*; draw more states") as told:
        sample = gf.sample_uniform(S, 10)
    assert len(told) == 1 and told[0].filename == __file__ and not sample.reached
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert gf.sample_uniform(S, 2000).reached


def test_every_result_says_if_it_is_not_what_was_requested():
    S = gf.ensemble(packed(20, 0.3))
    volume = gf.volume(S, accuracy=1.0)
    assert volume.reached and not volume.shortfall
    assert "standard error" in volume._replace(reached=False).shortfall
    critical = gf.critical_force(S, int(S.index[0]), precision=0.5)
    assert not critical.shortfall
    assert "not steady" in critical._replace(converged=False).shortfall
    measured, sigma = S.original, np.full_like(S.original, S.force_scale)
    with pytest.warns(ResultWarning, match="error bars are unreliable"):
        gf.infer(S, measured, sigma, states=8)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gf.infer(S, measured, sigma)


def test_a_field_reads_the_same_wherever_it_is_shown():
    S = gf.ensemble(gf.scene("groove", 0.5))
    bounds = gf.intervals(S)
    field = fields(gf.Intervals)["low"]
    assert field.text in pydoc.render_doc(gf.Intervals, renderer=pydoc.plaintext)
    labelled, stored = gf.to_dataset(bounds, S)["low"], intervals_dataset(S, bounds)["low"]
    assert labelled.attrs == stored.attrs == {"units": field.unit, "long_name": field.long_name}
    assert labelled.dims == stored.dims == VARIABLES["low"].dims == tuple(field.dims.split())
    assert f"| `low` | contact, component | force | {field.meaning}; " in hooks.library()


def test_stored_fields_of_records_are_quantities():
    names = set()
    for name in gf.__all__:
        kind = getattr(gf, name)
        for field in fields(kind).values() if isinstance(kind, type) else ():
            names |= {field.stored}
            if field.stored and not field.each:
                assert field.dims == QUANTITIES[field.stored].dims
    assert {"x", "states", "interval_gap", "critical_low", "expected"} < names
    assert names <= QUANTITIES.keys() | {""}


def test_a_unit_is_that_of_the_field_and_not_read_from_a_name():
    S = gf.ensemble(packed(12, 0.3))
    forces = np.array(S.original)
    frame = table(to_dataset(forces, S).rename(states="length [km]"))
    assert "f_n_length [km] [packing]" in frame
