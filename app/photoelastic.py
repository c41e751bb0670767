"""Photoelastic frames that a visitor brings: measured beside inferred forces, as plain arrays."""

from typing import NamedTuple

import numpy as np

from granforce.packing import importers

from . import uploads
from .limits import LIMITS


class Frame(NamedTuple):
    """A frame and the admissible network that its measurement speaks for; forces in ⟨f_n⟩."""

    source: str  # which files it came from, in words
    report: dict  # of importers.read_pegs
    x: np.ndarray  # (N, 2) centres
    r: np.ndarray  # (N,) radii
    ends: np.ndarray  # (N_c, 2) grains of each contact
    measured: np.ndarray  # (N_c, 2) f_n, f_t; NaN for contacts that were added
    inferred: np.ndarray  # (N_c, 2)
    added: np.ndarray  # (N_c,) bool
    at_wall: np.ndarray  # (N,) bool, grains at walls, whose balance is not asked for
    left_open: np.ndarray  # (N,) bool, other grains whose balance had to be left open


def infer(files, *, mu, reverse=False):
    """Work, for jobs.Task, that reads a frame and finds its likeliest network; a Frame.

    files: {role: (name, content)}; mu, reverse: as for `importers.read_pegs`.
    """

    def work(job):
        LIMITS.check(mu=mu)
        job.begin("looking for forces that balance the grains, near the measured ones")
        opened = (uploads.opened(*files[part]) for part in ("positions", "adjacency"))
        found = importers.read_pegs(*opened, mu=mu, reverse=reverse, most_grains=LIMITS.n)
        return _frame(found, " and ".join(name for name, _ in files.values()))

    return work


def _frame(found, names):
    packing, unit = found.packing, found.report["mean_measured_normal_force"]
    left_open = np.zeros(len(packing.r), dtype=bool)
    left_open[found.left_open] = True
    return Frame(
        f"{uploads.FAMILIES['pegs'][0]}: {names}",
        found.report,
        packing.x,
        packing.r,
        np.column_stack([packing.contacts.i, packing.contacts.j]),
        found.measured / unit,
        packing.forces / unit,
        found.added,
        found.at_wall & ~left_open,
        left_open,
    )


def account(report):
    """What was found, what was done, and what that leaves open: sentences with the numbers."""
    count = report.get
    yield (
        f"Listed are {count('contacts_listed')} contacts of {count('grains')} grains. "
        f"{count('grains_at_walls')} grains are at walls: what a wall does to them was not "
        "measured, so their balance is not asked for."
    )
    for key, words in DOUBTS:
        if report[key]:
            yield f"{report[key]} {words}"
    if report["unbalance_saved_if_tangential_forces_were_reversed"] > REVERSED:
        yield (
            "If all tangential forces had the other sign, grains would be nearer to balance: "
            "programs differ there, try the switch."
        )
    yield (
        f"On the listed contacts alone, no admissible forces balance "
        f"{count('unbalanced_on_listed_contacts')} of the inner grains. {count('candidates')} "
        "pairs that are about as near joined as contacts that were not measured."
    )
    yield _left(report)
    yield (
        "The admissible network nearest to the measurement differs from it by "
        f"{count('mean_change_of_f_n'):.2f} ⟨fₙ⟩ in fₙ and {count('mean_change_of_f_t'):.2f} ⟨fₙ⟩ "
        f"in fₜ on average; {count('candidates_that_carry')} of the added contacts carry in it. "
        "It is one of many: what was not measured may be otherwise. The standard error of "
        f"{count('error'):.2f} ⟨fₙ⟩ was not measured either: it is the one that explains how far "
        "the measured forces are from balance."
    )


DOUBTS = (
    ("listed_twice_with_other_forces", "contacts are listed twice with different forces: the mean "
     "was taken, the difference counts as an error."),
    ("negative_normal_forces", "measured normal forces are negative, where contacts can only "
     "press."),
    ("beyond_friction", "measured tangential forces are larger than friction allows at this μ."),
)  # fmt: skip
REVERSED = 0.05  # part of the unbalance, from which on the sign of f_t is doubted
NAMED = 12  # grains that are named


def _left(report):
    names = report["left_open"]
    if not names:
        return (
            "With them every inner grain is balanced: apart from the walls nothing was left open."
        )
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return (
        f"With them {len(names)} inner grains still cannot be balanced, by "
        f"{report['unbalance']:.2g} ⟨fₙ⟩ in sum: their balance was left open "
        f"(grains {', '.join(map(str, names[:NAMED]))}{more})."
    )
