"""What a field of a result is, and the quantities that results, reports and the store share.

A field is declared once. A record declares what only it has; it names a quantity that is stored:

    class Pull(NamedTuple):
        states: Annotated[Floats, quantity("states", "value contact component")]
        opened: Annotated[Mask, Field("value contact", "", "contacts without force")]

Help, notebooks, the reference, xarray, pandas, tables, the store and reports are derived from it.
Nothing here needs NumPy: `--help` reads this file.
"""

from typing import Any, NamedTuple

FORCE, MEAN, LENGTH = "force", "mean normal force", "length"
# Dimensions of forces on all contacts of the packing, also on those that carry none.
ALL_CONTACTS = "packing_contact component"


class Field(NamedTuple):
    """The declaration of a field."""

    dims: str  # names of its dimensions, separated by blanks
    unit: str  # empty if it has none
    meaning: str
    note: str = ""  # what `help` adds
    label: str | None = None  # name in datasets and tables if it differs; empty if not in them
    stored: str = ""  # name in the store, if it is stored
    dtype: str = "float64"  # there
    each: bool = False  # whether several records together give an array over contacts

    @property
    def text(self) -> str:
        """Shape, meaning and unit, for `help`."""
        shape = f"({', '.join(self.dims.split())}) " if self.dims else ""
        unit = f", {'⟨f_n⟩' if self.unit == MEAN else self.unit}" if self.unit else ""
        return f"{shape}{self.meaning}{unit}{f'; {self.note}' if self.note else ''}"

    @property
    def long_name(self) -> str:
        """The meaning, with the components of an array, for its attributes."""
        components = ", components f_n, f_t" if self.dims.split()[-1:] == ["component"] else ""
        return self.meaning + components


def whole(dims: str, meaning: str) -> Field:
    """A quantity of whole numbers: counts, positions and flags."""
    return Field(dims, "", meaning, dtype="int64")


