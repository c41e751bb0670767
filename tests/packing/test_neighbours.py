"""The cell list against all pairs and all images."""

import numpy as np
import pytest

from granforce.packing.neighbours import find_pairs, separations


def every_pair(x, r, box, cutoff):
    """The same by brute force over three images each way."""
    found = set()
    shifts = [range(-3, 4) if np.isfinite(side) else [0] for side in box]
    sides = np.where(np.isfinite(box), box, 0.0)
    for i in range(len(r)):
        for j in range(i + 1, len(r)):
            for a in shifts[0]:
                for b in shifts[1]:
                    if np.hypot(*(x[j] + [a, b] * sides - x[i])) < r[i] + r[j] + cutoff:
                        found.add((i, j, a, b))
    return found


@pytest.mark.parametrize(
    "n, box",
    [
        (60, (14.0, 14.0)),
        (60, (40.0, 7.0)),
        (8, (3.1, 2.9)),
        (40, (np.inf, 9.0)),
        (40, (np.inf, np.inf)),
    ],
)
def test_all_pairs_are_found_once(n, box, rng):
    box = np.array(box)
    r = rng.uniform(0.3, 1.0, n)
    x = rng.uniform(-5, 15, (n, 2))
    x = np.where(np.isfinite(box), np.mod(x, np.where(np.isfinite(box), box, 1)), x)
    i, j, shift = find_pairs(x, r, box, 0.3)
    rows = list(zip(i, j, *shift.T, strict=True))
    assert len(rows) == len(set(rows))
    assert set(rows) == every_pair(x, r, box, 0.3)


def test_separations_follow_the_image(rng):
    box = np.array([5.0, np.inf])
    x = np.array([[0.2, 1.0], [4.9, 1.0]])
    r = np.array([0.3, 0.2])
    i, j, shift = find_pairs(x, r, box, 0.0)
    normal, length, gap = separations(x, r, box, i, j, shift)
    assert normal == pytest.approx(np.array([[-1.0, 0.0]]))
    assert length == pytest.approx([0.3])
    assert gap == pytest.approx([-0.2])
