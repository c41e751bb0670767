"""Arithmetic of what the page draws, script by script: on a blank page, without a server."""

import re

import numpy as np
import pytest

from app.browser.bundle import APP


def test_a_scene_of_the_other_page_says_where_it_opens(run):
    options = run(
        "browser/scene_options",
        """({ sceneOptions }) => sceneOptions(
            [["groove", "One disk", "Learn"], ["many", "Many disks", "Explore"]], "Explore")""",
    )
    assert 'value="many">Many disks</option>' in options
    assert 'value="groove">One disk → Learn</option>' in options


def test_keeping_all_networks_says_how_long_it_takes(run):
    words = run(
        "packing/player_bar",
        """({ PlayerBar }) => {
            const bar = new PlayerBar({}, () => {}), walk = { states: 1000 }
            bar.showTrack({ last: 1, stride: 20, walk }, 8.7)
            return bar.keep.textContent
        }""",
    )
    assert words == "Keep all (about 9 s)"


def test_every_script_is_a_module_by_itself(run):
    """As they are written, not as they are joined: `module` makes no module of what is none."""
    names = [str(path.relative_to(APP).with_suffix("")) for path in APP.glob("**/*.js")]
    assert len(run(" ".join(names), "(all) => Object.keys(all)")) > len(names) / 2


def test_a_network_is_reached_by_its_number_and_the_stride_is_said(run):
    """Of 60 networks three are stored: only these pass, and count, in a second."""
    walk = WALK | {"states": 60, "number": [0, 1, 21, 41]}
    words, kept, reached, refused = run(
        "packing/replay/replay packing/player_bar",
        """({ Replay, PlayerBar }, { walk }) => {
            const said = [], replay = new Replay(walk)
            const scrub = (to) => { replay.go(to); bar.show(replay) }
            const keep = (number) => keeps.push(number), keeps = []
            const bar = new PlayerBar({ scrub, keep }, (line) => said.push(line))
            const text = () => bar.root.textContent, type = (number) => {
                bar.number.value = number
                bar.number.dispatchEvent(new Event("change"))
                return [bar.number.value, replay.frame, said.pop() ?? "", bar.stored.textContent]
            }
            bar.showTrack(replay, 4)
            const words = text(), kept = !bar.keep.hidden
            const reached = [type("41"), type("12"), type("0")]
            const refused = [type("61"), type("four")]
            bar.showTrack(replay, 0)
            return [words, [kept, !bar.keep.hidden, keeps], [...reached, type("12")], refused]
        }""",
        walk=walk,
    )
    assert "every 20th of 60 is stored" in words and "1 stored network/s" in words
    assert kept == [True, False, [12]]
    every = "every 20th of 60 is stored"
    assert reached[0] == ["41", 3, "", every] and reached[2] == ["0", 0, "", every]
    assert reached[1] == ["21", 2, "12 is not stored: computing all networks.", every]
    assert reached[3] == ["21", 2, "12 is not stored: showing 21.", every]
    assert all(found[:2] == ["0", 0] and "1 to 60" in found[2] for found in refused)


def test_bodies_are_found_by_their_outline_and_lines_turn_with_the_force(run):
    walk = {"centres": [0, 0, 5, 0], "radius": [2.2, 1], "unit": 1, "box": [-1, -1], "tilt": 0}
    walk |= {"outlines": [[-2, -1, 2, -1, 2, 1, -2, 1], []], "window": [-10, 10, -10, 10]}
    walk |= {"starts": [0, 0], "reach": [2, 0], "i": [0], "j": [1], "walls": []}
    found, ends = run(
        "packing/drawing/scene",
        """({ Scene }, { walk }) => {
            const scene = new Scene(() => {})
            scene.show(walk)
            scene.size = 600
            scene.reset(false)
            scene.style = { lean: [1] }
            const places = [[1.9, 0.9], [0, 1.5], [5, 0.9]]
            return [places.map(([x, y]) => scene.diskAt(...scene.toPixel(x, y))), scene.ends(0)]
        }""",
        walk=walk,
    )
    assert found == [0, -1, 1]
    assert ends == pytest.approx([1 - 0.5**0.5, -(0.5**0.5), 1 + 0.5**0.5, 0.5**0.5])


