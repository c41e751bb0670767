"""Relaxation solvers: from any contact forces to an admissible network on the same geometry.

Every solver has the signature ``relax(ensemble, start, *, tolerance, max_iterations)`` and returns
a Relaxation judged by ``Ensemble.residual`` and ``Ensemble.violation``.
"""
