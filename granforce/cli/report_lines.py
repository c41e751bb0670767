"""The lines of reports: which there are, in which order, their meaning, and where they are stored.

Nothing here needs NumPy: `--help` reads this file.
"""

import textwrap
from typing import NamedTuple

from granforce.quantities import FORCE, QUANTITIES
from granforce.system.wording import spaced


class Line(NamedTuple):
    """A line of a report."""

    meaning: str
    stored: str = ""  # the stored quantity with its value; empty if it is computed for the report
    reduced: str = ""  # how an array becomes one number: max, mean or sum
    unit: str = ""  # FORCE: in the packing's unit, reported in that of --unit
    nonzero: str = ""  # a stored quantity: the line is left out where it is zero


# The largest number of contacts that a report on exact results lists.
FEW = 30
# By names as in --json, of lines that are not quantities of the store, or say more or else; a text
# alone: the meaning of a line that is computed for the report.
_LINES: dict[str, str | Line] = {
    "determined_contacts": "contacts with the same force in all networks",
    "undetermined_clusters": "connected groups of undetermined contacts",
    "position_of_f_n_in_tenths": "number of undetermined contacts whose original f_n is in the "
    "first, …, last tenth of its interval",
    "again": "of these, solved a second time, with refined steps or by HiGHS",
    "expected_reduction": "estimated fraction by which the mean standard error of f_n decreases "
    "once this f_n is known, from covariances",
    "reduction": "fraction by which the mean interval of f_n of all contacts, including this one, "
    "shortens if its value is the mean of the samples, by exact bounds; undefined beyond --check",
    "mean_interval_after": "mean length of the intervals of f_n once this one is known (its own is "
    "then 0)",
    "twins": "other contacts whose f_n is determined by that of this contact; the file of --out "
    "gives how many there are (number_of_twins)",
    "normal_difference_from_to": "range of (σ_xx − σ_yy)/2P that the contacts can carry",
    "shear_stress_from_to": "range of σ_xy/P that the contacts can carry",
    "admissible_stress": "a stress well inside these ranges, to copy into --stress",
    # of a packing
    "grains": "disks or bodies required to be in equilibrium (backbone and rattlers)",
    "grains_left_open": "all grains whose equilibrium is not required",
    "bodies": "bodies required to be in equilibrium",
    "contacts": "number of contacts",
    "backbone_grains": "grains that can carry force",
    "backbone_contacts": "contacts that can carry force",
    "pressure": Line("pressure P0; undefined in an open packing", "pressure"),
    "coordination": Line(
        "mean number z of contacts of a backbone grain, including those with walls; "
        "walls and rattlers do not count as grains",
        "coordination",
    ),
    "mean_normal_force": Line(
        "mean normal force ⟨f_n⟩: weighted by the distance between centres if "
        "the pressure is prescribed, otherwise the plain mean of the original network",
        "force_scale",
        unit=FORCE,
    ),
    "residual": Line("largest unbalanced force on a grain, in units of ⟨f_n⟩", "residual"),
    "violation": Line("largest violation of Coulomb's law, in units of ⟨f_n⟩", "violation"),
    "largest_overlap": "largest overlap of two bodies, in units of the largest radius",
    "largest_contact_gap": "largest gap of a contact, in units of the largest radius",
    "least_other_gap": "smallest gap between grains not in contact, in units of the largest radius "
    "(0.1 if it is larger)",
    "steps": "time steps of the compaction",
    "sweeps_done": "Gauss–Seidel sweeps in these steps",
    "at_rest": "whether contact dynamics, solved to machine precision, leaves the packing at rest "
    "under its own forces, also with noise on them",
    "distance_to_rest": "largest change of a force before contact dynamics, solved to machine "
    "precision, comes to rest, in units of ⟨f_n⟩",
    "reason": "why it is not at rest",
    "noise": "standard deviations of the noise on every force, in units of ⟨f_n⟩",
    "draws_at_rest": "draws that came to rest, for each of these",
    "draws": "draws of noise for each of these",
    "wedged_grains": "grains that can press on each other without a load",
    "scene": "name of the scene",
    "timestep": "time step of the snapshot",
    "time": "time of the snapshot",
    "contacts_skipped": "contacts in the file that carry no force",
    "contacts_with_walls": "contacts between a disk and a wall",
    "walls": "end points x, y, x, y of each wall",
    # of results
    "entry": "name of the result in the store",
    "cached": "whether the result was already in the store",
    "states": Line("number of states", "states"),
    "exact_eta3": Line("η3 of the exact intervals; undefined if some are infinite", "eta3"),
    "mean_iterations": Line("mean number of iterations of a relaxation", "sweeps", "mean"),
    "largest_residual": Line(
        "largest unbalanced force on a grain, in units of ⟨f_n⟩", "residual", "max"
    ),
    "largest_violation": Line(
        "largest violation of Coulomb's law, in units of ⟨f_n⟩", "violation", "max"
    ),
    "mean_distance_to_centre": Line(
        "mean distance of states from the centre, in units of ⟨f_n⟩", "distance_to_centre", "mean"
    ),
    "mean_extent_of_f_n": Line("mean length of the interval of f_n", unit=FORCE),
    "largest_extent_of_f_n": Line("length of the longest interval of f_n", unit=FORCE),
    "contacts_with_unbounded_f_n": "contacts whose f_n has no upper bound, as grains are wedged; "
    "not in the mean and largest extent",
    "contacts_with_unbounded_f_t": "contacts whose f_t has no bound on one or both sides",
    "contacts_not_certified": "contacts with values that could not be certified (nan), in an "
    "unbounded S",
    "f_n_low": "smallest f_n of this contact in any network",
    "f_n_high": "largest f_n",
    "f_t_low": "smallest f_t, negative in the other direction",
    "f_t_high": "largest f_t",
    "reached": "whether the requested size or accuracy was reached",
    "largest_duality_gap": Line(
        "largest possible error of a bound, certified, in units of ⟨f_n⟩", "max_gap"
    ),
    "ln_volume": Line(
        "logarithm of the volume V of S, with forces in units of ⟨f_n⟩", "log_volume"
    ),
    "ln_volume_error": Line("standard error of ln V", "log_volume_error"),
    "ln_volume_on_the_way_down": "ln V from the ladder of decreasing β alone, as a check",
    "ln_volume_on_the_way_up": "ln V from the ladder of increasing β alone",
    "ln_volume_per_grain": Line("ln V per grain of the backbone", "log_volume_per_grain"),
    "extent_over_mean_normal_force": Line(
        "width V^(1/h)/√(2πe) of S per dimension, in units of ⟨f_n⟩", "extent"
    ),
    "paths": "paths of the billiard walk",
    "mean_limit_load": Line("mean limit load", "limit_load", "mean", FORCE),
    "least_limit_load": Line("smallest limit load of a contact", unit=FORCE),
    "largest_limit_load": Line("largest limit load of a contact", unit=FORCE),
    "contacts_without_a_limit": "contacts on which any force pair can be balanced; not in the mean",
    "largest_shear_over_pressure": Line(
        "largest √((σ_xx − σ_yy)²/4 + σ_xy²)/P that the contacts can carry", "friction"
    ),
    "certainly_not_above": Line("certified upper bound on this ratio", "friction_bound"),
    "own_shear_over_pressure": "this ratio for the packing's original forces",
    "own_normal_difference": "(σ_xx − σ_yy)/2P of the packing's original forces",
    "own_shear_stress": "σ_xy/P of the packing's original forces",
    "mean_critical_force": Line(
        "mean critical force F_crit, the force pair at which grains start to move", unit=FORCE
    ),
    "critical_force_deciles": Line("F_crit: smallest value, deciles, largest value", unit=FORCE),
    "limit_load": Line("largest force pair that can be balanced", "limit_load"),
    "fit_range": "distances r of the fit, in the packing's units; undefined in small packings",
    "largest_breach": Line(
        "largest violation of Coulomb's law by a first motion, relative to the fastest contact",
        "motion_breach",
        "max",
    ),
    **{
        name: Line(QUANTITIES[name].meaning, name, "sum")
        for name in ("loads_at_rest", "loads_moving", "loads_undecided")
    },
    "load_factor": "largest multiple of the load that contact forces can balance",
    "certified_error": "certified bound on how much the true load factor can exceed the reported "
    "one",
    "critical_factor_low": "largest multiple at which bodies stayed at rest",
    "critical_factor_high": "smallest multiple at which they moved, or the load factor",
    "breach": "violation of Coulomb's law by the first motion, relative to the fastest contact",
    "precision": "requested difference between the two critical factors, as a fraction of the load "
    "factor",
    "converged": "whether the two critical factors agree to the requested precision and the motion "
    "is steady",
    "measured_components": "number of measured f_n and f_t",
    "measured_where_nothing_can_carry": "measured f_n and f_t outside the backbone, ignored",
    "directions_taken_as_pinned": Line(
        "directions of S too narrow to be resolved, if there are any",
        "flat_directions",
        nonzero="flat_directions",
    ),
    "as_narrower_than": Line(
        "width of S in these directions, in units of ⟨f_n⟩", "resolution", nonzero="flat_directions"
    ),
    # of a photoelastic frame
    "contacts_listed": "pairs of grains in the file, each counted once",
    "candidates": "pairs of grains close enough to touch but not in the file, added as unmeasured "
    "contacts",
    "unbalanced_on_listed_contacts": "inner grains that listed contacts cannot balance",
    "unbalanced": "grains that remain unbalanced with candidates",
    "left_open": "ids of these grains; their equilibrium is not required",
    "candidates_that_carry": "candidates that carry force in the likeliest network",
    "unbalance_saved_if_tangential_forces_were_reversed": "fraction by which the unbalance would "
    "decrease with the other sign of f_t (--reverse)",
    "error": "median standard error of a measured f_n, in units of the mean measured f_n; without "
    "--error, chosen so that χ² equals its degrees of freedom",
    "mean_change_of_f_n": Line("mean |inferred − measured| f_n", unit=FORCE),
    "measured_pressures": "number of grains with a measured pressure that is used",
    "suspect_grains": "grains whose pressure deviates by more than 3 σ",
    "suspects": "contacts that deviate by more than 3 σ",
    "mean_standard_error": Line("mean standard error of a force", "standard_error", "mean", FORCE),
    "unmeasured_spread": Line(
        "standard error with which unmeasured forces count as 0, in units of "
        "⟨f_n⟩; if S is unbounded, error bars of forces without measured bounds depend on it",
        "unmeasured",
    ),
    "unmeasured_contacts": "contacts whose f_n was not measured",
    "carry_for_certain": "unmeasured contacts that carry force in every network within 3 σ",
    "mean_interval_now": Line(
        "mean length of the interval of f_n before a measurement", unit=FORCE
    ),
}
_EXTENSION = ("dimension", "directions_taken_as_pinned", "as_narrower_than")
_ETAS = ("eta1", "eta2", "eta3")
_CHECKS = ("largest_residual", "largest_violation")
_END = ("seconds", "cached")
PACKING = (
    *("grains", "grains_left_open", "contacts", "backbone_grains", "backbone_contacts"),
    *("rattlers", "mu", "pressure", "packing_fraction", "coordination", "dimension"),
    *("mean_normal_force", "residual", "violation", "largest_overlap", "largest_contact_gap"),
    "least_other_gap",
)
PACK = ("scene", *PACKING, "steps", "sweeps_done", "distance_to_rest", "at_rest", "cached")
PEGS = (
    *("contacts_listed", "candidates", "unbalanced_on_listed_contacts", "unbalanced"),
    *("left_open", "candidates_that_carry", "unbalance_saved_if_tangential_forces_were_reversed"),
    *("error", "chi_square", "freedom"),
)
IMPORT = (*PACKING, "timestep", "time", "contacts_skipped", "walls", "contacts_with_walls")
WALK = (
    *("entry", "packing_fraction", "coordination", *_EXTENSION, *_ETAS, "acceptance", "accepted"),
    *("rejected", "unconverged", "skipped", "rattlers", "unloaded_contacts", "mean_iterations"),
    *(*_CHECKS, *_END),
)
SCAN = (
    *("packing_fraction", "coordination", "dimension", *_ETAS, "acceptance", "rejected"),
    *("unconverged", "skipped", "cached"),
)
MEASURE = (
    *("mu", "states", *_EXTENSION, "coordination", "packing_fraction", *_ETAS),
    *("mean_normal_force", "mean_extent_of_f_n", "largest_extent_of_f_n", "correlation"),
    *("correlation_low", "correlation_high", "mean_distance_to_centre", "original_distance"),
)
# Work of the samplers, which only the JSON report has.
WORK = ("turns", "refused", "dropped", "held")
_MIXING = ("worst_r_hat", "least_bulk_size", "least_tail_size", *WORK)
_SAMPLING = ("setup_seconds", "sampling_seconds")
UNIFORM = (
    *("entry", "states", *_EXTENSION, "packing_fraction", "coordination", *_ETAS, *_MIXING),
    *("skipped", "rattlers", "unloaded_contacts", "reached", "mean_distance_to_centre"),
    *("original_distance", *_CHECKS, *_SAMPLING, *_END),
)
VOLUME = (
    *("entry", *_EXTENSION, "ln_volume", "ln_volume_error", "ln_volume_on_the_way_down"),
    *("ln_volume_on_the_way_up", "ln_volume_per_grain", "extent_over_mean_normal_force"),
    *("reached", "paths", "turns", "refused", *_END),
)
_SOLVED = ("programs", "again", "largest_duality_gap", *_END)
INTERVALS = (
    *("contacts", *_EXTENSION, "coordination", "exact_eta3", "mean_normal_force"),
    *("mean_extent_of_f_n", "largest_extent_of_f_n", "contacts_with_unbounded_f_n"),
    *("contacts_with_unbounded_f_t", "contacts_not_certified", "correlation"),
    *("determined_contacts", "undetermined_clusters", "position_of_f_n_in_tenths", *_SOLVED),
)
BOUNDS = ("f_n_low", "f_t_low", "f_n_high", "f_t_high", "cluster")
LIMIT_LOADS = (
    *("contacts", "mean_normal_force", "mean_limit_load", "least_limit_load"),
    *("largest_limit_load", "contacts_without_a_limit", "contacts_not_certified", *_SOLVED),
)
LOADS = ("limit_load",)
LOAD_FACTOR = (
    *("bodies", "contacts", "load_factor", "certified_error", "critical_factor_low"),
    *("critical_factor_high", "precision", "residual", "breach", "converged"),
)
REST = (
    *("at_rest", "reason", "residual", "violation", "distance_to_rest", "noise", "draws_at_rest"),
    "draws",
    "wedged_grains",
)
INFORMATIVE = (
    *("entry", "mean_interval_now", "expected_reduction", "reduction", "mean_interval_after"),
    *("twins", *_END),
)
STRESS = (
    *(*_EXTENSION, "largest_shear_over_pressure", "certainly_not_above"),
    *("own_shear_over_pressure", "own_normal_difference", "own_shear_stress"),
    *("normal_difference_from_to", "shear_stress_from_to", "admissible_stress", *_SOLVED),
)
PERTURB = (
    *("contacts", "mean_normal_force", "mean_critical_force", "mean_limit_load"),
    "critical_force_deciles",
    *("decay_exponent", "decay_low", "decay_high", "fit_range", "loads_at_rest", "loads_moving"),
    *("loads_undecided", "rattlers", "unloaded_contacts", "largest_residual", "largest_breach"),
    *_END,
)
CRITICAL = ("limit_load", "critical_low", "critical_high")
INFER = (
    *("entry", "contacts", "measured_components", "measured_where_nothing_can_carry"),
    *("measured_pressures", "chi_square", "freedom", "mean_change_of_f_n", "suspects"),
    *("suspect_grains", "unmeasured_spread"),
    *("unmeasured_contacts", "carry_for_certain", "states", "mean_standard_error"),
    *(*_MIXING, *_SAMPLING, *_END),
)


def line(name: str) -> Line:
    """The line of this name, by default the stored quantity of this name."""
    declared = _LINES.get(name)
    if declared is None:
        return Line(QUANTITIES[name].meaning, name)
    return declared if isinstance(declared, Line) else Line(declared)


def explanation(names: tuple[str, ...]) -> str:
    """The meaning of these lines, two spaces in, as the options above them."""
    width = 24
    lines = []
    for name in names:
        first, *others = textwrap.wrap(line(name).meaning, 78 - width)
        label = f"  {spaced(name)}"
        if len(label) > width - 2:
            lines.append(label)
            label = ""
        lines.append(f"{label:<{width}}{first}")
        lines += [" " * width + other for other in others]
    return "\n".join(lines)