def test_the_line_of_thrust_passes_the_joints_of_an_arch_where_their_forces_do(run):
    middles = [[0, 0], [0, 1], [3, 0], [3, 1]]
    drawn = run(
        "packing/drawing/thrust packing/drawing/svg_context",
        """({ drawThrust, Sheet }, { middles, joints }) => {
            const segments = () => middles.map((middle, k) => ({ k, contact: k, middle }))
            const geometry = { unit: 1, i: [0, 0, 0, 0], j: [1, 1, 2, 2] }, sheet = new Sheet()
            const palette = { known: "green", strong: "black" }
            const scene = { geometry, palette, scale: 100, segments }
            drawThrust(sheet, scene, joints, { normal: [1, 3, 1, 1] })
            return sheet.drawn
        }""",
        middles=middles,
        joints={"a": [0, 2], "b": [1, 3], "low": [0.25, 0], "high": [1, 0.5]},
    )  # fmt: skip
    ends = [
        [one[key] for key in ("x1", "y1", "x2", "y2")] for one in drawn if one["name"] == "line"
    ]
    assert ends == [[0, -0.25, 0, -1], [3, 0, 3, -0.5], [0, -0.75, 3, -0.5]]


@pytest.mark.parametrize("keys", [{}, {"ctrlKey": True}, {"metaKey": True}])
def test_the_wheel_zooms_with_a_key_or_after_a_click_only(run, keys):
    zoomed = run(
        "packing/hand/pointing",
        """({ listen }, keys) => {
            const root = document.body.appendChild(document.createElement("div")), done = []
            root.tabIndex = 0
            listen({ root, zoom: (by) => done.push(by), place: () => [0, 0] })
            const wheel = () => {
                const event = new WheelEvent("wheel", { deltaY: -100, cancelable: true, ...keys })
                root.dispatchEvent(event)
                return event.defaultPrevented
            }
            const before = wheel()
            root.focus()
            const after = wheel()
            root.remove()
            return [before, after, done.length]
        }""",
        **keys,
    )
    assert zoomed == [bool(keys), True, 1 + bool(keys)]


@pytest.mark.parametrize("cancelled", [False, True])
def test_a_picture_on_its_way_is_not_shown_after_cancel(run, cancelled):
    """It was sent before and is painted a frame later, when the old packing is back."""
    shown = run(
        "packing/replay/live",
        """async ({ Live }, { cancelled }) => {
            const shown = [], told = [], player = { loaded: {}, model: { live: true } }
            const live = new Live(player, (message) => told.push(message))
            live.show = (picture) => shown.push(picture)
            live.receive({ picture: { mu: 0.1 }, number: 1 })
            if (cancelled) player.model.live = false
            await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))
            live.remove()
            return [shown.length, told.at(-1).painted]
        }""",
        cancelled=cancelled,
    )
    assert shown == [0 if cancelled else 1, 1]


# Two contacts, four frames, the first one the original.
NORMAL = np.array([[1.0, 2.0], [0.5, 3.0], [2.0, 1.0], [1.5, 2.5]])
TANGENTIAL = np.array([[0.1, -0.2], [0.0, 0.4], [-0.3, 0.1], [0.2, 0.2]])
WALK = {
    "contacts": 2, "mu": 0.5, "friction": [0.5, 0.5], "states": 3, "number": [0, 1, 2, 3],
    "normal": NORMAL.ravel(), "tangential": TANGENTIAL.ravel(),
    "residual": [0.1, 0.2, 0.3, 0.4], "backbone": [7, 8], "unit": 1,
    "origin": "as packed",
}  # fmt: skip


