"""Every tolerance of granforce: what it means and the scale it is relative to.

Lengths are relative to the largest radius, forces to the mean normal force ⟨f_n⟩.
"""

# Contacts of a finished packing are closed to rounding: their gaps (in largest radii) are below
# CLOSED. A pair without force whose gap is below TOUCHING touches, too; it is a contact and counted
# as one that strict complementarity does not decide.
CLOSED = 1e-11
TOUCHING = 1e-9

# Two disks of a table whose gap (in largest radii) is below this touch, unless it says otherwise.
LISTED_TOUCHING = 1e-6

# Largest overlap (in largest radii) that a finished rigid packing may show.
OVERLAP = 1e-9

# Contacts that overlap by more than this (in largest radii) belong to soft disks: their contact
# point lies midway in the overlap. Below it disks are rigid and lever arms are the radii.
RIGID_OVERLAP = 1e-5

# Entries of the balance (of order 1) below this are 0 but for rounding.
ROUNDING = 1e-14

# Residual at which Gauss–Seidel sweeps end and the nearest admissible network takes over. Against
# sweeping on to 1e-6 it moved the state by at most 2 % (mostly below 0.9 %), of steps of 5–20 %,
# and saved four fifths of the sweeps or more.
AT_REST = 1e-3

# Residual of an equilibrium for sweeps alone: what they reach in affordable time.
EQUILIBRIUM = 1e-6

# Residual of an admissible network: a finished packing's own, and every state of a walk.
BALANCED = 1e-10

# Cones: how far (in ⟨f_n⟩) f_n may be negative or |f_t| exceed μ f_n in an admissible state.
ADMISSIBLE = 1e-9

# A contact whose largest possible f_n (in ⟨f_n⟩) is below this carries nothing.
CARRYING = 1e-7

# A contact seen with at least this f_n (in ⟨f_n⟩) in a balanced state carries. Of one seen with
# less that has to be shown: states balanced to BALANCED had 3e-7 where nothing can carry.
SEEN_CARRYING = 1e-4

# A wall of S (a side of a cone, a known bound) that no point of S is farther away from than this is
# touched by all of S, which has no dimension across it. In ⟨f_n⟩, and for f_t in μ ⟨f_n⟩. Forces of
# order 1 are rounded to 10⁻¹⁶: of an S as narrow as this, rounding is 10⁻⁴.
FLAT = 1e-12

# Largest duality gap (in ⟨f_n⟩) of a certified bound on a force, or of a limit load.
INTERVAL_GAP = 1e-8

# Feasibility tolerance asked of the linear and quadratic programs (forces in ⟨f_n⟩).
PROGRAM = 1e-10

# Largest friction coefficient a packing is made with: at 10⁵ the rounding of f_t = μ f_n alone
# reaches BALANCED, and no network can be certified.
LARGEST_FRICTION = 1e4

# Largest tilt of a cell, in sides: whole sides are taken off, and beyond what is left is rounding.
LARGEST_TILT = 1e6

# Pressures and radii lie within this factor of 1: squares and products of forces stay finite.
LARGEST_UNIT = 1e60

# Measured forces up to so many ⟨f_n⟩, with errors up to so many and down to the inverse of that,
# are resolved together: beyond, a unit is wrong.
MEASURED, ERRORS = 1e6, 1e9

# Friction coefficients, and all numbers in the keys of results, are compared and stored to so many
# digits (0.1 + 0.2 is 0.3).
MU_DIGITS = 15
