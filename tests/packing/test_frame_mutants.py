"""Damaged files of photoelastic frames are refused in one line, or taken as a whole frame."""

from functools import partial

import numpy as np
import pytest
from frames import file, frame, solved
from mutants import refusals
from packing.test_solved import mat, mat73

from granforce.packing.importers import read_pegs

KINDS = ("text", "blanks, walls", "solved", "solved, packed", "solved, 7.3")


def frames_of(kind):
    """Contents of the files of a frame."""
    grains, rows, _ = frame(16, noise=0.1)
    particles, _ = solved(16)
    text = [file(lines).getvalue().encode() for lines in (grains, rows)]
    blanks = [content.replace(b",", b" ") for content in text]
    if kind == "solved, 7.3":
        pytest.importorskip("h5py")
        return [mat73(particles).getvalue()]
    return {
        "text": text,
        "blanks, walls": blanks,
        "solved": [mat(particles).getvalue()],
        "solved, packed": [mat(particles, do_compression=True).getvalue()],
    }[kind]


def whole(found):
    """What is taken must be a packing throughout."""
    packing, c = found.packing, found.packing.contacts
    assert all(np.all(np.isfinite(array)) for array in (packing.x, packing.r, packing.forces, *c))
    assert np.all(packing.r > 0) and len(found.ids) == len(packing.r)
    assert np.all((c.i != c.j) & (np.minimum(c.i, c.j) >= 0))
    assert np.all(np.isnan(found.measured[:, 0]) | (found.sigma[:, 0] > 0))
    # The network may be none: told in its own mean force, what is left of nothing is large.
    mean = np.abs(packing.forces[:, 0]).mean() / found.report["mean_measured_normal_force"]
    assert packing.info["residual"] * mean < 1e-8


def mutants(kind, count, seed):
    """How many of so many mutants were refused."""
    options = {"walls": "circle"} if "walls" in kind else {}
    read = partial(read_pegs, mu=0.3, reach=0.2, **options)
    return refusals(frames_of(kind), read, count, seed, whole)


@pytest.mark.parametrize("kind", KINDS)
def test_mutants_are_refused_or_whole(kind):
    assert mutants(kind, 60, 1) > 5


@pytest.mark.stress
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(10, 20))
def test_ten_thousand_mutants_are_refused_or_whole(kind, seed):
    """1000 of each kind and seed."""
    assert mutants(kind, 1000, seed) > 100
