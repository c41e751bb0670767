"""The random campaign: no wrong number, and nothing refused that has a network at hand.

10 small cases, a fifth of their stages each, run always, 20 more with -m slow; 300 with all of them
with -m stress. There a stage may, rarely, say that it reached no certificate, but never state
anything false.
"""

import warnings

import campaign
import pytest

# Part of all stages that may end undecided: most do at μ < 10⁻⁶, μ > 10³, or where S is a point.
UNDECIDED = 0.02


def judged(numbers, **options):
    """Faults of cases, as lines; those that say they are undecided; how many stages were seen."""
    wrong, undecided, done = [], [], 0
    for number in numbers:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            found, stages = campaign.faults(number, **options)
        for what in found:
            told = any(word in what[2] for word in campaign.UNDECIDED)
            (undecided if told else wrong).append(f"{number}: {' '.join(what)}")
        done += stages
    return wrong, undecided, done


@pytest.mark.parametrize(
    "block", [0, *(pytest.param(block, marks=pytest.mark.slow) for block in (1, 2))]
)
def test_small_packings_stand(block):
    wrong, undecided, done = judged(range(1000 + 10 * block, 1010 + 10 * block), most=12, every=5)
    assert not wrong and not undecided and done > 40  # packings of too few disks are refused


@pytest.mark.parametrize("make", [campaign.floor, campaign.parts])
def test_floors_and_bodies_of_parts_stand(make):
    wrong, undecided, done = judged(range(3), make=make, every=4)
    assert not wrong and not undecided and done > 30


@pytest.mark.slow
@pytest.mark.parametrize("make", [campaign.floor, campaign.parts])
def test_many_floors_and_bodies_of_parts_stand(make):
    wrong, undecided, done = judged(range(100, 130), make=make)
    assert not wrong, "\n".join(wrong)
    assert len(undecided) <= UNDECIDED * done, "\n".join(undecided)


@pytest.mark.parametrize("number", [7, 8, 13, 21])
def test_tables_of_total_forces_give_the_packing_back(number):
    campaign.total_forces(campaign.case(number, most=40))


@pytest.mark.parametrize("number", [3, 100, 118, 276])
def test_what_fell_stands(number):
    """Pressures where S is a point; unbalanced states; a bounded S called unbounded; a ranking
    ended by one open bound."""
    wrong, undecided, _ = judged([number])
    assert not wrong and not undecided


@pytest.mark.stress
@pytest.mark.parametrize("block", range(10))
def test_packings_of_every_kind_stand(block):
    wrong, undecided, done = judged(range(30 * block, 30 * block + 30))
    assert not wrong, "\n".join(wrong)
    assert len(undecided) <= UNDECIDED * done, "\n".join(undecided)
