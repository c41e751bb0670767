"""Sets that known bounds make thin: one answer to whether a direction is pinned, from all who ask.

Bounds on components of the force that are independent in S cut a box out of it, or a slab whose
section is S with those components at one value: volumes and marginals are known in closed form.
They must hold down to widths of a few FLAT, and all must call a direction pinned below it.
"""

import json

import numpy as np
import pytest
from bodies import distance_to_marginals
from packings import packed
from scipy import linalg, stats

import granforce as gf
from granforce.cli.entry_point import main

# In ⟨f_n⟩, and for f_t in μ ⟨f_n⟩.
WIDTHS = 1e-3, 1e-7, 9e-9, 1e-10, 3e-12
BELOW = 5e-13, 1e-15


@pytest.fixture(scope="module")
def S():
    return gf.ensemble(packed(10, 0.3, 3))


@pytest.fixture(scope="module")
def centre(S):
    return gf.sample_uniform(S, 200).flat.mean(axis=0)


def slopes(S, components):
    """Gradients (k, h) of components (contact, 0 or 1) in orthonormal coordinates of the hull."""
    null = linalg.null_space(S.A.toarray(), rcond=1e-9)
    return null[[2 * c + k for c, k in components]]


def independent(S, kinds=(0, 1)):
    """h components of these kinds whose gradients are as independent as any."""
    every = [(c, k) for c in range(len(S.index)) for k in kinds]
    order = linalg.qr(slopes(S, every).T, mode="r", pivoting=True)[1]
    return [every[k] for k in order[: S.dimension]]


def banded(S, centre, components, widths):
    """S with bounds so far apart, force, around the centre on components."""
    low, high = np.full((2, len(S.index), 2), [[[-np.inf]], [[np.inf]]])
    for place, width in zip(components, widths, strict=True):
        low[place], high[place] = centre[place] - 0.5 * width, centre[place] + 0.5 * width
    return gf.ensemble(S.packing, known=gf.Known(S.index, low, high))


def lengths(K, components):
    """Lengths of the exact intervals of components, force."""
    found = gf.intervals(K)
    assert found.converged
    return np.array([found.high[place] - found.low[place] for place in components])


def given_widths(S, components, width):
    return width * S.force_scale * np.array([1.0, S.mu])[[k for _, k in components]]


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("kinds", [(0,), (0, 1)])
def test_as_many_bands_as_dimensions_cut_out_a_box(S, centre, width, kinds):
    """Its volume, its uniform marginals, and its exact bounds, of widths from `width` upwards."""
    components = independent(S, kinds)
    widths = given_widths(S, components, width * np.linspace(1, 3, S.dimension))
    K = banded(S, centre, components, widths)
    assert K.dimension == S.dimension > 2 and K.flat_directions == 0
    assert lengths(K, components) == pytest.approx(widths, rel=1e-15 / width + 1e-6)
    found, sample = gf.volume(K, accuracy=0.1), gf.sample_uniform(K, 200)
    box = np.log(widths / S.force_scale).sum() - np.linalg.slogdet(slopes(S, components))[1]
    assert found.dimension == sample.walls.dimension == S.dimension
    assert found.reached and abs(found.log_volume - box) < 4 * found.error
    assert sample.reached and sample.residual.max() < 1e-14
    along = np.stack([sample.states[..., c, k] - centre[c, k] for c, k in components], axis=-1)
    distance = distance_to_marginals(along / widths + 0.5, [stats.uniform.cdf] * len(widths))
    assert distance.max() < 2.0  # 1 in 1500


@pytest.mark.parametrize("width", WIDTHS)
def test_one_band_leaves_its_section_times_its_width(S, centre, width):
    (component,) = independent(S)[:1]
    widths = given_widths(S, [component], width)
    slab, section = (banded(S, centre, [component], [w]) for w in (*widths, 0.0))
    assert slab.dimension == section.dimension + 1 == S.dimension
    assert slab.flat_directions == section.flat_directions == 0  # of exactly one value
    found, cut = gf.volume(slab), gf.volume(section)
    thickness = widths[0] / S.force_scale / np.linalg.norm(slopes(S, [component]))
    error = np.hypot(found.error, cut.error)
    assert abs(found.log_volume - cut.log_volume - np.log(thickness)) < 4 * error + width


