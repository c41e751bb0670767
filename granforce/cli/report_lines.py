"""The meaning of report lines, for `--help`."""

import textwrap

from granforce.system.plain import spaced

# Names as in --json; those that are stored have the long names of the stored arrays.
MEANINGS = {
    "dimension": "dimension h of the ensemble",
    "eta1": "indeterminacy η1 = ⟨δF⟩/⟨|G|⟩",
    "acceptance": "accepted states per attempt",
    "rejected": "attempts that ended in no equilibrium",
    "unconverged": "attempts that ran out of iterations",
    "skipped": "states that needed no relaxation (h = 0)",
    "rattlers": "grains outside the backbone",
    "unloaded_contacts": "contacts that can carry nothing",
    "worst_r_hat": "largest split R̂ of any component",
    "least_bulk_size": "smallest bulk effective sample size",
    "least_tail_size": "smallest tail effective sample size",
    "turns": "reflections of the billiard walk",
    "refused": "paths with too many reflections, not taken",
    "dropped": "states left out while chains warmed up",
    "held": "cone coordinates that are zero in all of the ensemble",
    "original_distance": "distance of the original network from the centre",
    "determined_contacts": "contacts with the same force in all networks",
    "undetermined_clusters": "connected groups of all other contacts",
    "position_of_f_n_in_tenths": "contacts by the position of the packing's own f_n in its "
    "interval: first tenth, …, last tenth",
    "programs": "linear programs solved",
    "again": "programs solved a second time, with refined steps or by HiGHS",
    "part_expected": "part by which errors of f_n fall once this one is known",
    "mean_interval_after": "mean interval of f_n once this one is known",
    "normal_difference_from_to": "range of (σ_xx − σ_yy)/2P that the contacts can carry",
    "shear_stress_from_to": "range of σ_xy/P that the contacts can carry",
    "admissible_stress": "a stress well inside, as --stress takes it",
}
WALK = ("dimension", "eta1", "acceptance", "rejected", "unconverged", "skipped")
UNIFORM = (
    *("dimension", "eta1", "worst_r_hat", "least_bulk_size", "least_tail_size", "turns"),
    *("refused", "dropped", "held", "original_distance", "rattlers", "unloaded_contacts"),
)
INTERVALS = (
    *("dimension", "determined_contacts", "undetermined_clusters", "position_of_f_n_in_tenths"),
    *("programs", "again"),
)
INFORMATIVE = ("part_expected", "mean_interval_after")
STRESS = ("normal_difference_from_to", "shear_stress_from_to", "admissible_stress", "programs")


def explained(names: tuple[str, ...]) -> str:
    """The meaning of these lines, two spaces in, as the options above them."""
    width = 24
    lines = []
    for name in names:
        first, *others = textwrap.wrap(MEANINGS[name], 78 - width)
        label = f"  {spaced(name)}"
        if len(label) > width - 2:
            lines.append(label)
            label = ""
        lines.append(f"{label:<{width}}{first}")
        lines += [" " * width + other for other in others]
    return "\n".join(lines)
