"""The force network of an imported packing: given or computed, checked, and reported."""

from __future__ import annotations

from typing import Any

import numpy as np

from granforce.forces.balance import left_open_in, mean_load
from granforce.forces.build import ensemble
from granforce.forces.ensemble import Ensemble
from granforce.forces.hull import dimension_of
from granforce.forces.nearest import nearest
from granforce.numerics.highs import least_unbalanced
from granforce.packing.assemblies import larger_tolerance
from granforce.packing.closing import apart, margin
from granforce.packing.importers.geometry import gain_by_reversing, overlapping
from granforce.packing.importers.notes import with_notes
from granforce.records import InputError, NotJammedError, Packing, UndecidedError, takes
from granforce.system.wording import counted
from granforce.tolerances import CARRYING, NO_EQUILIBRIUM, RIGID_OVERLAP, ROUNDING
from granforce.types import Floats, Integers

# Unbalance of the loads of an open set, in ⟨f_n⟩, that is attributed to digits lost in the file and
# removed, since S would be empty otherwise.
LOAD_MISFIT = 1e-3
# Gap in largest radii below which pairs that are no contacts are named if nothing balances.
MISSED = 0.01
# Fraction of the unbalance that reversing f_t must remove for a note.
WORTH_REVERSING = 0.5


def with_given_forces(packing: Packing, *, reverse: bool = False, **info: Any) -> Packing:
    """The packing with the pressure (or, in an open box, the boundary loads) of its forces.

    P = Σ f_n ℓ / (2V); a grain's load balances its contact forces, unless loads were given.
    reverse: change the sign of tangential forces. Residual and violation are added to
    packing.info with the given entries, and notes if the forces are clearly no equilibrium, or the
    other sign balances better. Raises InputError if the forces do not press.
    """
    if reverse:
        packing = packing._replace(forces=packing.forces * [1, -1])
    normal = packing.forces[:, 0]
    if not np.any(normal > 0):
        raise InputError("no contact presses; check the sign of the normal forces")
    c, load = packing.contacts, packing.load[:, :2]
    inner = np.isfinite(load.sum(axis=1))
    gain = gain_by_reversing((c.i, c.j, c.normal), packing.forces, np.nan_to_num(load), inner)
    notes = [*packing.info.get("notes", []), *info.get("notes", [])]
    if gain > WORTH_REVERSING:
        notes.append(worth_reversing(gain, reverse))
    if np.isfinite(packing.volume):
        virial = float(normal @ packing.contacts.length)
        if virial <= 0:
            raise InputError(f"the forces are tensile (Σ f_n ℓ = {virial:.3g}); check their sign")
        packing = packing._replace(pressure=virial / (2 * packing.volume))
    elif not packing.load.any():
        packing = packing._replace(load=_left_over(packing))
    verdict = accuracy_of(packing)
    if gain <= WORTH_REVERSING and verdict["residual"] > NO_EQUILIBRIUM:
        notes.append(
            f"the forces do not balance the grains, by up to {verdict['residual']:.2g} ⟨f_n⟩: "
            "check whether f_n and f_t have the same unit, whether f_t has the sign described in "
            "the documentation, and whether contacts or loads are missing"
        )
    if verdict["violation"] > NO_EQUILIBRIUM:
        notes.append(
            f"the forces violate f_n ≥ 0 or |f_t| ≤ μ f_n by up to {verdict['violation']:.2g} "
            f"⟨f_n⟩: check μ = {packing.mu:g}, the sign of f_n, and whether f_n and f_t have the "
            "same unit"
        )
    info |= {"notes": notes} if notes else {}
    return packing._replace(info={**packing.info, **info, **verdict})


def with_edge(packing: Packing, advice: str = "") -> Packing:
    """The open packing with a note on grains that their contacts do not balance."""
    off = np.abs(packing.load).max(axis=1) > LOAD_MISFIT * packing.forces[:, 0].mean()
    if not off.any():
        return packing
    note = (
        f"contacts do not balance {off.sum()} of {len(off)} grains: what is left over counts as a "
        f"load on them, which makes the residual 0{advice}"
    )
    return with_notes(packing, [note])


def refuse_idle_reverse(forces: Floats, reverse: bool) -> None:
    """InputError if reversing the sign of f_t is requested and all f_t of forces (…, 2) are 0."""
    normal, tangential = np.moveaxis(np.abs(np.nan_to_num(forces)), -1, 0)
    if reverse and tangential.max(initial=0.0) <= ROUNDING * normal.max(initial=0.0):
        raise InputError(
            "--reverse (reverse=True) has no effect, as every tangential force is 0: leave it out"
        )


def worth_reversing(gain: float, reverse: bool) -> str:
    """A note on forces that balance better by this fraction with the other sign of f_t."""
    change = "leave out --reverse" if reverse else "give --reverse"
    return (
        "the forces do not balance the grains, probably because tangential forces have the other "
        f"sign, which takes away {gain:.0%} of the unbalance: {change} (reverse={not reverse}); "
        "the packing has the forces as read"
    )


