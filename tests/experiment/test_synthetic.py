"""Synthetic frames: what is put in is what is there, and what inference says of it is right."""

import numpy as np
import pytest
from packings import packed

from granforce.experiment.pegs import read_pegs
from granforce.experiment.remeasured import remeasured
from granforce.experiment.synthetic import synthetic_frame
from granforce.forces.build import ensemble
from granforce.packing.scenes import scene
from granforce.records import InputError

pytestmark = pytest.mark.fast


@pytest.mark.parametrize("walls", [True, False])
def test_without_errors_the_truth_comes_back(walls):
    frame = synthetic_frame(packed(60, 0.3), noise=0.0, walls=walls)
    found = read_pegs(frame, mu=0.3, reach=0, error=0.1 * frame.unit)
    assert found.report["unbalanced"] == 0 and not found.findings
    assert (found.report["walls"] == "open") != walls
    true = frame.truth(found)
    inner = np.isfinite(true[:, 0])
    assert np.abs(found.packing.forces - true)[inner].max() < 1e-6 * frame.unit
    assert np.mean(frame.forces[:, 0]) == pytest.approx(frame.unit, rel=0.2)


def test_errors_are_those_that_were_asked_for():
    P = packed(100, 0.3)
    clean, noisy = (synthetic_frame(P, noise=s, walls=False) for s in (0.0, 0.2))
    off = (noisy.only.forces - clean.only.forces) / clean.unit
    assert off.std() == pytest.approx(0.2, rel=0.1) and abs(off.mean()) < 0.03
    pairs = len(clean.pairs)
    fewer = synthetic_frame(P, missed=0.3, walls=False)
    assert len(fewer.only.ends) == 2 * (pairs - round(0.3 * pairs))
    more = synthetic_frame(P, false=0.1, walls=False)
    assert len(more.only.ends) == 2 * (pairs + round(0.1 * pairs))
    # Weak contacts are missed first.
    listed = {tuple(sorted(ends)) for ends in fewer.only.ends.tolist()}
    gone = np.array([tuple(pair) not in listed for pair in fewer.pairs.tolist()])
    assert fewer.forces[gone, 0].mean() < fewer.forces[~gone, 0].mean()
    blurred = synthetic_frame(P, blur=0.05)
    assert np.std(blurred.only.r / clean.only.r) == pytest.approx(0.05, rel=0.3)
    assert np.array_equal(noisy.only.forces, synthetic_frame(P, noise=0.2, walls=False).only.forces)


def test_a_frame_in_files_is_the_same(tmp_path):
    frame = synthetic_frame(packed(40, 0.3), noise=0.1, walls=False, number=4)
    paths = tmp_path / "positions.txt", tmp_path / "adjacency.txt"
    frame.write(*paths)
    one = read_pegs(*paths, mu=0.3, reach=0.1, repair=0.5)
    two = read_pegs(frame, mu=0.3, reach=0.1, repair=0.5)
    assert one.report["frame"] == two.report["frame"] == 4
    assert one.report["contacts_listed"] == two.report["contacts_listed"]
    with pytest.raises(InputError, match="is frame 4"):
        read_pegs(frame, mu=0.3, frame=5)


def test_what_does_not_fit_is_said():
    """χ² is its degrees of freedom where all is right, more where the friction is too small, and
    contacts that were made wrong are suspects."""
    frame = synthetic_frame(packed(100, 0.3), noise=0.1, walls=False)
    sigma = 0.1 * frame.unit / np.sqrt(2)
    ratio = {}
    for mu in (0.3, 0.1):
        found = read_pegs(frame, mu=mu, reach=0.05, error=sigma, repair=0.5)
        S = ensemble(found.packing)
        m = found.measured[S.index]
        drawn = remeasured(S, m, sigma, states=2, chains=1)
        ratio[mu] = drawn.chi_square / drawn.freedom
        if mu == 0.3:
            wrong = np.flatnonzero(np.isfinite(m[:, 0]))[::60]
            m = m.copy()
            m[wrong, 0] -= 6 * frame.unit  # no force fits: none is below 0
            told = remeasured(S, m, sigma, states=2, chains=1).suspects
            assert set(S.index[wrong]) <= set(told.tolist())
    assert 0.7 < ratio[0.3] < 1.4 < ratio[0.1]


@pytest.mark.filterwarnings("error")
def test_what_is_wrong_is_told():
    packing = packed(20, 0.3)
    wrong = [{"noise": -1}, {"missed": 1.0}, {"blur": np.nan}, {"pixels": 0}, {"seed": -1}]
    wrong += [{name: size} for name in ("pixels", "newton") for size in (1e308, 1e-308)]
    for options in (*wrong, {"noise": 1e200}):
        with pytest.raises(InputError):
            synthetic_frame(packing, **options)
    with pytest.raises(InputError, match="for disks only"):
        synthetic_frame(scene("ladder"))
    with pytest.raises(InputError, match="no forces to measure"):
        synthetic_frame(packing._replace(forces=0 * packing.forces))
