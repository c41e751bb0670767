"""The random campaign: no wrong number, nothing refused that can be done, nothing left uncertified.

30 small cases, a fifth of their stages each, run always; 300 with all of them with -m stress.
"""

import warnings

import campaign
import pytest


def judged(numbers, **options):
    """Faults of cases, as lines, and how many stages they went through."""
    lines, done = [], 0
    for number in numbers:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            found, stages = campaign.faults(number, **options)
        lines += [f"{number}: {' '.join(what)}" for what in found]
        done += stages
    return lines, done


@pytest.mark.parametrize("block", range(3))
def test_small_packings_stand(block):
    lines, done = judged(range(1000 + 10 * block, 1010 + 10 * block), most=12, every=5)
    assert not lines and done > 60


@pytest.mark.stress
@pytest.mark.parametrize("block", range(30))
def test_packings_of_every_kind_stand(block):
    lines, _ = judged(range(10 * block, 10 * block + 10))
    assert not lines, "\n".join(lines)