def alone(packing: Packing, count: int, forces: Floats, **info: Any) -> Packing:
    """The first `count` bodies under the forces of all others and of contacts left open.

    forces (N_c, 2): a network of all contacts in which those bodies stay at rest. It becomes their
    own network, and the unbalance of each body its load; the loads fix the sum Σ f_n ℓ, so that S
    is bounded. Lengths are in the largest radius of these bodies, as in compacted packings. Raises
    InputError if the network does not press.
    """
    c, unit = packing.contacts, packing.r[:count].max()
    inner = (c.i < count) & (c.j < count)
    c = c._replace(
        **{name: getattr(c, name) / unit for name in ("length", "gap", "arm_i", "arm_j")}
    )
    # Without this, noise on grains that carry nothing could not be balanced.
    carrying = forces[:, :1] > CARRYING * np.abs(forces[:, 0]).mean()
    forces = np.where(carrying, forces, 0.0)
    return with_given_forces(
        packing._replace(
            x=packing.x[:count] / unit,
            r=packing.r[:count] / unit,
            contacts=c.picked(inner),
            forces=forces[inner],
            load=np.zeros((count, 3)),
        ),
        **info,
    )


def with_nearest_network(packing: Packing, **info: Any) -> Packing:
    """The packing with the admissible force network nearest to equal normal forces.

    Needs a pressure, or loads in an open box; rounding errors in the balance of the loads are
    corrected (info["load_change"]). Raises NotJammedError if no network exists.
    """
    if not len(packing.contacts.i):
        raise NotJammedError("no grains touch; check the radii, or raise the tolerance")
    if np.isnan(packing.pressure):
        packing, S = _under_loads(packing)
    else:
        try:
            S = ensemble(packing)
        except NotJammedError as error:
            raise NotJammedError(f"{error}{_missed_pairs(packing)}") from None
    start = np.zeros_like(S.original)
    start[:, 0] = S.force_scale
    relaxed = nearest(S, start)
    if not relaxed.converged:
        raise NotJammedError(
            f"no force network was found: residual {relaxed.residual:.2g} ⟨f_n⟩ after "
            f"{relaxed.iterations} iterations; check that the packing is at rest"
        )
    packing = packing._replace(forces=S.expand(relaxed.forces))
    return packing._replace(info={**packing.info, **info, **accuracy_of(packing)})


@takes(Packing)
def report(packing: Packing) -> dict[str, Any]:
    """Properties of a packing, as plain numbers.

    Parameters
    ----------
    packing : Packing
        The packing.

    Returns
    -------
    dict
        grains: those whose balance is required; grains_left_open: all others, such as walls.
        backbone_grains: grains that can carry force; rattlers: grains that cannot. Lengths are in
        largest radii (`Packing.r`), residual and violation of the packing's own network in ⟨f_n⟩.
        mean_normal_force: ⟨f_n⟩ (`Ensemble.force_scale`), in the packing's unit like the pressure.
        largest_contact_gap, least_other_gap: the `margin` of its contacts, undefined for soft disks
        (overlaps beyond 10⁻⁵ of the largest radius) and for bodies of other shapes. Quantities that
        are undefined are None.

    Raises
    ------
    NotJammedError
        If no admissible network exists.
    """
    ens = ensemble(packing)
    loaded = bool(packing.forces.any())
    verdict = accuracy_of(packing) if loaded else {"residual": None, "violation": None}
    closed = np.isfinite(packing.volume)
    left_open = int(left_open_in(packing).sum())
    return {
        "grains": len(packing.r) - left_open,
        "grains_left_open": left_open,
        "contacts": len(packing.contacts.i),
        "backbone_grains": len(ens.grains),
        "backbone_contacts": len(ens.index),
        "rattlers": ens.skipped["rattlers"],
        "mu": packing.mu,
        "pressure": None if np.isnan(packing.pressure) else packing.pressure,
        "packing_fraction": packing.packing_fraction if closed else None,
        "coordination": float(ens.coordination),
        "dimension": dimension_of(ens),
        "mean_normal_force": float(ens.force_scale) if loaded else None,
        "residual": verdict["residual"],
        "violation": verdict["violation"],
        "largest_overlap": _largest_overlap(packing),
        **_margin(packing),
    }


def accuracy_of(packing: Packing) -> dict[str, Any]:
    """Residual and violation of the packing's own forces.

    Without pruning, so that they exist for any network, even if S is empty.
    """
    whole = ensemble(packing, prune=False)
    return {
        "residual": whole.residual(packing.forces),
        "violation": whole.violation(packing.forces),
    }


def _pressed_grains(whole: Ensemble) -> Integers:
    """Grains on which the packing's own network presses by more than its noise."""
    pressing = whole.original[:, 0] > CARRYING * whole.force_scale
    return np.union1d(whole.contacts.i[pressing], whole.contacts.j[pressing])


def _margin(packing: Packing) -> dict[str, float | None]:
    soft = packing.contacts.gap.min(initial=0.0) < -RIGID_OVERLAP * packing.r.max()
    apart = None if soft or packing.shapes is not None else margin(packing)
    return {
        "largest_contact_gap": apart and apart.contact,
        "least_other_gap": apart and apart.other,
    }


