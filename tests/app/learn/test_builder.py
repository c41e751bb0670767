"""The builder by its script alone: what it refuses, and how its steps are undone."""

BUILDER = """({ Builder }, { text, does }) => {
    const host = document.body.appendChild(document.createElement("div")), sent = []
    const builder = new Builder(host, (built) => sent.push(built))
    const how = () => host.querySelector(".how").textContent
    builder.read(text, false)
    const step = {
        press: (at) => builder.press(at, 60),
        carry: (at) => builder.carry(at),
        release: () => builder.release(),
        tool: (name) => { builder.tool = name },
        undo: () => { builder.undo(); builder.read(sent.at(-1), false) },
    }
    const answers = does.map(([name, given]) => {
        step[name](given)
        return [sent.at(-1) ?? "", how(), builder.undos.length]
    })
    host.remove()
    return answers
}"""
SCENE = "1,1,1;3,1,1|0,0,7,0"


def built(run, *does):
    return run("learn/workbench/builder", BUILDER, text=SCENE, does=does)


def test_a_disk_that_is_added_and_carried_is_one_step_to_undo(run):
    *_, carried, released, undone = built(
        run, ["press", [5, 3]], ["carry", [5.5, 3]], ["carry", [6, 3]], ["release", None],
        ["undo", None],
    )  # fmt: skip
    assert carried[0].startswith("1,1,1;3,1,1;6,3,1|") and released[2] == 1
    assert undone[0] == SCENE and undone[2] == 0


def test_what_would_overlap_is_refused_in_words(run):
    (_, how, undos), *_ = built(run, ["press", [2, 1.9]])
    assert "may touch, but not overlap" in how and undos == 0
    *_, (sent, how, _) = built(
        run, ["tool", "wall"], ["press", [0.5, 1]], ["carry", [3, 1]], ["release", None]
    )
    assert how == "No wall here: it would cut a body." and sent == ""
    *_, (_, how, _) = built(run, ["press", [1, 1]], ["carry", [3, 1.3]])
    assert how == "There is no room there."


def test_a_scene_without_a_load_has_no_count_of_equations(run):
    words = run(
        "learn/model/sentences",
        "({ counted }, body) => counted(body)",
        h=0,
        count=11,
        empty=True,
        scene={"idle": True, "r": [1] * 5, "pressing": [], "box": [0, 0]},
    )
    assert "22 unknown force components" in words and "equations" not in words


def test_a_tab_remembers_the_last_packing_of_the_visitor_and_the_last_chapter(run):
    kept = run(
        "browser/local_storage",
        """({ keepChapter, keepView, lastChapter, lastPacking, lastView }) => {
            keepChapter("box")
            for (const query of ["?packing=abc&mu=0.3", "?n=400&mu=1"]) keepView(query)
            return [lastChapter(), lastPacking(), lastView()]
        }""",
    )
    assert kept == ["box", "?packing=abc&mu=0.3", "?n=400&mu=1"]