def test_between_two_states_the_straight_line_is_shown(run):
    """Forces, and the number of networks up to there, at 1.3 and back at 1."""
    there, back = run(
        "packing/replay/replay",
        """({ Replay }, { walk }) => {
            const replay = new Replay(walk)
            return [3, 1.3, 1].map((to) => {
                replay.go(to)
                const { mixed, residual, frame, place } = replay
                return {
                    normal: [...mixed.normal], tangential: [...mixed.tangential],
                    frame, residual, place,
                }
            }).slice(1)
        }""",
        walk=WALK,
    )
    normal, tangential = (0.7 * all[1] + 0.3 * all[2] for all in (NORMAL, TANGENTIAL))
    np.testing.assert_allclose(there["normal"], normal, rtol=1e-6)
    np.testing.assert_allclose(there["tangential"], tangential, rtol=1e-6)
    assert (there["residual"], there["place"]) == (0.2, "of 3")
    assert back["frame"] == 1  # the original is no state
    assert back["normal"] == NORMAL[1].tolist()


# A disk of radius 1/2 between two of radius 1, along x: contacts at −1/2 and 1/2.
PRESSED = {
    "contacts": 2, "mu": 0.5, "friction": [0.5, 0.5], "i": [0, 1], "j": [1, 2],
    "starts": [-1.5, 0.0, 0.0, 0.0], "reach": [1.5, 0.0, 1.5, 0.0],
    "centres": [-1.5, 0.0, 0.0, 0.0, 1.5, 0.0], "radius": [1.0, 0.5, 1.0],
    "box": [-1, -1], "tilt": 0,
    "window": [-3, 3, -3, 3], "unit": 1.0,
    "normal": [2.0, 2.0], "tangential": [0.0, 0.0], "low": [1.0, 2.0], "high": [4.0, 2.5],
}  # fmt: skip
MODEL = {
    "scales": {"width": 0.1, "deviation": 4.0}, "most_change": 0.5, "thickness": "normal",
    "colour": "change", "most": 3.0, "full": None, "stretch": 1.5,
    "palettes": {"change": list(range(11)), "mobilised": list(range(11)), "neutral": "grey"},
}  # fmt: skip
TYPED = "Object.assign(walk, { normal: Float32Array.from(walk.normal) })"


def test_width_and_colour_of_a_chain_say_its_force_and_its_change(run):
    width, change, mobilised = run(
        "packing/drawing/chain_style",
        f"""({{ Look }}, {{ model, walk }}) => {{
            const look = new Look(model, {TYPED})
            const mixed = {{ normal: [2.25, 1e-9], tangential: [-1.125, 0] }}
            const {{ width, bin }} = look.of(mixed), change = [...bin]
            model.colour = "mobilised"
            return [[...width], change, [...look.of(mixed).bin]]
        }}""",
        model=MODEL,
        walk=PRESSED,
    )
    assert width == pytest.approx([0.1 * 1.5 * 2.25, 0.0])
    assert change == [round(10 * 0.75), 0]  # a quarter of ⟨fₙ⟩ more; far less
    assert mobilised == [0, 5]  # fₜ = −μ fₙ; nothing


def test_no_chain_is_wider_than_half_its_smaller_disk_and_walls_are_named(run):
    widths, rows = run(
        "packing/drawing/chain_style",
        f"""({{ Look }}, {{ model, walk }}) => {{
            const look = new Look(model, {TYPED})
            const mixed = {{ normal: [90, 90], tangential: [0, 0] }}
            const rows = [0, 1].map((k) => look.contact(k, {{ mixed }}))
            return [[...look.of(mixed).width], rows]
        }}""",
        model=MODEL,
        walk=PRESSED
        | {
            "radius": [0.75, 0.5, 0.0],
            "centres": [-1.5, 0, 0, 0],
            "backbone": [7, 8],
            "number": [0],
        },
    )
    assert widths == [0.5, 0.5]
    assert [row[0][1] for row in rows] == ["7 (disks 0 – 1)", "8 (disks 1 – wall)"]


