"""Every tolerance of granforce, with its meaning and its scale.

Lengths are relative to the largest radius, forces to the mean normal force ⟨f_n⟩.
"""

# Contacts of a finished packing are closed to rounding: their gaps (in largest radii) are below
# CLOSED. A pair without force with a gap below TOUCHING also touches; it is a contact, and is
# counted as one that violates strict complementarity.
CLOSED = 1e-11
TOUCHING = 1e-9

# Default gap (in largest radii) below which two disks of a table touch.
LISTED_TOUCHING = 1e-6

# Largest overlap (in largest radii) in a finished rigid packing.
OVERLAP = 1e-9

# A gap that makes two disks of a table touch is in doubt if it exceeds this many median gaps of
# contacts: rounding in the file does not.
UNUSUAL_GAP = 10.0

# Contacts that overlap by more than this (in largest radii) belong to soft disks, with the contact
# point in the middle of the overlap. Below it disks are rigid and lever arms are the radii.
RIGID_OVERLAP = 1e-5

# Entries of the balance (of order 1) below this are rounding errors.
ROUNDING = 1e-14

# Residual at which Gauss–Seidel sweeps end and the nearest admissible network takes over. Compared
# with sweeps down to 1e-6 this changes the state by at most 2 % (mostly below 0.9 %) of steps of
# 5–20 %, and saves at least four fifths of the sweeps.
AT_REST = 1e-3

# Two packings are the same state if contact normals and forces (in ⟨f_n⟩) differ by at most this.
SAME_STATE = 1e-3

# Residual of an equilibrium for sweeps alone, which they reach in reasonable time.
EQUILIBRIUM = 1e-6

# Residual of an admissible network: a finished packing's own, and every state of a walk.
BALANCED = 1e-10

# Residual and violation of the cones (in ⟨f_n⟩) above which imported forces are reported as not in
# equilibrium. Simulations at rest, and files with three digits, have smaller values.
NO_EQUILIBRIUM = 0.05

# Largest violation of the cones in an admissible state: f_n below 0 or |f_t| above μ f_n, in ⟨f_n⟩.
ADMISSIBLE = 1e-9

# A contact whose largest possible f_n (in ⟨f_n⟩) is below this carries no force.
CARRYING = 1e-7

# A contact with at least this f_n (in ⟨f_n⟩) in a balanced state carries force. For a smaller f_n
# this must be proved: states balanced to BALANCED had up to 3e-7 on contacts that cannot carry.
SEEN_CARRYING = 1e-4

# If no point of S is farther than this from a wall of S (a side of a cone, a known bound), all of S
# touches the wall and has no dimension across it. In ⟨f_n⟩, and for f_t in μ ⟨f_n⟩. Forces of order
# 1 have a rounding error of 10⁻¹⁶, which is 10⁻⁴ of an S this narrow.
FLAT = 1e-12

# Largest duality gap (in ⟨f_n⟩) of a certified bound on a force, or of a limit load.
INTERVAL_GAP = 1e-8

# Contacts whose normal forces have a correlation this close to ±1 over states determine each other.
TWINS = 1e-9

# Bounds are in the wrong order if the least value exceeds the largest by more than this part of the
# largest force: by rounding they may differ by a few INTERVAL_GAP.
REVERSED = 1e-6

# Feasibility tolerance of the linear and quadratic programs (forces in ⟨f_n⟩).
PROGRAM = 1e-10

# Largest friction coefficient of a packing: at 10⁵ the rounding of f_t = μ f_n alone reaches
# BALANCED, and no network can be certified.
LARGEST_FRICTION = 1e4

# Largest tilt of a cell, in sides: whole sides are subtracted, and beyond this only rounding is
# left.
LARGEST_TILT = 1e6

# Pressures and radii are within this factor of 1: squares and products of forces stay finite.
LARGEST_UNIT = 1e60

# Half differences of two measurements beyond this many standard errors are outliers, not noise.
OUTLIER = 3.0

# Largest measured forces and errors in ⟨f_n⟩; errors may also be as small as 1/ERRORS. Beyond, a
# unit is wrong.
MEASURED, ERRORS = 1e6, 1e9

# Digits to which friction coefficients, and all numbers in the keys of results, are compared and
# stored (0.1 + 0.2 is 0.3).
MU_DIGITS = 15
# Largest error of the ends of a line of thrust at a joint, as a part of the joint's length, for
# networks in which the joint carries at least LOADED_JOINT ⟨f_n⟩.
JOINT_GAP, LOADED_JOINT = 1e-6, 0.01

# Part of the largest coordinate of an unbounded direction from which a contact takes part in it.
LOCKED = 1e-6

# Packings of more disks are large: sweeps update contacts in groups, the test of rest has fewer
# draws, and the last phase of a compaction gives up earlier.
MANY_DISKS = 1000