def _largest_overlap(packing: Packing) -> float:
    if packing.shapes is None:
        gap = overlapping(packing.x, packing.r, packing.cell)[2]
    else:
        gap = packing.contacts.gap
    return float(max(0.0, -gap.min(initial=0.0)) / packing.r.max())


def _left_over(packing: Packing) -> Floats:
    """Loads (N, 3) that balance every grain under the packing's own contact forces.

    All contacts with force are included, not only those with a large unbalance: then the network is
    in S to rounding, even where rigid lever arms do not add up to the centre distance. Rattlers get
    no load, because noise on them need not lie in any cone.
    """
    whole = ensemble(packing, prune=False)
    rest = (whole.A @ whole.to_vector(packing.forces)).reshape(len(whole.grains), -1)
    load = np.zeros((len(packing.r), 3))
    load[whole.grains, : rest.shape[1]] = -rest
    load[:, 2] *= packing.r
    load[np.setdiff1d(whole.grains, _pressed_grains(whole))] = 0.0
    return load


def _under_loads(packing: Packing) -> tuple[Packing, Ensemble]:
    """The packing of an open set, and its ensemble.

    Loads are brought into balance to rounding if S is otherwise empty or undecided.

    Lever arms meet midway: with a_i + a_j = ℓ the balance of all grains implies that of the loads,
    while arms that differ from ℓ by a gap would require one particular Σ gap f_t.
    """
    if not packing.load.any():
        raise InputError(
            "an open set needs loads (columns fx, fy, torque of the grains) or forces (columns "
            "f_n, f_t of the contacts), or walls and gravity (--walls floor --gravity 1, or "
            "walls=, gravity=); a periodic one its box"
        )
    contacts, r = packing.contacts, packing.r
    contacts = contacts._replace(
        arm_i=r[contacts.i] + contacts.gap / 2, arm_j=r[contacts.j] + contacts.gap / 2
    )
    forces = np.zeros_like(packing.forces)
    forces[:, 0] = mean_load(packing)  # the scale of tolerances
    packing = packing._replace(contacts=contacts, forces=forces)
    settled = _with_balanced_loads(packing)  # first, as it refuses loads that no forces balance
    try:
        return packing, ensemble(packing)
    except (NotJammedError, UndecidedError):
        return settled, ensemble(settled)


def _missed_pairs(packing: Packing) -> str:
    """Words on pairs that may be contacts: their number and smallest gap."""
    gap = apart(packing, MISSED)[2] / packing.r.max()
    if not len(gap):
        return ""
    pairs = counted(len(gap), "pair nearly touches", "pairs nearly touch")
    words = f"; {pairs}, with gaps from {gap.min():.2g} of the largest radius"
    listed = "tolerance" not in packing.info
    return f"{words}, but are not listed as contacts" if listed else larger_tolerance(words)


def _few_touch(packing: Packing) -> str:
    """A hint at different units of centres and radii, if most grains touch no other grain."""
    grain = ~left_open_in(packing)  # no wall
    pairs = np.stack([packing.contacts.i, packing.contacts.j])
    touching, n = len(np.unique(pairs[:, grain[pairs].all(axis=0)])), int(grain.sum())
    if 2 * touching >= n:
        return ""
    return f"; only {touching} of {n} grains touch another: do x, y and r have the same unit?"


def _with_balanced_loads(packing: Packing) -> Packing:
    """The packing with the loads nearest to its own that contact forces can balance.

    info["load_change"] is the largest change, in ⟨f_n⟩.
    """
    whole = ensemble(packing, prune=False)
    rest = least_unbalanced(whole.cone_form[0], whole.b / whole.force_scale)[1]
    rest = rest.reshape(len(whole.grains), -1)
    unbalanced = np.abs(rest).max(axis=1)
    if unbalanced.max() > LOAD_MISFIT:
        worst = np.argsort(-unbalanced, kind="stable")[:5]
        worst = worst[unbalanced[worst] > LOAD_MISFIT]
        named = ", ".join(str(whole.grains[k]) for k in worst)
        total = ", ".join(f"{value:.3g}" for value in np.nansum(packing.load[:, :2], axis=0))
        walls = ""
        if len(packing.walls) == 1:
            walls = "; only one wall is given: do grains need side walls (--walls box, or walls=)?"
        elif not left_open_in(packing).any():
            walls = "; if walls hold the grains, give them (--walls floor, or walls=)"
        raise NotJammedError(
            f"no forces balance the loads, whose sum is ({total}); correct loads, contacts or "
            f"friction; the largest unbalance is at grains {named} (counted from 0){walls}"
            f"{_few_touch(packing)}{_missed_pairs(packing)}"
        )
    load = packing.load.copy()
    unit = np.column_stack([np.ones((len(whole.grains), 2)), packing.r[whole.grains]])
    width = rest.shape[1]
    load[whole.grains, :width] -= whole.force_scale * rest * unit[:, :width]
    change = {"load_change": float(unbalanced.max())}
    return packing._replace(load=load, info={**packing.info, **change})