@pytest.mark.parametrize("colour", ["load", "extent"])
def test_a_colour_that_is_being_computed_is_none_of_its_scale(run, colour):
    colours, bins = run(
        "packing/drawing/chain_style",
        f"""({{ Look }}, {{ model, walk }}) => {{
            const look = new Look(model, {TYPED}), mixed = {{ normal: [1, 2], tangential: [0, 0] }}
            const {{ colours, bin }} = look.of(mixed)
            return [colours, [...bin]]
        }}""",
        model=MODEL | {"colour": colour, "most": 0.0},
        walk=PRESSED | {"free": 3},
    )
    assert (colours, bins) == (["grey"], [0, 0])


def test_stress_on_a_disk_is_that_of_its_contacts(run):
    """Pressed by f along x: σ_xx = 2 f/(πr), σ_yy = 0; forces on both sides of a contact cancel."""
    stress, left, middle = run(
        "packing/drawing/chain_style",
        f"""({{ Look }}, {{ model, walk, mixed }}) => {{
            const look = new Look(model, {TYPED})
            return [look.stressOn(1, mixed), look.forcesOn(0, mixed), look.forcesOn(1, mixed)]
        }}""",
        model=MODEL,
        walk=PRESSED,
        mixed={"normal": [2.0, 2.0], "tangential": [0.3, 0.3]},
    )
    half = 2.0 / (np.pi * 0.5)
    assert stress["pressure"] == pytest.approx(half)
    # n and F are symmetric but for fₜ, which turns the axes: σ_xy = 2 r fₜ/(2πr²) less its mirror.
    assert stress["shear"] == pytest.approx(np.hypot(half, 0.3 / (np.pi * 0.5)))
    assert [left[0]["fx"], left[0]["fy"]] == [-middle[0]["fx"], -middle[0]["fy"]]
    assert [middle[0]["fx"], middle[1]["fx"]] == [2.0, -2.0]


SCENE = """
    const scene = new Scene(() => {})
    scene.palette = { disks: [{}], edge: "grey" }
    scene.size = 600
    scene.ratio = 1
    scene.show(walk)
"""


def test_pixels_and_places_are_each_others_inverse_and_zoom_keeps_the_place(run):
    centre, place, before, after, half = run(
        "packing/drawing/scene",
        f"""({{ Scene }}, {{ walk }}) => {{
            {SCENE}
            const before = scene.toPlace(450, 200)
            scene.zoom(0.5, 450, 200)
            const place = scene.toPlace(...scene.toPixel(0.3, -0.7)), at = scene.view
            return [scene.toPixel(at.x, at.y), place, before, scene.toPlace(450, 200), at.half]
        }}""",
        walk=PRESSED,
    )
    assert centre == [300, 300]
    assert place == pytest.approx([0.3, -0.7])
    assert before == pytest.approx([1.5, 1.0])  # 100 px a unit, y upwards
    assert after == pytest.approx(before)
    assert half == 1.5


def test_the_chain_under_the_pointer_is_the_nearest_and_none_at_a_centre(run):
    on, beside, between, disk, outside = run(
        "packing/drawing/scene",
        f"""({{ Scene }}, {{ walk }}) => {{
            {SCENE}
            const at = (find, x, y) => scene[find](...scene.toPixel(x, y))
            return [at("linkAt", 0.7, 0.02), at("linkAt", -0.7, 0.5), at("linkAt", 0, 0.02),
                at("diskAt", 0.1, 0.1), at("diskAt", 0, 2)]
        }}""",
        walk=PRESSED,
    )
    assert (on, beside, between, disk, outside) == (1, -1, -1, 1, -1)


def test_the_hover_box_follows_the_forces_and_stays_within_the_picture(run):
    shown, inside, left = run(
        "packing/drawing/scene",
        f"""({{ Scene }}, {{ walk }}) => {{
            {SCENE}
            const {{ root, tip }} = scene, box = () => tip.getBoundingClientRect()
            document.body.append(root)
            root.style = "position: relative; width: 600px; height: 600px"
            tip.style = "position: absolute; top: 0; left: 0; width: 500px; height: 40px"
            let force = 1
            scene.describe = {{ contact: () => [["force", force]], grain: () => [["disk", 1]] }}
            scene.finer(600)
            scene.drawDisks()
            scene.stale = false
            const style = {{ width: [0.2, 0.2], bin: [0, 0], colours: ["blue"] }}
            scene.drawChains(style)
            scene.hover(...scene.toPixel(0.7, 0.02))
            const shown = [tip.textContent], whole = root.getBoundingClientRect()
            const inside = box().left >= whole.left && box().right <= whole.right
            force = 2
            scene.drawChains(style)
            shown.push(tip.textContent)
            scene.show(walk) // other networks: nothing is under the pointer yet
            return [shown, inside, tip.classList.contains("on")]
        }}""",
        walk=PRESSED,
    )
    assert shown == ["force1", "force2"]
    assert inside and not left


