"""The backbone: contacts that carry force, found from networks and proved by duality.

A contact belongs to the backbone if max f_n over S is positive. One network can show that it does;
only a proof can show that it does not. Networks are therefore tried first: a contact that presses
in any of them carries. The others are idle so far. Linear programs maximise their sum Σ f_n over S;
contacts that press in a solution carry and leave the sum, until the maximum is 0. The multipliers v
of the balance then prove this for all remaining contacts at once: with A y = b and y ≥ 0,

    Σ f_n = g·y = b·v + (g − Aᵀ v)·y ≤ b·v  where  Aᵀ v ≥ g,

and b·v = 0 to the tolerance of `certificates.proves_small`. As f_n ≥ 0, each of them is 0 in every
network. The words idle, dead, pressing and trusted are defined in docs/pages/method.md.
"""

from __future__ import annotations

import highspy
import numpy as np
from scipy import sparse

from granforce.forces import knowledge
from granforce.forces.ensemble import Ensemble
from granforce.forces.nearest import nearest, some_network
from granforce.numerics import certificates
from granforce.numerics import highs as programs
from granforce.records import NotJammedError, Packing, brief_list
from granforce.tolerances import ADMISSIBLE, CARRYING, INTERVAL_GAP, SEEN_CARRYING
from granforce.types import Floats, Integers, Mask


def without_danglers(packing: Packing, unfrozen: Integers, frozen: Mask) -> Integers:
    """Drop, one after another, contacts of unloaded grains that have no other contact.

    unfrozen: numbers of contacts, of which the remaining ones are returned. Grains of a frozen
    contact count as loaded, by its force.
    """
    i, j = packing.contacts.i, packing.contacts.j
    count = len(packing.r)
    loaded = np.any(packing.load != 0, axis=1)
    loaded[i[frozen]] = loaded[j[frozen]] = True
    while True:
        ends = np.concatenate([i[unfrozen], j[unfrozen]])
        lonely = (np.bincount(ends, minlength=count) == 1) & ~loaded
        keep = ~(lonely[i[unfrozen]] | lonely[j[unfrozen]])
        if keep.all():
            return unfrozen
        unfrozen = unfrozen[keep]


def carrying(full: Ensemble) -> tuple[Mask, Floats | None]:
    """Mask of contacts whose largest f_n over S is positive, exactly; and a network, or None.

    Contacts that press in a known network carry. Known networks are the original one, or the one
    nearest to equal f_n, and one that is pulled towards forces on contacts that had none. Contacts
    of grains that cannot balance any force carry nothing. Linear programs over S decide the others.
    The proof that a contact carries nothing is by duality and does not depend on the known
    networks.
    """
    known = full.original
    if not full.admits(known):
        known = some_network(full, np.zeros_like(known))
    trusted = full.admits(known)
    if not trusted and full.known is not None:
        _raise_contradiction(full)
    idle = np.ones(len(known), np.bool_)
    dead = ~idle
    if trusted:
        idle = known[:, 0] <= SEEN_CARRYING * full.force_scale
        dead = idle & cannot_balance(full, idle)
        idle = not_pulled(full, known, idle & ~dead)
    at_hand = known if trusted else None
    return ~(dead | proven_idle(full, idle, at_hand)), at_hand


def _raise_contradiction(full: Ensemble) -> None:
    """Raise NotJammedError that names the conflicting conditions, if the conflict can be proved."""
    assert full.known is not None
    A, b, T = full.scaled_balance
    message = knowledge.contradiction(
        *(A, b, T, full.known, full.slopes, full.index, full.force_scale, full.slack), full.friction
    )
    if message is not None:
        raise NotJammedError(message)


def not_pulled(full: Ensemble, known: Floats, idle: Mask) -> Mask:
    """The idle contacts that press in none of the networks pulled towards them.

    Each network is pulled towards forces on all contacts that have not pressed before.
    """
    while idle.any():
        target = known.copy()
        target[idle, 0] += full.force_scale
        pulled = nearest(full, target).forces
        pressing = idle & (pulled[:, 0] > SEEN_CARRYING * full.force_scale)
        if not pressing.any() or not full.admits(pulled):
            break
        idle = idle & ~pressing
    return idle


