"""Learn, played from the first prediction to the last answer, on the store that ships."""

import re

import pytest
from serving import chain, expect, scene, serve, until
from small_store import cell_parameters

from granforce.study import cells as study
from granforce.study import kinds
from granforce.study.store import open_store

WORDS = 70  # at most, before the hand acts
# Name of each chapter: its heading; keys that carry the dot to the answer; the answer.
RIGHT = ["ArrowRight"] * 60
ROUND = [arrow for arrow in ("ArrowUp", "ArrowLeft", "ArrowDown", "ArrowRight") for _ in range(60)]
CHAPTERS = {
    "four-hundred": ("Pull one force", RIGHT, None),
    "ladder": ("Which will it be?", ["ArrowLeft"] * 60 + RIGHT, "0.23 to 0.38"),
    "groove": ("How hard can a wall press?", RIGHT, "μ = 1.00"),
    "box": ("How much can the floor carry?", RIGHT + ROUND, "2.86"),
    "thirteen": ("When is everything fixed?", [], "8"),
    "chance": ("How far does chance go?", ["ArrowRight", "End"], None),
    "friction": ("Where are forces least determined?", RIGHT[:15] + ["ArrowLeft"] * 25, "μ = 0.2"),
    "push": ("When does something move?", RIGHT, None),
}
SCENES = ("ladder", "groove", "box", "thirteen")
COUNTS = {"groove": "4 − 3", "box": "8 − 6", "thirteen": "46 − 38"}


@pytest.fixture(scope="module")
def lesson(tmp_path_factory):
    """Address of the app on the store that ships."""
    with serve(tmp_path_factory.mktemp("lesson")) as (url, _):
        yield url


def dot(page):
    return page.locator("figure").get_by_role("slider").nth(1)


def in_view(part):
    """Whether a part of a page of 844 px is on screen as it is scrolled."""
    box = part.bounding_box()
    return box["y"] >= 0 and box["y"] + box["height"] <= 844


def places(drawn):
    """The numbers in an attribute of a drawing."""
    return [float(number) for number in re.findall(r"-?[\d.]+", drawn)]


def predict(page, steps=20):
    """Put the marker by keys, and let the prediction stand."""
    marker = page.get_by_role("slider", name="your prediction")
    marker.focus()
    for _ in range(steps):
        page.keyboard.press("ArrowRight")
    page.get_by_role("button", name="That is my prediction").click()


# The tip of an arrow that pushes the disks of the marked line apart, and its direction.
ARROW = """({ scene }) => {
    const { geometry } = scene, box = scene.root.getBoundingClientRect()
    const [{ k, a, b }] = scene.segments((contact) => contact === scene.selected)
    const [p, q] = [a, b].map((at) => scene.toPixel(...at))
    const far = Math.hypot(q[0] - p[0], q[1] - p[1])
    const along = [(q[0] - p[0]) / far, (q[1] - p[1]) / far]
    const long = scene.scale * (0.3 * geometry.radius[geometry.j[k]] + 0.8 * geometry.unit)
    return [box.left + q[0] + long * along[0], box.top + q[1] + long * along[1], along]
}"""


# Whether the last line is above the row of buttons.
CLEAR = """(article) => {
    const [last, row] = [".voice > :last-child", ".row"].map((part) => article.querySelector(part))
    return last.getBoundingClientRect().bottom <= row.getBoundingClientRect().top
}"""


def press(page, keys):
    """Press keys on the dot, once it can be dragged."""
    page.locator(".now.movable").wait_for()
    dot(page).focus()
    for key in keys:
        page.keyboard.press(key)