def test_the_field_of_a_force_shows_the_force_on_screen_once_a_value_was_entered(run):
    typed, entered, pulls = run(
        "packing/buttons",
        """({ Buttons }) => {
            const pulls = [], root = document.createElement("div")
            const actions = { pull: () => pulls.push(buttons.force), hold: () => {} }
            const buttons = new Buttons({ root }, actions, { look: () => {}, open: () => {} })
            const field = buttons.part("force")
            buttons.showForce(0.5)
            field.value = 9
            field.dispatchEvent(new Event("input"))
            buttons.showForce(0.6)
            const typed = field.value
            field.dispatchEvent(new Event("change"))
            buttons.showForce(0.7)
            return [typed, field.value, pulls]
        }""",
    )
    assert (typed, entered, pulls) == ("9", "0.700", [9])


def test_the_line_of_the_selected_contact_is_outlined_and_not_covered(run):
    line, mark, outline = run(
        "packing/drawing/scene",
        f"""({{ Scene }}, {{ walk }}) => {{
            {SCENE}
            scene.finer(600)
            Object.assign(scene.palette, {{ selected: "red", halo: "white" }})
            scene.selected = 1
            scene.drawDisks()
            scene.stale = false
            scene.drawChains({{ width: [0.2, 0.2], bin: [0, 0], colours: ["blue"] }})
            const at = (layer, place) =>
                [...scene[layer].getImageData(...scene.toPixel(...place), 1, 1).data]
            return [at("chains", [1, 0]), at("marks", [1, 0]), at("marks", [1, 0.14])]
        }}""",
        walk=PRESSED,
    )
    assert line == [0, 0, 255, 255]
    assert mark == [0, 0, 0, 0]
    assert outline == [255, 0, 0, 255]


def test_chains_too_thin_or_out_of_sight_are_not_drawn(run):
    whole, part = run(
        "packing/drawing/scene",
        f"""({{ Scene }}, {{ walk }}) => {{
            {SCENE}
            scene.repaint() // there is a picture from now on
            scene.drawChains({{ width: [0.2, 1e-4], bin: [0, 0], colours: ["red"], alpha: 1 }})
            const whole = scene.counts
            scene.view = {{ x: 2.5, y: 0, half: 0.5 }}
            scene.drawChains({{ width: [0.2, 0.2], bin: [0, 0], colours: ["red"], alpha: 1 }})
            return [whole, scene.counts]
        }}""",
        walk=PRESSED,
    )
    assert whole == {"segments": 2, "drawn": 1, "outside": 0, "thin": 1}
    assert part == {"segments": 2, "drawn": 0, "outside": 2, "thin": 0}


def test_a_displacement_goes_out_by_a_mean_radius_and_back_but_never_the_opposite_way(run):
    ways, out, rests = run(
        "packing/drawing/scene packing/drawing/displacement",
        f"""({{ Scene, Sway }}, {{ walk, field }}) => {{
            {SCENE}
            document.body.append(scene.root)
            const sway = new Sway(scene)
            const shifts = () => [0, 1, 2].map((k) => [scene.shift(k, 0), scene.shift(k, 1)])
            sway.take(field)
            sway.began = 300
            const at = (time) => {{ sway.swing(300 + time); return shifts() }}
            const ways = Array.from({{ length: 23 }}, (_, k) => at(100 * k)), out = at(1100)
            sway.take(null)
            return [ways, out, shifts()]
        }}""",
        walk=PRESSED,
        field=[0.0, 0.0, 0.3, 0.4, 0.0, -0.25],
    )
    mean = np.mean([r for r in PRESSED["radius"] if r > 0])
    expected = mean / 0.5 * np.array([[0, 0], [0.3, 0.4], [0, -0.25]])
    np.testing.assert_allclose(out, expected, atol=1e-12)
    np.testing.assert_allclose([ways[0], ways[-1]], 0, atol=1e-12)
    assert np.min(np.array(ways) * np.sign(expected)) > -1e-12
    assert rests == [[0, 0]] * 3


