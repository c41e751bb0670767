"""The workbench by its script alone: the server's answers that arrive late."""

import pytest
from test_polytope import drawn

# The page without a server: `late` is an answer to the first request, held back until S is another.
LATE = """async ({ render }, { scene, other, late, change }) => {
    const heard = {}, asked = []
    const model = {
        scene, titles: [["many", "Many disks", "Explore"], ["column", "Column", "Learn"]],
        large: [], note: "", dark: false,
        on: (what, act) => { heard[what] = act }, send_msg: (message) => asked.push(message),
    }
    const view = { model: { document: { on_event() {}, create_json_patch() {} } } }
    const root = render({ model, view })
    document.body.replaceChildren(root)
    const frame = () => new Promise((done) => requestAnimationFrame(done))
    const request = async (what) => {
        while (!asked.some(({ find }) => find === what)) await frame()
        return asked.findLast(({ find }) => find === what)
    }
    const answer = { ...late, ...(await request("measured")) }
    const fixed = async () => {
        heard["msg:custom"](answer)
        await frame(), await frame()
        const values = [...root.querySelectorAll(".bars .value")]
        return values.some((value) => value.textContent.includes("(fixed)"))
    }
    const before = await fixed()
    if (change === "load") {
        root.querySelector(".push").click()
        const key = new KeyboardEvent("keydown", { key: "ArrowRight", bubbles: true })
        root.querySelector(".packing").dispatchEvent(key)
    } else {
        model.scene = other
        heard.scene()
    }
    const after = await fixed()
    heard.remove()
    return [before, after]
}"""


@pytest.mark.parametrize("change", ["load", "scene"])
def test_an_answer_for_another_s_is_dropped(run, change):
    scene = drawn("column", 0.3)
    late = {"measured": {"bounds": [[0, 0]] * len(scene["i"]), "outline": []}}
    other = scene | {"load": [2 * v for v in scene["load"]]}
    shown = run(
        "learn/workbench/workbench", LATE, scene=scene, other=other, late=late, change=change
    )
    assert shown == [True, False]
