"""How the box moves: at one rate λ, or at three if both sides and the tilt follow the stress.

A square box grows at one dilation rate λ, driven by the pressure. A cell with a free shape has a
strain rate

    D = ( e_x  g  ),    x → (1 + D Δt) x,
        (  0  e_y )

which keeps its side **a** along x. A contact force **F** over the branch ℓ **n** does work on it at
the rate ℓ (e_x F_x n_x + e_y F_y n_y + g F_x n_y). Its inertia ½ V M_λ (e_x² + e_y² + g²/2) is
isotropic, so that

    e_x ← e_x + (σ_xx − P0) Δt/M_λ,   e_y likewise,   g ← g + 2 σ_xy Δt/M_λ,

and (e_x + e_y)/2 is the λ of a square box. Each function has two bodies, chosen by the type of the
rate: a number λ (or lanes of it), or a tuple (e_x, e_y, g). So the square box has no overhead.
"""

import functools

from numba import types
from numba.extending import overload

from granforce.numerics.lanes import total

# Inertia M_λ of the box in masses ρ r_max²: from 1 to 100 it changes the number of sweeps by less
# than 10 % for μ from 0.01 to 10.
BOX_MASS = 10.0
_OPTIONS = {"forceinline": True, "error_model": "numpy"}


def by_type(choose):
    """The function whose body `choose` returns for the types of the arguments.

    The compiler calls `choose` once per combination of types; with the compiler off
    (NUMBA_DISABLE_JIT) it is called with the values at every call.
    """

    @functools.wraps(choose)
    def function(*arguments):
        return choose(*arguments)(*arguments)

    overload(function, jit_options=_OPTIONS)(choose)
    return function


def _several(rate):
    return isinstance(rate, types.BaseTuple | tuple)


@by_type
def rate_in(kept):
    """The rate stored in an array: λ in (1,), or e_x, e_y, g in (1, 3)."""
    if kept.ndim == 2:
        return lambda kept: (kept[0, 0], kept[0, 1], kept[0, 2])
    return lambda kept: kept[0]


@by_type
def keep_rate(rate, kept):
    """Store a rate in an array."""
    if not _several(rate):

        def keep(rate, kept):
            kept[0] = rate

        return keep

    def keep(rate, kept):
        kept[0, 0], kept[0, 1], kept[0, 2] = rate

    return keep


@by_type
def stretched(rate, n_x, n_y):
    """Relative rate n·D n at which a branch along n grows."""
    if _several(rate):
        return lambda rate, n_x, n_y: rate[0] * n_x * n_x + (rate[1] * n_y + rate[2] * n_x) * n_y
    return lambda rate, n_x, n_y: rate


@by_type
def sheared(rate, v_t, length, n_x, n_y):
    """Tangential velocity v_t of a contact plus that of the box, ℓ t·D n; λ adds nothing."""
    if _several(rate):
        return lambda rate, v_t, length, n_x, n_y: (
            v_t + length * ((rate[1] - rate[0]) * n_x - rate[2] * n_y) * n_y
        )
    return lambda rate, v_t, length, n_x, n_y: v_t


@by_type
def pushed(rate, compliance, f_n, f_t, n_x, n_y):
    """The rate after a contact force acts on it; compliance: change of λ per unit f_n."""
    if not _several(rate):
        return lambda rate, compliance, f_n, f_t, n_x, n_y: rate + compliance * f_n

    def push(rate, compliance, f_n, f_t, n_x, n_y):
        f_x, f_y = f_n * n_x - f_t * n_y, f_n * n_y + f_t * n_x
        twice = 2.0 * compliance
        return (
            rate[0] + twice * f_x * n_x,
            rate[1] + twice * f_y * n_y,
            rate[2] + 2.0 * twice * f_x * n_y,
        )

    return push


@by_type
def gained(rate, compliance, f_n, f_t, n_x, n_y):
    """The rate after the forces in all lanes act on it, as `pushed`."""
    if not _several(rate):
        return lambda rate, compliance, f_n, f_t, n_x, n_y: rate + total(compliance * f_n)

    def gain(rate, compliance, f_n, f_t, n_x, n_y):
        e_x, e_y, g = pushed((0.0, 0.0, 0.0), compliance, f_n, f_t, n_x, n_y)
        return rate[0] + total(e_x), rate[1] + total(e_y), rate[2] + total(g)

    return gain


@by_type
def driven(rate, velocity, mass, pressure, volume, dt, box_mass):
    """The rate after one step, driven by the external pressure and the moving grains inside."""
    if not _several(rate):

        def drive(rate, velocity, mass, pressure, volume, dt, box_mass):
            kinetic = 0.0
            for k in range(mass.shape[0]):
                kinetic += mass[k] * (velocity[k, 0] ** 2 + velocity[k, 1] ** 2)
            return rate + (kinetic / (2.0 * volume) - pressure) * dt / box_mass

        return drive

    def drive(rate, velocity, mass, pressure, volume, dt, box_mass):
        xx, yy, xy = 0.0, 0.0, 0.0
        for k in range(mass.shape[0]):
            v_x, v_y = velocity[k, 0], velocity[k, 1]
            xx += mass[k] * v_x * v_x
            yy += mass[k] * v_y * v_y
            xy += mass[k] * v_x * v_y
        gain = dt / box_mass
        return (
            rate[0] + (xx / volume - pressure) * gain,
            rate[1] + (yy / volume - pressure) * gain,
            rate[2] + 2.0 * xy / volume * gain,
        )

    return drive


@by_type
def soften(rate, problem):
    """Add to the inverse stiffness of each contact its effect on the shape of the box."""
    if not _several(rate):
        return lambda rate, problem: None

    def add(rate, problem):
        for c in range(problem.i.shape[0]):
            # stiff_n contains the trace; e_x − e_y and g double it for n at any angle.
            box = problem.box_compliance * problem.length[c] ** 2
            shear = 4.0 * box * problem.n_y[c] ** 2
            problem.stiff_n[c] = 1.0 / (1.0 / problem.stiff_n[c] + box)
            problem.stiff_t[c] = 1.0 / (1.0 / problem.stiff_t[c] + shear)

    return add


@by_type
def fastest(rate):
    """Upper bound on the relative rate at which a length may change."""
    if _several(rate):
        return lambda rate: abs(rate[0]) + abs(rate[1]) + abs(rate[2])
    return lambda rate: abs(rate)


@by_type
def carried(rate, x, y, dt):
    """Where the box moves a point in one step."""
    if _several(rate):
        return lambda rate, x, y, dt: (
            x * (1.0 + rate[0] * dt) + y * (rate[2] * dt),
            y * (1.0 + rate[1] * dt),
        )
    return lambda rate, x, y, dt: (x * (1.0 + rate * dt), y * (1.0 + rate * dt))