def test_the_path_in_force_space_ends_where_the_replay_is(run):
    """On the straight line between two states, in pixels, behind the states that it came by."""
    drawn = run(
        "packing/replay/replay packing/drawing/plot_layer",
        """({ Replay, LAYERS }, { walk }) => {
            const replay = new Replay(walk), moved = []
            replay.go(2.5)
            const context = {
                arc: (x, y) => moved.push([x, y]), moveTo: (...to) => moved.push(to),
                lineTo: (...to) => moved.push(to),
                beginPath() {}, fill() {}, stroke() {}, fillRect() {},
            }
            const column = { x: [0, 1, 3, 4], y: [0, 10, 20, 0] }
            const plots = {
                colours: {}, placed: { drawn: 0, count: 0 },
                find: () => ({ get_column: (name) => column[name] }),
            }
            LAYERS.path(context, { x: (v) => 100 * v, y: (v) => -v }, plots, replay)
            return moved
        }""",
        walk=WALK,
    )
    assert drawn[:2] == [[0, 0], [100, -10]]
    assert drawn[-2:] == [[350, -10], [350, -10]]  # the line's end, and the point


def test_a_dot_is_taken_within_its_reach_only(run):
    found = run(
        "packing/drawing/plot_layer",
        """({ Handles }) => {
            const column = { x: [0, 1], y: [0, 1] }
            const plots = { find: () => ({ get_column: (name) => column[name] }) }
            const handles = new Handles(plots, "bars", "bars", ["x", "y"], {})
            handles.remove()
            const scale = { compute: (v) => 100 * v }, frame = { x_scale: scale, y_scale: scale }
            const element = { getBoundingClientRect: () => ({ left: 10, top: 20 }) }
            const at = (x, y, pointerType) =>
                handles.nearest({ clientX: x + 10, clientY: y + 20, pointerType }, element, frame)
            return [at(95, 105, "mouse"), at(80, 100, "mouse"), at(80, 100, "touch")]
        }""",
    )
    assert found == [1, -1, 1]


# A rail of three networks of contact 0, whose normal force it is by.
RAIL = {
    "contact": 0, "lower": 1.0, "upper": 4.0, "values": [1.0, 2.0, 4.0],
    "normal": [1.0, 3.0, 2.0, 2.0, 4.0, 0.0], "tangential": [0.0, 0.0, 0.5, 0.1, 1.0, 0.0],
    "residual": [0.1, 0.3, 0.2], "opened": [0, 0, 0, 1], "sliding": [0, 1, 0, 0],
}  # fmt: skip
HAND = """
    const source = {}, said = []
    const player = {
        scene: { size: 600 }, model: { scale: "mean" }, look: {}, replay: new Replay(walk),
        buttons: { part: () => source }, say() {}, tellHeld() {}, paint() {}, paintPlots() {},
        plots: { projected: ({ normal }) => [...normal], move() {} },
    }
    player.replay.go(1)
    const hand = new Grab(player, (message) => said.push(message))
"""


