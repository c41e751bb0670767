"""S of small scenes as the browser computes it, beside the library's: scripts as modules."""

import numpy as np
import pytest

import granforce as gf
from app.learn.model import small_scenes

SCENES = [
    *(("groove", 0.5), ("pyramid", 0.4), ("press", 0.4)),
    *(("box", 0.1), ("box", 0.3), ("leaning", 0.3), ("leaning", 0.5)),
    *(("solid", 0.3), ("solid", 0.5), ("ladder", 0.4)),
]


def drawn(name, mu):
    """A scene as a script takes it: plain numbers and lists."""
    return {
        key: value.tolist() if isinstance(value, np.ndarray) else value
        for key, value in small_scenes.drawn(name, mu).items()
    }


@pytest.mark.parametrize("name, mu", SCENES)
def test_the_browser_cuts_the_same_body_as_the_library(run, name, mu):
    corners, sides, intervals = run(
        "learn/model/polytope",
        """({ Body }, { scene }) => {
            const body = new Body(scene).cut(scene.mu)
            return [
                body.corners.map(({ u }) => [...body.forces(u)]),
                body.sides.length, scene.names.map((_, c) => body.interval(2 * c)),
            ]
        }""",
        scene=drawn(name, mu),
    )
    S = gf.ensemble(gf.scene(name, mu))
    body, exact = gf.body(S), gf.intervals(S)
    expected = body.forces(body.corners).reshape(len(body.corners), -1)
    assert np.shape(corners) == expected.shape and sides == len(body.sides)
    apart = np.linalg.norm(np.array(corners)[:, None] - expected[None], axis=-1)
    assert apart.min(axis=0).max() < 1e-8
    bounds = np.column_stack([exact.low[:, 0], exact.high[:, 0]])
    np.testing.assert_allclose(intervals, bounds, atol=1e-7)


@pytest.mark.parametrize("mu", [0.6, 0.414, 0.415])
def test_s_has_no_end_where_the_library_finds_none(run, mu):
    bounded, rays, intervals = run(
        "learn/model/polytope",
        """({ Body }, { scene }) => {
            const body = new Body(scene).cut(scene.mu)
            const ends = scene.names.map((_, c) => body.interval(2 * c).map(String))
            return [body.bounded, body.rays.length, ends]
        }""",
        scene=drawn("box", mu),
    )
    body = gf.body(gf.ensemble(gf.scene("box", mu)))
    assert (bounded, rays) == (body.bounded, len(body.rays))
    seen = np.char.replace(np.array(intervals), "Infinity", "inf").astype(float)
    expected = np.column_stack([side[:, 0] for side in body.intervals])
    np.testing.assert_allclose(seen, expected, rtol=1e-6)


def test_the_hand_steers_to_the_end_of_one_force_and_stays_in_s(run):
    """Of eight dimensions; the mean of S, where it begins, is the same each time."""
    forces, begins, again = run(
        "learn/model/polytope learn/model/middle",
        """({ Body, middleOf }, { scene }) => {
            const body = new Body(scene).cut(scene.mu)
            body.goInside()
            const begins = middleOf(body), again = middleOf(body)
            body.u = begins
            for (let move = 1; move <= 30; move++) {
                body.steer([6, 40], [move, 1])
                body.steer([6], [move])
            }
            return [[...body.forces()], begins, again]
        }""",
        scene=drawn("thirteen", 0.3),
    )
    S = gf.ensemble(gf.scene("thirteen"))
    network = np.reshape(forces, (-1, 2))
    assert S.residual(network) < 1e-9 and S.violation(network) < 1e-6
    assert network[3, 0] == pytest.approx(gf.intervals(S).high[3, 0], rel=0.01)
    assert begins == again


def test_a_walk_that_holds_two_forces_changes_the_others(run):
    held, moved, least = run(
        "learn/model/polytope",
        """({ Body }, { scene }) => {
            const body = new Body(scene).cut(scene.mu)
            body.goInside()
            const before = body.forces()
            let u = body.u
            for (let k = 0; k < 20; k++) u = body.step(u, () => 0.3 + 0.02 * k, [6, 40])
            const change = [...body.forces(u)].map((v, c) => Math.abs(v - before[c]))
            return [Math.max(change[6], change[40]), Math.max(...change), body.least(u)]
        }""",
        scene=drawn("thirteen", None),
    )
    assert held < 1e-9 and moved > 0.1 and least > -1e-9


def test_forces_that_can_change_while_others_are_held(run):
    """Eight normal forces, whichever, fix all others."""
    S, held = gf.ensemble(gf.scene("thirteen", 0.3)), [6, 40]
    loose, chosen, rest = run(
        "learn/model/polytope",
        """({ Body }, { scene, held }) => {
            const body = new Body(scene).cut(scene.mu), chosen = []
            const next = () => body.loose(chosen).findLast((index) => index % 2 === 0)
            for (let index = next(); index !== undefined; index = next()) chosen.push(index)
            return [body.loose(held), chosen, body.loose(chosen)]
        }""",
        scene=drawn("thirteen", 0.3),
        held=held,
    )
    directions = np.linalg.svd(np.vstack([S.A.toarray(), np.eye(S.A.shape[1])[held]]))[2]
    free = directions[2 - S.dimension :]
    assert loose == np.flatnonzero(np.abs(free).max(axis=0) > 1e-9).tolist()
    assert len(chosen) == S.dimension == 8 and rest == []


def test_a_pull_is_undone(run):
    before, pulled, after = run(
        "learn/model/scene_in_hand",
        """({ SceneInHand }, { scene }) => {
            const hand = new SceneInHand(scene, () => {}), forces = () => [...hand.body.forces()]
            const before = forces()
            hand.nudge(1)
            const pulled = forces()
            hand.undo()
            return [before, pulled, forces()]
        }""",
        scene=drawn("box", 0.3),
    )
    assert pulled[0] > before[0] + 0.01
    np.testing.assert_allclose(after, before, atol=1e-9)
