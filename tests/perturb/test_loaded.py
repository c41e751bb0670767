"""Networks under a force pair on one contact, judged by balance and by the limit load."""

import numpy as np
import pytest
from packings import packed

from granforce.explore.intervals import limit_loads
from granforce.forces.build import ensemble
from granforce.forces.nearest import starting_network
from granforce.perturb.critical_force import critical_force
from granforce.perturb.loaded import loaded_networks
from granforce.records import InputError

pytestmark = pytest.mark.fast


@pytest.mark.parametrize("mu", [0.1, 1])
def test_networks_balance_loads_up_to_the_critical_force_and_lines_between_them_do(mu):
    S = ensemble(packed(30, mu))
    pair = np.zeros((len(S.index), 2))
    for position in range(0, len(S.index), 12):
        contact = S.index[position]
        low = critical_force(S, contact).low
        found = loaded_networks(S, contact, np.linspace(0, low, 5))
        assert np.allclose(found.states[0], starting_network(S), atol=1e-8 * S.force_scale)
        pair[:] = 0
        pair[position, 0] = 1
        between = (found.states[1:] + found.states[:-1]) / 2
        for states, loads in (
            (found.states, found.loads),
            (between, (found.loads[1:] + found.loads[:-1]) / 2),
        ):
            assert np.all(S.residual(states + loads[:, None, None] * pair) <= 1e-10)
            assert np.all(S.violation(states) <= 1e-9)
        assert np.all(found.residual <= 1e-10) and np.all(found.violation <= 1e-9)


def test_no_other_network_under_the_load_is_nearer():
    """Not even that in which contact dynamics comes to rest."""
    S = ensemble(packed(30, 0.3))
    start = starting_network(S)
    for position in range(0, len(S.index), 15):
        critical = critical_force(S, S.index[position])
        (found,) = loaded_networks(S, S.index[position], [critical.low]).states
        near, far = (np.linalg.norm(forces - start) for forces in (found, critical.forces))
        assert 0 < near <= far * (1 + 1e-9)


def test_loads_above_the_limit_load_are_refused():
    S = ensemble(packed(30, 0.3))
    limit = limit_loads(S)
    with pytest.raises(InputError, match="above its limit load"):
        loaded_networks(S, S.index[4], [0.5 * limit[4], 1.01 * limit[4]])
    with pytest.raises(InputError, match="not one of the"):
        loaded_networks(S, 10**6, [0.1])