def test_a_force_in_the_hand_follows_its_rail_to_its_ends(run):
    """By straight lines between the networks of the rail; at an end it says who holds it there."""
    middle, end, holding, begun = run(
        "packing/replay/replay packing/hand/drag_force",
        f"""({{ Replay, Grab }}, {{ walk, rail }}) => {{
            {HAND}
            Object.assign(hand, {{ contact: 0, grip: [300, 300], point: [300, 300] }})
            hand.place = () => 3
            hand.takeRail(rail)
            const shown = () => ({{
                value: hand.value, normal: [...player.replay.held.normal],
                tangential: [...player.replay.held.tangential],
                residual: player.replay.held.residual, end: hand.end,
            }})
            const middle = shown(), begun = hand.valueAt(300)
            hand.set(9)
            return [middle, shown(), hand.holding, begun]
        }}""",
        walk=WALK,
        rail=RAIL,
    )
    # Halfway from the second network to the third, with the larger of their residuals.
    expected = {"value": 3, "normal": [3, 1], "tangential": [0.75, 0.05], "residual": 0.3, "end": 0}
    tangential = middle.pop("tangential")
    assert tangential == pytest.approx(expected.pop("tangential"))
    assert middle == expected
    assert (end["value"], end["normal"], end["end"]) == (4, [4, 0], 1)
    assert holding == {"opened": [1], "sliding": []}  # contact 0 slid before
    assert begun == pytest.approx(NORMAL[1, 0])  # where it was taken, it has the force it had


@pytest.mark.parametrize("way", ["pullTo(9)", "pullToEnd(1)"], ids=["typed", "button"])
def test_a_force_beyond_its_interval_is_pulled_to_the_end_with_the_reason(run, way):
    """From there again, too: the reason compares with the network before any pull."""
    said, words, again = run(
        "packing/replay/replay packing/hand/drag_force",
        f"""({{ Replay, Grab }}, {{ walk, rail }}) => {{
            {HAND}
            let words = ""
            const pushed = {{ leave() {{}} }}, say = (line) => {{ words = line }}
            Object.assign(player, {{ say, live: {{}}, playback: {{}}, pushed }})
            Object.assign(player.look, {{ boundsOf: () => [rail.lower, rail.upper] }})
            Object.assign(player.scene, {{ closeTip() {{}} }})
            player.model.contact = 0
            hand.{way}
            hand.receive({{ rail: {{ ...rail, contact: 0, whole: true }} }})
            const first = words
            player.replay.mix()
            hand.{way}
            hand.receive({{ rail: {{ ...rail, contact: 0, whole: true }} }})
            return [said, first, words]
        }}""",
        walk=WALK,
        rail=RAIL,
    )
    assert said == [{"grab": 0}, {"pull": [0, 4]}, {"grab": 0}]  # it is there already
    assert words == again
    assert "largest force, 4.000: it stops because 1 contact opened and 0 began" in words


@pytest.mark.parametrize(
    "target, reached",
    [([1.0, 0.5], [1.0, 0.5]), ([0.5, 3.0], [0.5, 2.0]), ([9.0, 9.0], [2.0, 2.0])],
    ids=["inside", "beyond an edge", "beyond a corner"],
)
def test_the_point_in_force_space_stays_within_the_outline(run, target, reached):
    """Here the two normal forces are the coordinates: the network must be the point itself."""
    normal = run(
        "packing/replay/replay packing/hand/drag_force",
        f"""({{ Replay, Grab }}, {{ walk, fan, target }}) => {{
            {HAND}
            hand.spot.target = target
            hand.spot.spread(fan)
            return [...player.replay.held.normal]
        }}""",
        walk=WALK | {"normal": np.ones(8)},  # at (1, 1), inside
        fan={
            "x": [0, 2, 2, 0], "y": [0, 0, 2, 2], "normal": [0, 0, 2, 0, 2, 2, 0, 2],
            "tangential": [0] * 8, "residual": [0, 0, 0, 0],
        },
        target=target,
    )  # fmt: skip
    assert normal == pytest.approx(reached, abs=1e-6)


