"""The force network of an imported packing: taken as given or found, judged, and reported."""

import numpy as np

from granforce.ensemble import ensemble
from granforce.neighbours import find_pairs, separations
from granforce.records import InputError, NotJammedError
from granforce.relax.nearest import nearest

# External loads of an open set may miss balance by this part of their mean: rounding in the file,
# spread over the loaded grains; S would be empty otherwise.
LOAD_MISFIT = 1e-3


def adopt(packing, **info):
    """The packing with the pressure (or, in an open box, the boundary loads) its forces carry.

    P = Σ f_n ℓ / (2V); a grain's load is what its contact forces leave over, unless loads were
    given. Residual, violation and rattlers go to packing.info, beside the given entries.
    Raises InputError where the forces do not press.
    """
    normal = packing.forces[:, 0]
    if not np.any(normal > 0):
        raise InputError("no contact presses; check the sign of the normal forces")
    if np.isfinite(packing.volume):
        virial = float(normal @ packing.contacts.length)
        if virial <= 0:
            raise InputError(f"the forces pull (Σ f_n ℓ = {virial:.3g}); check their sign")
        packing = packing._replace(pressure=virial / (2 * packing.volume))
    elif not packing.load.any():
        packing = packing._replace(load=_left_over(packing))
    return packing._replace(info={**packing.info, **info, **_judged(packing)})


def find(packing, **info):
    """The packing with the admissible force network nearest to equal normal forces.

    Needs a pressure, or loads in an open box. Raises NotJammedError where no network exists.
    """
    if np.isnan(packing.pressure):
        packing = _with_settled_loads(packing)
        guess = np.hypot(*packing.load[:, :2].T).sum() / max(1, np.count_nonzero(packing.load))
    else:
        guess = packing.pressure * packing.r.max()
    uniform = np.zeros_like(packing.forces)
    uniform[:, 0] = guess or 1.0
    packing = packing._replace(forces=uniform)
    S = ensemble(packing)
    start = np.zeros_like(S.original)
    start[:, 0] = S.force_scale
    relaxed = nearest(S, start)
    if not relaxed.converged:
        raise NotJammedError(
            f"no force network was found: residual {relaxed.residual:.2g} ⟨f_n⟩ after "
            f"{relaxed.iterations} iterations; check that the packing is at rest"
        )
    packing = packing._replace(forces=S.expand(relaxed.forces))
    return packing._replace(info={**packing.info, **info, **_judged(packing)})


def report(packing, ens=None):
    """What a packing is, as a dict of plain numbers (None where a quantity is not defined).

    ens: the packing's ensemble if known. Lengths in largest radii, residual and violation of the
    packing's own network in ⟨f_n⟩, mean normal force (over the backbone) and pressure in the
    packing's units. Raises NotJammedError where no admissible network exists.
    """
    ens = ensemble(packing) if ens is None else ens
    loaded = bool(packing.forces.any())
    judged = _judged(packing) if loaded else {"residual": None, "violation": None}
    closed = np.isfinite(packing.volume)
    return {
        "grains": len(packing.r),
        "contacts": len(packing.contacts.i),
        "backbone_grains": len(ens.grains),
        "backbone_contacts": len(ens.index),
        "rattlers": len(packing.r) - len(ens.grains),
        "friction": packing.mu,
        "pressure": None if np.isnan(packing.pressure) else packing.pressure,
        "packing_fraction": packing.packing_fraction if closed else None,
        "coordination": float(ens.coordination),
        "dimension": int(ens.dimension),
        "mean_normal_force": float(ens.original[:, 0].mean()) if loaded else None,
        "residual": judged["residual"],
        "violation": judged["violation"],
        "largest_overlap": _largest_overlap(packing),
    }


def _judged(packing):
    """Residual and violation of the packing's own forces on all its contacts.

    Without pruning, so that it can be said of any network, also where S is empty.
    """
    whole = ensemble(packing, prune=False)
    return {
        "residual": whole.residual(packing.forces),
        "violation": whole.violation(packing.forces),
        "rattlers": whole.skipped["rattlers"],
    }


def _largest_overlap(packing):
    x, r, box = packing.x, packing.r, packing.box
    i, j, shift = find_pairs(x, r, box, 0.0)
    gap = separations(x, r, box, i, j, shift)[2]
    return float(max(0.0, -gap.min(initial=0.0)) / r.max())


def _left_over(packing):
    """Loads (N, 3) that balance every grain under the packing's own contact forces.

    All of them, not only the large ones: then the network lies in S to rounding, and what rigid
    lever arms lack of the centre distance stays consistent.
    """
    whole = ensemble(packing, prune=False)
    rest = (whole.A @ whole.to_vector(packing.forces)).reshape(len(whole.grains), -1)
    load = np.zeros((len(packing.r), 3))
    load[whole.grains, : rest.shape[1]] = -rest
    load[:, 2] *= packing.r
    return load


def _with_settled_loads(packing):
    """Lever arms that meet midway and loads that balance as a whole, to rounding.

    With a_i + a_j = ℓ the balance of all grains implies that of the loads; arms that miss ℓ by a
    gap would instead demand a particular Σ gap f_t.
    """
    contacts, r = packing.contacts, packing.r
    contacts = contacts._replace(
        arm_i=r[contacts.i] + contacts.gap / 2, arm_j=r[contacts.j] + contacts.gap / 2
    )
    loaded = np.flatnonzero(packing.load.any(axis=1))
    if not len(loaded):
        raise InputError(
            "an open set needs loads (columns fx, fy, torque of the grains) or forces "
            "(columns fn, ft of the contacts); a periodic one its box"
        )
    unit = r.max()
    load = packing.load[loaded] / [1.0, 1.0, unit]
    arm = (packing.x[loaded] - packing.x[loaded].mean(axis=0)) / unit
    total = np.zeros((3, len(loaded), 3))  # force, force, torque of all from the load on each
    total[0, :, 0] = total[1, :, 1] = total[2, :, 2] = 1.0
    total[2, :, 0], total[2, :, 1] = -arm[:, 1], arm[:, 0]
    # A periodic direction has no centre to turn about.
    total = total[: 3 if np.all(np.isinf(packing.box)) else 2].reshape(-1, load.size)
    correction = np.linalg.lstsq(total, total @ load.ravel())[0].reshape(load.shape)
    scale = np.abs(load).max(axis=1).mean()
    if np.abs(correction).max() > LOAD_MISFIT * scale:
        rest = ", ".join(f"{value:.3g}" for value in total @ load.ravel())
        raise InputError(
            f"the loads do not balance: their sums (fx, fy, torque/r) are {rest}; correct them"
        )
    settled = packing.load.copy()
    settled[loaded] = (load - correction) * [1.0, 1.0, unit]
    return packing._replace(contacts=contacts, load=settled)