@pytest.mark.parametrize("width", BELOW)
@pytest.mark.parametrize("narrow", [1, 3, 5])
def test_narrower_bands_are_pinned_for_all(S, centre, width, narrow):
    components = independent(S)
    h = S.dimension - narrow
    widths = given_widths(S, components, np.array([width] * narrow + [1e-3] * h))
    K = banded(S, centre, components, widths)
    assert (K.dimension, K.flat_directions) == (h, narrow)
    assert lengths(K, components)[:narrow].max() < 1e-12 * K.force_scale
    sample = gf.sample_uniform(K, 80)
    assert gf.volume(K, accuracy=0.3).dimension == sample.walls.dimension == h
    for c, k in components[:narrow]:
        assert np.isnan(sample.mixing.r_hat[c, k])
        assert np.ptp(sample.flat[:, c, k]) < 1e-12 * K.force_scale


@pytest.mark.parametrize("width", [*WIDTHS, *BELOW])
def test_bounds_of_two_contacts_that_leave_little_between_them(width):
    """S is a segment: f_n of one contact bounds it from one side, that of another from the other.

    No component has two bounds; only balance tells how near they are.
    """
    S = gf.ensemble(packed(6, 0.3, 1))
    centre = gf.sample_uniform(S, 80).flat.mean(axis=0)
    slope = slopes(S, [(c, 0) for c in range(len(S.index))])[:, 0]
    up, down = int(np.argmax(slope)), int(np.argmin(slope))
    length = width / min(
        slope[up], -slope[down]
    )  # no bound is nearer than `width` to the other end
    ends = [0.5 * length * S.force_scale, -0.5 * length * S.force_scale] * slope[[up, down]]
    high = np.column_stack([centre[[up, down], 0] + ends, [np.inf] * 2])
    K = gf.ensemble(S.packing, known=gf.Known(S.index[[up, down]], -np.inf, high))
    found, sample = gf.volume(K), gf.sample_uniform(K, 80)
    h = int(width > 1e-12)
    assert K.dimension == found.dimension == sample.walls.dimension == h
    assert K.flat_directions == 1 - h
    # Rounding of the balance, 10⁻¹⁶ ⟨f_n⟩, moves either end.
    assert abs(found.log_volume - h * np.log(length)) <= 4 * found.error + h * 1e-15 / width
    assert np.isfinite(sample.mixing.r_hat).any() == bool(h)


def test_commands_say_what_is_pinned(tmp_path, capsys):
    """Bounds 9·10⁻⁹ ⟨f_n⟩ apart leave all dimensions, and bounds nearer than FLAT take one."""
    packing = packed(8, 0.3, 2)
    S = gf.ensemble(packing)
    gf.save_packing(packing, tmp_path / "p.npz")
    c, middle = S.index[0], float(gf.sample_uniform(S, 40).flat[:, 0, 0].mean())
    told = {}
    for width in (9e-9, 5e-13):
        bounds = middle, middle + width * S.force_scale
        (tmp_path / "k.csv").write_text(
            "contact,f_n_low,f_n_high\n{},{!r},{!r}\n".format(c, *bounds)
        )
        for command in ("uniform", "volume", "intervals", "walk"):
            arguments = [command, str(tmp_path / "p.npz"), "--json"]
            arguments += ["--known", str(tmp_path / "k.csv"), "--cache", str(tmp_path / "cache")]
            assert main(arguments) == 0
            told[width, command] = json.loads(capsys.readouterr().out)
    for (width, _), lines in told.items():
        pinned = width < 1e-12
        assert lines["dimension"] == S.dimension - pinned
        assert lines.get("directions_taken_as_pinned", 0) == pinned
        assert lines.get("as_narrower_than") == (1e-12 if pinned else None)