def test_every_chapter_is_played_from_prediction_to_answer(opening, lesson):
    page, answers = opening("?learn", 1280, 800, at=lesson), {}
    for name, (heading, keys, answer) in CHAPTERS.items():
        page.get_by_role("heading", name=heading).wait_for()
        question = page.locator("article strong")
        question.wait_for()
        assert len(page.locator("article > p").first.inner_text().split()) <= WORDS, name
        found = page.get_by_text(re.compile("^(It is|Anything from) "))
        expect(found).to_have_count(0)  # no answer is shown before
        expect(page.get_by_role("button", name="That is my prediction")).to_be_disabled()
        predict(page)
        page.locator(".voice p").filter(
            has_text=re.compile("Drag the dot|Click an arrow|Press “Walk”")
        ).wait_for()
        more = page.get_by_role("link", name="More with this scene")
        expect(more.filter(visible=True)).to_have_count(0)
        if name == "thirteen":
            for _ in range(8):
                page.get_by_role("button", name="Hold another force").click()
        (page.get_by_role("slider", name="walk") if name == "chance" else dot(page)).focus()
        for key in keys:
            page.keyboard.press(key)
            if key == "ArrowRight" and name in ("friction", "chance"):
                expect(found).to_have_count(0)  # both sides, or the whole walk
        found.wait_for()
        expect(more.filter(visible=True)).to_have_count(int(name in SCENES))
        told = page.locator(".voice").inner_text()
        assert answer is None or f" {answer}." in told, name
        assert page.locator("article").evaluate(CLEAR), name
        words = page.locator("article").inner_text()
        assert "You predicted" in told and COUNTS.get(name, "") in words
        answers[name] = re.search(r"It is (\d[\d.]*\d)\.|$", told)[1]
        assert ("S, all sets of forces" in words) == (name == "friction"), name
        assert ("− 2" in words and "+ 1" in words) == (name == "thirteen"), name
        if name != "push":
            page.get_by_role("button", name="Next").click()
    expect(page.get_by_title("done")).to_have_count(8)
    told = re.compile(
        "^Your predictions. .*; A ladder.*: 0.20, answer 0.23 to 0.3.*; Largest push .*: "
    )
    page.get_by_role("img", name=told).wait_for()
    for words, ending in (("Save as a picture", r"png"), ("Save as a movie", r"mp4|webm")):
        with page.expect_download() as saved:
            page.get_by_role("button", name=words).click()
        assert re.fullmatch(f"granforce-lesson.({ending})", saved.value.suggested_filename)
    # A finished chapter is shown with its answer again, until it is begun anew.
    for name in ("thirteen", "chance", "push"):  # of each kind of experiment one
        answer = CHAPTERS[name][2]
        page.goto(f"{lesson}?learn={name}")
        found.wait_for()
        told = page.locator(".voice").inner_text()
        assert f"It is {answer or answers[name]}." in told and "You predicted" in told, name
        expect(page.get_by_title("done")).to_have_count(8)
    page.get_by_role("button", name="Again").click()
    page.get_by_role("button", name="That is my prediction").wait_for()
    expect(page.get_by_title("done")).to_have_count(7)
    page.get_by_role("navigation").get_by_role("link", name="Build your own").click()
    page.get_by_role("radio", name="Gravity").wait_for()


def test_the_last_questions_are_on_the_pages_that_answer_them(opening, lesson):
    page = opening("?scene=stones&asked=stones", 1280, 900, first=True, at=lesson)
    question = page.get_by_text("do three stones stand as an arch?")
    question.wait_for()
    page.get_by_role("combobox", name="Scene").select_option("ladder")
    expect(question).to_have_count(0)
    page = opening("?asked=hold", 1280, 900, at=lesson)
    page.get_by_text("Click a line and press H").wait_for()
    expect(page.get_by_text("left out of this link")).to_have_count(0)