def cannot_balance(full: Ensemble, idle: Mask) -> Mask:
    """Mask of idle contacts that even their own grains alone cannot balance: local, exact.

    Grains whose contacts are all idle must balance; all others may exert any force.
    """
    size = full.per_grain
    c = full.contacts
    held_up = np.zeros(len(full.packing.r), bool)
    held_up[c.i[~idle]] = held_up[c.j[~idle]] = True
    held_up |= np.any(full.packing.load != 0, axis=1)
    held_up[full.packing.contacts.i[full.frozen]] = True
    held_up[full.packing.contacts.j[full.frozen]] = True
    rows = np.repeat(~held_up[full.grains], size)
    columns = np.repeat(idle, full.per_contact)
    if not rows.any():
        return np.zeros(len(idle), np.bool_)
    A, T = full.cone_form
    local = A[: len(rows)].tocsr()[rows][:, columns]
    normal = sparse.csr_matrix(T)[:: full.per_contact][idle][:, columns]
    model = programs.standard_form(local, np.zeros(local.shape[0]), upper=1.0)
    dead, everyone = np.zeros(len(idle), bool), np.ones(int(idle.sum()), bool)
    proved = _never_pressing(model, local, np.zeros(local.shape[0]), normal, everyone)
    if proved is not None:
        dead[idle] = proved
    return dead


def _never_pressing(
    model: highspy.Highs, A: sparse.csr_matrix, b: Floats, normal: sparse.csr_matrix, idle: Mask
) -> Mask | None:
    """The idle contacts that carry nothing in {y ≥ 0 : A y = b}; None if undecided.

    normal (contacts, n): f_n = normal · y. Contacts that press in the solution with the largest Σ
    f_n are removed repeatedly; the multipliers of the last program prove that the others cannot
    press.
    """
    while idle.any():
        gains = normal.T @ idle.astype(float)
        programs.set_cost(model, -gains)
        pressing = None
        for status, y in programs.solutions(model):
            if status != programs.OPTIMAL:
                continue
            pressing = idle & (normal @ y > SEEN_CARRYING)
            if pressing.any():
                break
            if certificates.proves_small(A, b, gains, -programs.multipliers(model, A, -gains)):
                return idle
            pressing = idle & (normal @ y > CARRYING)
        if pressing is None:
            return None
        # Nothing is called idle without a proof.
        idle = idle & ~pressing if pressing.any() else np.zeros(len(idle), bool)
    return idle


def proven_idle(full: Ensemble, idle: Mask, known: Floats | None) -> Mask:
    """The idle contacts whose sum, and therefore each of them, is 0 everywhere in S.

    known (N_c, 2): a network of S, or None.
    """
    if not idle.any():
        return idle
    A, b, T = full.scaled_form
    # Without load or pressure S is a cone: contacts that carry in it also carry in a bounded part.
    limits = [np.inf if b.any() else 1.0]
    if known is not None:
        # The same holds in an unbounded S near any of its networks: part of the way to any other
        # network is also in S.
        limits.append(1.0 + float(full.coordinates(known).max()))
    normal_rows = sparse.csr_matrix(T)[:: full.per_contact]
    for limit in limits:
        model = programs.standard_form(A, b, upper=limit, solver="ipm")
        model.setOptionValue("run_crossover", "off")  # no vertex is wanted
        proved = _never_pressing(model, A, b, normal_rows, idle)
        if proved is not None:
            return proved
    if known is not None:
        return idle  # feasible within BALANCED but not exactly: no more contacts are known to carry
    raise certificates.why_unsolved(A, b, _unbalanced_message(full), slack=full.slack)


def _unbalanced_message(full: Ensemble) -> str:
    A, _ = full.cone_form
    _, rest = programs.least_unbalanced(A, full.b / full.force_scale)
    size = full.per_grain
    load = np.linalg.norm(rest[: size * len(full.grains)].reshape(-1, size), axis=1)
    worst = np.argsort(load)[::-1][:5]
    carries = ""
    if full.prescribed == "stress":
        carries = (
            "the contacts cannot carry this stress (`granforce stress`, gf.stress_outline and "
            "gf.admissible_stress say which they can), or "
        )
    least = min(INTERVAL_GAP, 0.5 * load.max(initial=0.0))  # rounding of the program
    named = ", ".join(f"{full.grains[k]} ({load[k]:.2g} ⟨f_n⟩)" for k in worst if load[k] > least)
    pulling = np.flatnonzero(full.original[:, 0] < -ADMISSIBLE * full.force_scale)
    if len(pulling):
        carries += (
            f"forces pull on contact{'s' if len(pulling) > 1 else ''} "
            f"{brief_list(full.index[pulling])}, and contacts can only press, or "
        )
    return (
        f"no admissible force network exists: {carries}the packing is not jammed, friction is "
        "too small, or contacts are missing; grains with the largest unbalanced load: "
        f"{named or 'none'}"
    )
