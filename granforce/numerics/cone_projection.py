"""The nearest network from v alone: the projection onto each cone, and its derivative.

 For w = 1 and c·y = −f·target the optimum of a contact program has f = Π(target + Aᵀ v), where Π
projects onto the Coulomb cone of each contact. So the balance A Π(target + Aᵀ v) = b is a piecewise
linear system for v alone. Newton's method on it terminates exactly: once every contact keeps its
state (inside, sliding or open), the step is the solution. With forces (f_n, f_t/μ), p the normal
part of target + Aᵀ v and q = μ times its tangential part:

    inside, |q| ≤ μ² p:     f = (p, q/μ²),                K = (1 0; 0 1/μ²);
    sliding otherwise:      f = (p + |q|) (1, ±1)/(1 + μ²),   K = (1 ±1; ±1 1)/(1 + μ²);
    open where p + |q| ≤ 0: f = 0,                        K = 0.

The derivatives K are the conductances that `interior_point.advance` puts into A K Aᵀ (PROJECTED).
"""

from granforce.numerics.contact_matrix import pull
from granforce.numerics.contact_program import PINNED, unbalance, worst_of
from granforce.numerics.lanes import compiled, larger, load, pick, same, size, store, within


@compiled
def project(problem, at, work, lanes):
    """y ← the nearest point of each cone to target + Aᵀ v, with the derivative K and the unbalance.

    For w = 1 and no sides: once balanced, these forces are the optimum, exactly in their cones.
    """
    for k in range(0, len(problem.w), 2):
        mu2 = problem.mu[k // 2] * problem.mu[k // 2]
        flat, soft = 1.0 / (1.0 + mu2), 1.0 / max(mu2, 1e-300)
        normal, tangential = pull(problem.network, k // 2, at.v, at.v_border, lanes)
        # f_n and μ f_t of target + Aᵀ v.
        normal = normal - load(at.c, k, lanes) - load(at.c, k + 1, lanes)
        tangential = tangential - load(at.c, k, lanes) + load(at.c, k + 1, lanes)
        across = size(tangential)
        sliding = flat * (normal + across)
        sign = pick(0.0, tangential, -1.0, 1.0)
        inside = mu2 * normal
        f_n = pick(across, inside, sliding, normal)
        f_t = pick(across, inside, sign * sliding, soft * tangential)
        nn = pick(across, inside, flat, 1.0)
        nt, tt = pick(across, inside, sign * flat, 0.0), pick(across, inside, flat, soft)
        if problem.w[k] >= PINNED or problem.w[k + 1] >= PINNED:
            _project_pinned(problem, k, normal, soft * tangential, soft, at, work, lanes)
            continue
        # The tip last: without friction a purely normal tension would count as inside.
        tip = pick(across, -normal, 1.0, 0.0)
        store(work.K, 3 * (k // 2), lanes, tip * nn)
        store(work.K, 3 * (k // 2) + 1, lanes, tip * nt)
        store(work.K, 3 * (k // 2) + 2, lanes, tip * tt)
        store(at.y, k, lanes, tip * (f_n + f_t))
        store(at.y, k + 1, lanes, tip * (f_n - f_t))
    unbalance(problem, at, work, lanes)
    worst = worst_of(work.r_border, worst_of(work.r, same(lanes, 0.0), lanes), lanes)
    store(work.unbalance, 0, lanes, worst)


@within
def _project_pinned(problem, k, normal, tangential, soft, at, work, lanes):
    """Project one contact with f_n, f_t or both pinned: the nearest point of a line."""
    y0, y1 = load(at.y, k, lanes), load(at.y, k + 1, lanes)
    f_n, f_t = 0.5 * (y0 + y1), 0.5 * (y0 - y1)
    nn = tt = same(lanes, 0.0)
    if problem.w[k] < PINNED:
        least = size(f_t)
        f_n, nn = larger(normal, least), pick(normal, least, 1.0, 0.0)
    elif problem.w[k + 1] < PINNED:
        tt = pick(f_n, size(tangential), soft, 0.0)
        f_t = -larger(-f_n, -larger(-f_n, tangential))
        f_t = pick(f_n, size(tangential), tangential, f_t)
    store(work.K, 3 * (k // 2), lanes, nn)
    store(work.K, 3 * (k // 2) + 1, lanes, 0.0)
    store(work.K, 3 * (k // 2) + 2, lanes, tt)
    store(at.y, k, lanes, f_n + f_t)
    store(at.y, k + 1, lanes, f_n - f_t)