def test_a_chapter_is_dragged_with_the_mouse_and_only_what_was_touched_of_s_is_drawn(
    opening, lesson
):
    page = opening("?learn=groove", 390, 844, first=True, at=lesson)
    page.locator("article strong").wait_for()
    assert in_view(page.get_by_role("button", name="That is my prediction"))
    predict(page, 30)
    expect(page.locator("path.exact")).to_have_attribute("d", "")
    circle = dot(page).locator("circle")
    circle.scroll_into_view_if_needed()
    box = circle.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    assert in_view(page.get_by_text("Drag the dot"))
    page.mouse.move(x + 30, y, steps=4)
    assert page.locator("path.visited").get_attribute("d") != ""
    expect(page.locator("path.exact")).to_have_attribute("d", "")
    page.mouse.move(x, y - 200, steps=4)
    gives = page.get_by_text("with more, the disk would move")
    gives.wait_for()
    page.mouse.move(x + 300, y, steps=4)
    page.mouse.up()
    expect(gives).to_have_count(0)
    verdict = page.get_by_text("It is μ = 1.00.")
    verdict.wait_for()
    page.wait_for_function(
        "(told) => told.getBoundingClientRect().bottom < 844", arg=verdict.element_handle()
    )
    assert in_view(page.get_by_role("button", name="Next"))
    assert page.locator("path.exact").get_attribute("d") != ""
    assert page.evaluate("document.documentElement.scrollWidth") <= 390


def test_back_goes_through_chapters_and_a_frame_shows_one_alone(opening, lesson):
    page = opening("?learn=box", 1280, 900, at=lesson)
    page.get_by_role("button", name="Next").click()
    page.get_by_role("heading", name="When is everything fixed?").wait_for()
    assert page.url.endswith("learn=thirteen")
    page.go_back()
    page.get_by_role("heading", name="How much can the floor carry?").wait_for()
    page.get_by_role("button", name="Back").click()
    page.get_by_role("heading", name="How hard can a wall press?").wait_for()
    alone = opening("?learn=box&embed=1", 700, 700, at=lesson)
    alone.get_by_role("heading", name="How much can the floor carry?").wait_for()
    alone.locator("article strong").wait_for()
    expect(alone.get_by_role("button", name="Next")).to_be_hidden()
    expect(alone.get_by_role("navigation").filter(visible=True)).to_have_count(0)


def test_the_way_back_from_more_disks_leads_to_the_same_chapter(opening, lesson):
    page = opening("?learn=box", 1280, 900, first=True, at=lesson)
    page.locator("article strong").wait_for()
    predict(page)
    friction = page.get_by_role("slider", name="friction μ")
    expect(friction).to_be_hidden()
    press(page, RIGHT + ROUND)
    for mu, words in (("0.35", "from 1.72 to 3.08"), ("0", "one point, 2.00"), ("0.45", "no end")):
        friction.fill(mu)
        page.get_by_text(f"μ = {mu}: ").filter(has_text=words).wait_for()
    page.get_by_text("such forces cancel").wait_for()
    # An unbounded S leaves the plot, marked by an arrow.
    assert min(places(page.locator("path.exact").get_attribute("d"))) < 0
    expect(page.locator(".further text").first).to_have_text("∞")
    friction.fill("0.3")
    expect(page.locator(".further > *")).to_have_count(0)
    page.get_by_role("link", name="More with this scene").click()
    page.get_by_role("button", name="Random walk").wait_for()
    page.go_back()
    page.get_by_text("It is 2.86.").wait_for()


def test_a_prediction_is_not_moved_by_a_grasp_and_stays_within_the_possible(opening, lesson):
    page = opening("?learn=chance", 1280, 900, first=True, at=lesson)
    page.locator("article strong").wait_for()
    words = page.locator(".text").inner_text()
    high = float(re.search(r"up to ([\d.]*\d)", words)[1])
    marker = page.get_by_role("slider", name="your prediction")
    start = float(marker.get_attribute("aria-valuenow"))
    assert start == pytest.approx(float(dot(page).get_attribute("aria-valuenow")), abs=1e-6)
    marker.focus()
    for _ in range(10):
        page.keyboard.press("ArrowRight")
    predicted = float(marker.get_attribute("aria-valuenow"))
    box = marker.locator("rect").bounding_box()
    x, y = box["x"] + 0.8 * box["width"], box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 1, y)
    assert float(marker.get_attribute("aria-valuenow")) == pytest.approx(predicted, abs=0.03)
    page.mouse.move(x + 300, y)
    assert float(marker.get_attribute("aria-valuenow")) == pytest.approx(high, abs=0.006)
    page.mouse.move(x - 500, y)
    page.mouse.up()
    assert float(marker.get_attribute("aria-valuenow")) == pytest.approx(start, abs=1e-6)
    # After the walk the hand goes on to the end.
    page.get_by_role("button", name="That is my prediction").click()
    page.get_by_role("slider", name="walk").press("End")
    press(page, RIGHT)
    assert float(dot(page).get_attribute("aria-valuenow")) == pytest.approx(high, abs=0.006)


