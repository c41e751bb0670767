"""Mutants of tables of forces and of photoelastic frames: refused in one line, or whole."""

import io
import warnings

import numpy as np
import pytest
from frames import file, frame
from mutants import refusals

from granforce.forces.knowledge import bounds_of
from granforce.packing.importers import read_known, read_measurement, read_pegs
from granforce.records import InputError

CONTACTS = 40
_rows = range(0, CONTACTS, 3)
MEASURED = "contact,f_n,f_t,sigma_n,sigma_t\n" + "\n".join(f"{c},1.5,,0.1," for c in _rows)
KNOWN = "contact,f_n,f_t_min,f_t_max\n" + "\n".join(f"{c},1.5,-0.25,0.25" for c in _rows)


def measured(source):
    forces, sigma = read_measurement(source).on(CONTACTS)
    assert forces.shape == sigma.shape == (CONTACTS, 2)
    assert not np.isinf(forces).any() and not np.any(sigma <= 0)


def known(source):
    bounds = bounds_of(read_known(source), CONTACTS)
    assert bounds.shape == (CONTACTS, 2, 2) and np.all(bounds[..., 0] <= bounds[..., 1])


def pegs(positions, adjacency):
    found = read_pegs(positions, adjacency, mu=0.5, reach=0.2)
    c, r = found.packing.contacts, found.packing.r
    assert np.all(np.isfinite(found.packing.forces)) and np.all(r > 0)
    assert np.all((c.i != c.j) & (np.minimum(c.i, c.j) >= 0) & (np.maximum(c.i, c.j) < len(r)))


def files():
    """{kind: (contents of its files, how they are read)}."""
    grains, rows, _ = frame(8, 0.5)
    pair = [file(lines).getvalue().encode() for lines in (grains, rows)]
    tables = {"measured": (MEASURED, measured), "known": (KNOWN, known)}
    made = {kind: ([text.encode()], read) for kind, (text, read) in tables.items()}
    return made | {"pegs": (pair, pegs)}


@pytest.mark.parametrize("kind, count", [("measured", 500), ("known", 500), ("pegs", 60)])
def test_mutants_are_refused_or_whole(kind, count):
    assert count / 20 < refusals(*files()[kind], count, 1)


@pytest.mark.stress
@pytest.mark.parametrize("kind", ["measured", "known", "pegs"])
@pytest.mark.parametrize("seed", range(100, 110))
def test_a_hundred_thousand_mutants_are_refused_or_whole(kind, seed):
    """3334 of each kind and seed."""
    assert 160 < refusals(*files()[kind], 3334, seed)


@pytest.mark.parametrize("number", ["1e19", "9223372036854775808", "1e100", "-1", "0.5"])
@pytest.mark.parametrize("text, read", [(MEASURED, measured), (KNOWN, known)])
def test_a_contact_that_is_no_whole_number_is_named_with_its_line(number, text, read):
    changed = text.replace("\n3,", f"\n{number},")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(InputError, match=r"line 3: contact is .* whole number, at least 0"):
            read(io.StringIO(changed))