@pytest.mark.parametrize(
    "unit, bodies, words, size",
    [
        (1.0, False, "5 largest radii", 500),
        (0.3, True, "1, in the unit of the bodies", 100),
        (0.05, True, "0.2, in the unit of the bodies", 20),
    ],
)
def test_the_scale_of_a_picture_is_a_round_length_of_bodies(run, unit, bodies, words, size):
    text = run(
        "packing/drawing/svg_context",
        """({ Sheet, PIXELS }, { unit, bodies }) => {
            const half = PIXELS / 200, window = [-half, half, -half, half]
            const bar = { low: "0", high: "1", stops: ["black", "white"] }, background = "white"
            const caption = { background, ink: "black", bar, width: 0.23, lines: [] }
            return new Sheet().svg(window, { ...caption, unit, bodies })
        }""",
        unit=unit,
        bodies=bodies,
    )
    assert f">{words}</text>" in text and f'width="{size}" height="4"' in text


def test_the_caption_of_a_picture_fits_and_its_line_is_as_wide_as_it_says(run):
    """Also an address, which has no spaces to break it at."""
    address = "granforce ?n=400&mu=0.4&states=200&relax=nearest&hold=47%3A1.495806134&tab=export"
    text, widest = run(
        "packing/drawing/svg_context",
        """({ Sheet, PIXELS }, { lines }) => {
            const high = "≥ 1.54⟨fₙ⟩ (exact given the held forces, this packing)"
            const window = [-9, 9, -9, 9]
            const bar = { low: "0", high, stops: ["black", "white"] }
            const given = { background: "white", ink: "black", bar, width: 0.23, lines, unit: 1 }
            const text = new Sheet().svg(window, given)
            document.body.innerHTML = text
            const ends = [...document.querySelectorAll("text")].map((one) => {
                const { x, width } = one.getBBox()
                return x + width
            })
            return [text, Math.max(...ends) / PIXELS]
        }""",
        lines=["A line of words. " * 12, 3 * address],
    )
    assert widest <= 1
    assert ">≥ 1.54⟨fₙ⟩</text>" in text  # short, as the line with a width begins next to it
    assert ">Colours: exact given the held forces, this packing.</text>" in text
    (force,) = re.findall(r"width: ([\d.]+) ⟨fₙ⟩", text)
    (drawn,) = re.findall(r'width="40" height="([\d.]+)"', text)
    assert float(drawn) == pytest.approx(float(force) * 0.23 * 50)


def test_a_pull_is_back_after_a_push(run):
    """The network of before, without asking the server, also if it changed during the push."""
    said, held, shown, told = run(
        "packing/hand/push_animation packing/hand/drag_force",
        """({ Pushed, Grab }) => {
            const shown = [], told = [], said = [], held = [], nothing = () => {}
            const walk = {
                contacts: 1, normal: new Float32Array([1, 2]), tangential: new Float32Array(2),
                residual: [0, 0], origin: "as packed", backbone: [0],
            }
            const replay = { walk, position: 1, frame: 1, held: null }
            const player = {
                replay, pushable: true, live: {}, model: { frame: 1 }, look: {}, say: nothing,
                scene: { drawMarks: nothing, style: null }, sway: { take: nothing },
                show: (to, tell = true) => { shown.push([to, tell]); replay.position = to },
                again: nothing, tellHeld: (cause) => said.push(cause), repaintHeld: nothing,
            }
            const hand = player.hand = new Grab(player, (message) => told.push(message))
            const pushed = player.pushed = new Pushed(player)
            const pulled = (fn) => ({ normal: [fn], tangential: [0], residual: 0, pull: [0, fn] })
            const path = { values: [0, 1], normal: [1, 2], tangential: [0, 0], residual: [0, 0] }
            const look = () => held.push([replay.held.normal[0], replay.held.place ?? "pulled"])
            hand.receive({ held: pulled(3) })
            look()
            pushed.begin()
            look()
            pushed.take(path, 0.5, 0.5, null)
            look()
            hand.receive({ held: pulled(4) })
            look()
            pushed.leave()
            look()
            pushed.leave()
            return [said, held, shown, told]
        }""",
    )
    pushed = [1.5, "pushed"]
    assert held == [[3, "pulled"], [1, "as packed"], pushed, pushed, [4, "pulled"]]
    assert said == ["pull", "push", "push", "pull"]
    assert shown == [[0, False], [1, False]]  # the server never hears of another network
    assert told == []