def test_without_a_stored_packing_the_lesson_begins_with_the_ladder(opening, tmp_path):
    shipped = tmp_path / "start.zarr"
    study.get(open_store(shipped), kinds.WALK, cell_parameters(1.0), dtypes={"states": "float32"})
    with serve(tmp_path, GRANFORCE_DATA=str(shipped)) as (url, _):
        page = opening("?learn", 1280, 900, first=True, at=url)
        page.get_by_role("heading", name="Which will it be?").wait_for()
        page.locator("article strong").wait_for()
        page.close()  # before its server ends


def test_the_marked_line_goes_a_little_way_before_the_prediction(opening, lesson):
    page = opening("?learn", 1280, 900, first=True, at=lesson)
    page.locator("article strong").wait_for()
    until(page, "scene.selected !== null")
    value = float(dot(page).get_attribute("aria-valuenow"))
    x, y = page.locator(".scene").evaluate(
        """({ scene }) => {
            const [{ a, b }] = scene.segments((contact) => contact === scene.selected)
            const box = scene.root.getBoundingClientRect()
            const [x, y] = scene.toPixel((a[0] + b[0]) / 2, (a[1] + b[1]) / 2)
            return [box.left + x, box.top + y]
        }"""
    )
    for up in (400, -400):
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x, y - up, steps=4)
        page.get_by_text("It goes further. First predict how far.").wait_for()
        page.mouse.up()
    predict(page)
    expect(page.get_by_text(re.compile("^It is "))).to_have_count(0)
    press(page, RIGHT)
    answer = float(page.get_by_text(re.compile("^It is ")).inner_text()[6:-1])
    assert answer > value + 0.5
    page.get_by_text("other forces follow").wait_for()


def test_eight_held_forces_fix_all(opening, lesson):
    page = opening("?learn=thirteen", 1280, 900, first=True, at=lesson)
    page.locator("article strong").wait_for()
    hold = page.get_by_role("button", name="Hold another force")
    expect(hold).to_be_hidden()
    predict(page)
    drawn = "(canvas) => canvas.toDataURL()"
    before = page.locator(".picture canvas").evaluate(drawn)
    box = page.locator(".picture canvas").bounding_box()
    for k in range(40):  # a click in a row across the picture meets an arrow
        page.mouse.click(box["x"] + box["width"] * (k + 0.5) / 40, box["y"] + box["height"] / 2)
        if dot(page).get_attribute("aria-valuenow") == "1":
            break
    picture = page.locator(".picture canvas").element_handle()
    page.wait_for_function(
        f"([picture, before]) => ({drawn})(picture) !== before", arg=[picture, before]
    )
    for held in range(2, 9):
        hold.click()
        expect(dot(page)).to_have_attribute("aria-valuenow", str(held))
    page.get_by_text("It is 8.").wait_for()
    expect(hold).to_be_hidden()


def test_a_friend_sends_a_challenge(opening, lesson):
    page = opening("?learn=four-hundred&said=3.21", 1280, 900, first=True, at=lesson)
    page.get_by_text("A friend’s prediction is shown after yours.").wait_for()
    expect(page.get_by_text("3.21")).to_have_count(0)
    predict(page)
    page.locator(".voice p").filter(has_text="Drag the dot").wait_for()
    press(page, RIGHT)
    page.get_by_text("Your friend: 3.21; your friend was closer.").wait_for()
    page.locator("figure").get_by_text("your friend").wait_for()
    page.get_by_role("button", name="Challenge a friend").click()
    assert page.evaluate("navigator.clipboard.readText()").endswith("?learn=four-hundred&said=4.54")


