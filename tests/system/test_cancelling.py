"""Whatever is under way ends soon after it is asked to, and leaves nothing behind.

No test measures a second: the work here would take hours (or for ever), and has ended long before.
"""

import os
import signal
import threading
import time

import numpy as np
import pytest
from heeding import heeding, until_it_computes
from packings import packed
from scipy import sparse

import granforce as gf
from granforce.explore import billiard, uniform
from granforce.explore.walls import walls
from granforce.motion.flow import Push
from granforce.motion.flow_lanes import follow, relax
from granforce.motion.inertia import make_step
from granforce.numerics import elimination
from granforce.numerics import highs as programs
from granforce.system import cancelling

# What is a second on an idle machine; hours are what the work would take.
SOON = 60.0


@pytest.fixture(scope="module")
def S():
    return gf.ensemble(packed(40, 0.3))


def endless_steps():
    gf.pack(40, 0.3, 0, sweeps=10**9, accuracy=1e-300)


def endless_insertion():
    gf.pack(10**6, 0.3, 0)


def endless_sweeps(S):
    # Forces that are not numbers neither come to rest nor stall.
    gf.gauss_seidel(S, np.full_like(S.original, np.nan), max_iterations=10**12, rest=None)


def endless_walk(S):
    gf.walk(S, 10**6, 0, chains=2, workers=2)


def endless_paths(S):
    made = walls(S)
    uniform.step(made, [uniform.init(made, 0)], count=10**7, reach=1.0)


def one_endless_path(S):
    made = walls(S)
    flight, out = billiard.make_flight(uniform.init(made, 0).slacks), np.ones((1, made.count))
    speeds = made.moved(np.random.default_rng(0).standard_normal((1, made.count)))
    path = speeds, np.array([1e12]), np.ones((0, made.count)), flight, 10**12
    rows = billiard.room_for_rows(made.count)
    billiard.make_rows(made.rows, rows.cache, range(made.count))
    billiard.fly(rows.cache, *path, out, cancelling.flag())
    cancelling.check()


def endless_hits(S):
    made = walls(S)
    uniform.step(made, [uniform.init(made, 0)], count=10**6, reach=1.0, method="hit_and_run")


def endless_motion(S):
    # Under 100 ⟨f_n⟩ grains move for good, and no breach of Coulomb's law is below zero.
    relax(make_step(S), moving(S))


def endless_motions_side_by_side(S):
    def work():
        yield moving(S)

    follow(make_step(S), [work() for _ in range(9)], print, workers=2)


def moving(S):
    return Push(S.original / S.force_scale, 0, 100.0, 10**9, 0.0)


def long_program(solver):
    n = 20_000
    rng = np.random.default_rng(1)
    places = rng.integers(0, [[n], [2 * n]], (2, 12 * n))
    A = sparse.csc_matrix((rng.random(12 * n), places), (n, 2 * n)) + sparse.eye(n, 2 * n)
    model = programs.standard_form(A, A @ np.ones(2 * n), solver=solver)
    programs.set_cost(model, 1 + np.random.default_rng(0).standard_normal(2 * n))
    programs.optimal(model)


def endless_call():
    cancelling.apart(time.sleep, 20)  # at the end of the process it is waited for


def long_elimination():
    pairs = np.random.default_rng(0).integers(50_000, size=(150_000, 2))
    elimination.pattern(np.random.default_rng(1).random((50_000, 2)), *pairs.T)


@pytest.mark.parametrize(
    "work",
    [
        endless_steps, endless_insertion, endless_sweeps, endless_walk, endless_paths,
        one_endless_path, endless_hits, endless_motion, endless_motions_side_by_side, endless_call,
        long_elimination,
        lambda: long_program("simplex"), lambda: long_program("ipm"),
    ],
)  # fmt: skip
def test_what_would_take_hours_ends_when_cancelled(work, S):
    arguments = (S,) if work.__code__.co_argcount else ()
    work_ended, asked, ends = threading.Event(), threading.Event(), []

    def run():
        try:
            with cancelling.scope(asked.is_set):
                work(*arguments)
        except BaseException as error:
            ends.append(error)
        work_ended.set()

    threading.Thread(target=run, daemon=True).start()
    assert not work_ended.wait(1.0), ends
    asked.set()
    assert work_ended.wait(SOON)
    assert isinstance(ends[0], gf.Cancelled)


@pytest.mark.parametrize(
    "work",
    [
        lambda S: gf.pack(40, 0.3, 0),
        lambda S: gf.pack(20, 0.0, 0),
        lambda S: gf.walk(S, 3, 0),
        lambda S: gf.sample_uniform(S, 8),
        lambda S: gf.intervals(S, workers=2),
        lambda S: gf.limit_loads(S),
        lambda S: gf.outline(S, np.stack([S.original, S.original[::-1]])),
        lambda S: gf.critical_force(S, S.index[0]),
        lambda S: gf.response(S, S.index[0]),
        lambda S: gf.nearest(S, 2 * S.original),
        lambda S: gf.gauss_seidel(S, 2 * S.original),
    ],
)  # fmt: skip
def test_nothing_is_handed_out_once_cancelled(work, S):
    with cancelling.scope(lambda: True), pytest.raises(gf.Cancelled):
        work(S)


def test_a_cancel_that_never_comes_changes_no_number(S):
    kick = S.original + 0.1 * S.force_scale
    for solver in (gf.nearest, gf.gauss_seidel):
        watched = solver(S, kick, cancel=lambda: False)
        assert np.array_equal(watched.forces, solver(S, kick).forces)
    plain, watched = gf.pack(20, 0.3, 1), gf.pack(20, 0.3, 1, cancel=lambda: False)
    assert np.array_equal(plain.forces, watched.forces)


def test_scopes_nest_and_leave_nothing_behind():
    asked = []
    with cancelling.scope(lambda: bool(asked)):
        with cancelling.scope(lambda: False):
            cancelling.check()
            with cancelling.threads(1) as pool:
                assert not pool.submit(cancelling.cancelled).result()
                asked.append(True)
                assert pool.submit(cancelling.cancelled).result()
            with pytest.raises(gf.Cancelled):
                cancelling.check()
        assert cancelling.cancelled()
    assert not cancelling.cancelled()
    assert not [one for one in threading.enumerate() if one.name == "granforce-cancel"]
    assert signal.set_wakeup_fd(-1) == -1


def test_an_error_in_cancel_is_told(S):
    def broken():
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        gf.walk(S, 3, 0, cancel=broken)


@pytest.mark.skipif(os.name == "nt", reason="signals are sent otherwise there")
def test_ctrl_c_ends_a_kernel_in_the_main_thread():
    script = (
        "import granforce as gf\n"
        "gf.pack(20, 0.3, 0)\n"
        "print('begun', flush=True)\n"
        "gf.pack(40, 0.3, 0, sweeps=10**9, accuracy=1e-300)\n"
    )
    with heeding("-c", script) as child:
        try:
            assert child.stdout.readline() == "begun\n"
            until_it_computes(child)  # within the kernel
            child.send_signal(signal.SIGINT)
            _, errors = child.communicate(timeout=SOON)
        finally:
            child.kill()
    assert errors.rstrip().endswith("KeyboardInterrupt")