# Quantities by their names in the store.
QUANTITIES = {
    # the packing
    "x": Field("grain axis", LENGTH, "centres of the grains"),
    "r": Field("grain", LENGTH, "radii of the grains"),
    "box": Field("axis", LENGTH, "box sides, infinite where open"),
    "tilt": Field("", LENGTH, "tilt of the cell: x component of its upper side b"),
    "mu": Field("", "", "friction coefficient μ"),
    "pressure": Field("", "force/length", "pressure P0, NaN where not prescribed"),
    "load": Field("grain load_component", "force; force*length", "load F_x, F_y; torque"),
    "contact_i": whole("contact", "first grain i of the contact"),
    "contact_j": whole("contact", "second grain j of the contact"),
    "normal": Field("contact axis", "", "unit normal from i to j"),
    "length": Field("contact", LENGTH, "centre distance ℓ"),
    "gap": Field("contact", LENGTH, "gap ℓ − r_i − r_j"),
    "arm_i": Field("contact", LENGTH, "lever arm from i to the contact point"),
    "arm_j": Field("contact", LENGTH, "lever arm from j to the contact point"),
    "levers": Field("contact end", LENGTH, "offset along t of the contact point, from i and j"),
    "friction_ratio": Field("contact", "", "friction coefficient over μ"),
    "forces": Field("contact component", FORCE, "original force network"),
    "corners": Field("corner axis", LENGTH, "corners of all polygons, part by part"),
    "sides": whole("part", "number of corners of the part, 0 for a disk"),
    "part_body": whole("part", "body to which the part belongs"),
    "circles": Field("part circle", LENGTH, "x, y and radius of the circle around the part"),
    "mass": Field("grain", "mass", "masses of the bodies"),
    "inertia": Field("grain", "mass*length**2", "moments of inertia of the bodies"),
    # states of the ensemble: the contact dimension is that of the backbone
    "backbone": whole("contact", "position of the contact in the packing")._replace(label=""),
    "states": Field("state contact component", FORCE, "admissible networks"),
    "residual": Field("state", MEAN, "largest unbalance"),
    "violation": Field("state", MEAN, "largest cone violation"),
    "sweeps": whole("state", "solver sweeps or iterations spent"),
    "attempts": whole("state", "attempts until the state was accepted"),
    "mean_sweeps": Field("", "", "solver sweeps per state, failures included"),
    "distance_to_centre": Field("state", MEAN, "distance from the centre of the ensemble"),
    "chain": whole("state", "chain that the state belongs to"),
    # whether chains mixed: NaN for components that cannot vary
    "r_hat": Field("contact component", "", "split R̂"),
    "bulk_size": Field("contact component", "", "bulk effective sample size"),
    "tail_size": Field("contact component", "", "tail effective sample size"),
    "worst_r_hat": Field("", "", "largest split R̂ of any component"),
    "least_bulk_size": Field("", "", "smallest bulk effective sample size"),
    "least_tail_size": Field("", "", "smallest tail effective sample size"),
    "reached": whole("", "1 if the requested size or accuracy was reached"),
    "turns": whole("", "reflections of the billiard walk"),
    "refused": whole("", "paths discarded because of too many reflections"),
    "dropped": whole("", "states discarded while the chains warmed up"),
    "held": whole("", "coordinates f_n ± f_t/μ that are zero in all of S"),
    "setup_seconds": Field("", "s", "wall time before the first step"),
    "sampling_seconds": Field("", "s", "wall time of the steps"),
    # a measurement, and the inferred forces
    "grain_id": Field("grain", "", "name in the files; below 0: a wall"),
    "regional_stress": Field(
        "region stress_component", "force/length", "stress xx, yy, xy by region"
    ),
    "regional_stress_error": Field("region stress_component", "force/length", "its standard error"),
    "added": whole("contact", "1 if the contact is not listed in the files"),
    "measured": Field("contact component", FORCE, "measured forces"),
    "sigma": Field("contact component", FORCE, "standard errors of measured forces"),
    "inferred": Field("contact component", FORCE, "likeliest admissible network"),
    "deviation": Field("contact component", "", "(inferred − measured)/σ"),
    "measured_pressure": Field("grain", "force/length", "measured pressures of grains"),
    "pressure_sigma": Field("grain", "force/length", "their standard errors"),
    "pressure_deviation": Field("grain", "", "(pressure − measured)/σ, NaN if not measured"),
    "suspect_grain": whole("beyond_grain", "grains beyond 3 σ"),
    "expected": Field("contact component", FORCE, "mean of the draws"),
    "standard_error": Field("contact component", FORCE, "standard deviation of the draws"),
    "least_normal": Field(
        "contact", FORCE, "least f_n over all networks within 3 σ of the measured"
    ),
    "suspect": whole("beyond", "contacts in the packing beyond 3 σ"),
    "chi_square": Field("", "", "χ² of the likeliest network"),
    "freedom": whole("", "degrees of freedom of χ²"),
    "unmeasured": Field("", MEAN, "standard error with which unmeasured forces count as 0"),
    "bounded": whole("", "1 if S is bounded, 0 if only `unmeasured` limits some forces"),
    # results from a set of states: bounds seen, measures, cost
    "original": Field("contact component", FORCE, "the packing's own network"),
    "low": Field("contact component", FORCE, "smallest value"),
    "high": Field("contact component", FORCE, "largest value"),
    "eta1": Field("", "", "indeterminacy η1 = ⟨δF⟩/⟨|G|⟩"),
    "eta2": Field("", "", "indeterminacy η2 from pairs of states"),
    "eta3": Field("", "", "indeterminacy η3 from intervals"),
    "correlation": Field("", "", "corr(f_n, ΔF_n) of the original network"),
    "correlation_low": Field("", "", "smallest corr(f_n, ΔF_n) of any state"),
    "correlation_high": Field("", "", "largest corr(f_n, ΔF_n) of any state"),
    "interval_gap": Field("contact component side", MEAN, "duality gap of the bounds"),
    "cluster": whole("contact", "cluster of undetermined contacts, −1 where determined"),
    "position": Field("contact", "", "place of the original f_n in its interval, 0 to 1"),
    # which measurement is most informative
    "part_expected": Field(
        "contact", "", "expected fraction by which errors of f_n fall once this f_n is known"
    ),
    "mean_before": Field("", MEAN, "mean interval of f_n"),
    "mean_after": Field("contact", MEAN, "mean interval of f_n once f_n of this contact is known"),
    "limit_load": Field("contact", FORCE, "limit load of a normal force pair"),
    "load_gap": Field("contact", MEAN, "duality gap of the limit loads"),
    # the response to a force pair on one contact
    "critical_low": Field("contact", FORCE, "F_crit: largest load at rest"),
    "critical_high": Field("contact", FORCE, "smallest load not at rest, or the limit load"),
    "load_residual": Field("contact", MEAN, "unbalance under the largest load at rest"),
    "load_violation": Field("contact", MEAN, "cone violation under the largest load at rest"),
    "motion_breach": Field("contact", "", "violation of Coulomb's law by the first motion"),
    "pair_opening": Field("contact", "", "opening of the contact, rms |u| = 1"),
    "opened": whole("contact", "contacts that the first motion opens"),
    "slid": whole("contact", "contacts that slide in the first motion"),
    "kept": whole("contact", "contacts that stick in the first motion"),
    "contact_motion": whole(
        "contact carrying", "each contact in the first motion: 0 sticks, 1 slides, 2 opens"
    ),
    "loads_at_rest": whole("contact", "loads that ended at rest"),
    "loads_moving": whole("contact", "loads that ended in steady motion"),
    "loads_undecided": whole("contact", "loads that ended in unsteady motion"),
    "flow_steps": whole("contact", "implicit steps of the flow"),
    "linear_systems": whole("contact", "linear systems solved"),
    "contact_seconds": Field("contact", "s", "wall time of the critical force"),
    "displacement": Field("contact grain axis", "", "first motion u, rms 1; NaN for rattlers"),
    "shell_radius": Field("shell", LENGTH, "middle of the shell"),
    "profile": Field("contact shell", "", "mean |u| of the shell's grains"),
    "critical_force": Field("", MEAN, "mean of F_crit"),
    "decay_exponent": Field("", "", "exponent α of the mean displacement |u| ~ r^−α"),
    "decay_low": Field("", "", "lower end of the 95 % interval of α"),
    "decay_high": Field("", "", "upper end of the 95 % interval of α"),
    "fit_inner": Field("fit", LENGTH, "smallest r of other fits"),
    "fit_outer": Field("fit", LENGTH, "largest r of other fits"),
    "fit_exponent": Field("fit", "", "α of other fits"),
    # the number of networks: forces of every contact in ⟨f_n⟩
    "log_volume": Field("", "", "ln V, the h-dimensional volume of S"),
    "log_volume_error": Field("", "", "standard error of ln V"),
    "log_volume_ladders": Field("ladder", "", "ln V from the ladder down and the ladder up"),
    "log_volume_per_grain": Field("", "", "ln V per grain of the backbone"),
    "extent": Field("", MEAN, "width V^(1/h)/√(2πe) of S per free dimension"),
    # the outline of S in a plane of force space
    "axes": Field("plane_axis contact component", "", "axes of the plane"),
    "inner": Field("inner_corner plane_axis", MEAN, "polygon inside the outline"),
    "outer": Field("outer_corner plane_axis", MEAN, "polygon around the outline"),
    "outline_gap": Field("", MEAN, "largest distance of the polygons of the outline"),
    # stresses that the contacts can carry, in the plane ((σ_xx − σ_yy)/2P, σ_xy/P)
    "stress_angle": Field("angle", "", "directions θ in the plane of stresses"),
    "stress_support": Field("angle", "", "largest stress along each direction"),
    "stress_gap": Field("angle", "", "duality gap of the largest stress"),
    "stress_inner": Field("inner_corner plane_axis", "", "polygon inside the outline of stresses"),
    "stress_outer": Field("outer_corner plane_axis", "", "polygon around the outline of stresses"),
    "stress_own": Field("plane_axis", "", "stress of the original network"),
    "friction": Field("", "", "largest shear stress over pressure"),
    "friction_bound": Field(
        "", "", "certified upper bound on the largest shear stress over pressure"
    ),
    "programs": whole("", "linear programs solved"),
    "max_gap": Field("", MEAN, "largest duality gap"),
    "packing_fraction": Field("", "", "packing fraction φ, rattlers included"),
    "coordination": Field("", "", "mean coordination number z of the backbone"),
    "dimension": whole("", "dimension h of the ensemble"),
    "flat_directions": whole("", "directions too narrow to be resolved, taken as pinned"),
    "resolution": Field("", MEAN, "width up to which directions are taken as pinned"),
    "force_scale": Field("", FORCE, "mean normal force ⟨f_n⟩"),
    "original_distance": Field("", MEAN, "distance of the original network from the centre"),
    "acceptance": Field("", "", "fraction of attempts that were accepted"),
    "accepted": whole("", "number of accepted attempts"),
    "rejected": whole("", "attempts that found no equilibrium"),
    "unconverged": whole("", "attempts that ran out of iterations"),
    "skipped": whole("", "states that needed no relaxation (h = 0)"),
    "rattlers": whole("", "grains outside the backbone"),
    "unloaded_contacts": whole("", "contacts that cannot carry force"),
    "tangential_unknowns": whole("", "tangential unknowns dropped at μ = 0"),
    "seconds": Field("", "s", "wall time of the computation"),
}


def quantity(name: str, dims: str | None = None, **other: Any) -> Field:
    """A quantity as the field of a record; there, dims, note, label or unit may be others.

    With other dims it is not the stored one.
    """
    other = {"stored": name} | other if dims is None else {"dims": dims} | other
    return QUANTITIES[name]._replace(**other)


def of_one_contact(name: str, dims: str = "", **other: Any) -> Field:
    """A quantity of contacts as the field of a record of one of them."""
    return quantity(name, dims, **{"label": name, "stored": name, "each": True, **other})