def test_the_numbers_under_the_friction_plot_are_those_of_the_packing_on_screen(opening, lesson):
    page = opening("?learn=friction", 1280, 900, first=True, at=lesson)
    page.locator("article strong").wait_for()
    predict(page, 1)
    press(page, [])
    for key in (None, "ArrowRight", "ArrowRight"):
        if key:
            dot(page).press(key)
        mu, contacts = (scene(page, f"scene.geometry.{name}") for name in ("mu", "contacts"))
        rows = page.locator(".extra tr").all_inner_texts()
        assert rows[0].startswith(f"μ = {mu:g}: ") and f"2 × {contacts} " in rows[1]
        assert dot(page).get_attribute("aria-valuetext") == f"μ = {mu:g}"


def test_the_same_disks_are_pushed_from_other_forces_and_every_limit_stays(opening, lesson):
    page = opening("?learn=push", 1280, 900, first=True, at=lesson)
    page.locator("article strong").wait_for()
    predict(page)
    other = page.get_by_role("button", name="Take other forces in S")
    expect(other).to_be_hidden()
    press(page, RIGHT)
    expect(page.locator("figure.plot svg")).to_have_css("touch-action", "pan-y")
    page.get_by_text("Disks start to move").wait_for()
    assert page.locator("path.exact").get_attribute("d")  # S, once disks moved
    expect(page.get_by_role("button", name="Your predictions: 7 chapters to go")).to_be_disabled()
    allowed = page.locator("figure").get_by_text("limit load")
    first = float(dot(page).get_attribute("aria-valuenow"))
    assert first < float(allowed.inner_html().split()[-1])
    page.keyboard.press("ArrowLeft")
    page.get_by_text("Without a push").wait_for()  # the words follow the dot
    other.click()
    page.get_by_text("Push again").wait_for()
    assert float(dot(page).get_attribute("aria-valuenow")) == 0
    # An arrow follows the hand.
    x, y, along = page.locator(".picture .scene").evaluate(ARROW)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 10 * along[0], y + 10 * along[1], steps=3)
    assert 0 < float(dot(page).get_attribute("aria-valuenow")) < first
    page.mouse.up()
    press(page, RIGHT)
    second = float(dot(page).get_attribute("aria-valuenow"))
    page.get_by_text(f"It is {first:.2f}; {second:.2f} from other forces").wait_for()
    assert abs(second - first) > 0.05
    page.locator("figure").get_by_text(re.compile(rf"^network \d+: {second:.2f}$")).wait_for()


def test_any_of_four_hundred_disks_lines_is_dragged_and_the_marked_one_goes_on_from_there(
    opening, lesson
):
    page = opening("?learn=four-hundred", 1280, 900, first=True, at=lesson)
    page.locator("article strong").wait_for()
    predict(page)
    page.locator(".voice p").filter(has_text="Drag the dot").wait_for()
    contact, x, y = chain(page)
    assert contact != scene(page, "scene.selected")
    before = dot(page).get_attribute("aria-valuenow")
    width = f"scene.style.width[{contact}]"
    thick = scene(page, width)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y - 90, steps=3)
    page.get_by_text("this line: ").wait_for()
    until(page, f"{width} > {1.05 * thick}")
    page.mouse.up()
    thick = scene(page, width)
    assert (
        page.get_by_text("possible").filter(visible=True).count() == 1
    )  # its range stays on screen
    marked = dot(page).get_attribute("aria-valuenow")
    assert marked != before
    dot(page).focus()
    page.keyboard.press("ArrowRight")  # by a step of a tenth
    page.wait_for_function(
        "([now, marked]) => Number(now.getAttribute('aria-valuenow')) > marked + 0.05",
        arg=[dot(page).element_handle(), float(marked)],
    )
    assert scene(page, width) > 0.9 * thick
