"""The workbench of small scenes, as a visitor sees it and has it in hand."""

import re

import pytest
from serving import ask, expect, free_port, painted, scene, searched, serve, shows, until

import granforce as gf


@pytest.fixture
def look(opening):
    """look(query, width, height, …): the workbench of a scene, by `opening`."""

    def look(query, width=1280, height=800, **options):
        page = opening(query, width, height, **options)
        free(page)
        return page

    return look


def free(page, numbers=""):
    """Wait until so many free numbers are counted."""
    page.locator(".count b").filter(has_text=f"{numbers} free number").wait_for()


def choose(page, name):
    page.get_by_role("combobox", name="Scene").select_option(name)


def says(page, words):
    page.locator(".says").filter(has_text=words).wait_for()


def value(page, row=0):
    """What stands beside a bar: the force, and between which values it may lie."""
    return page.locator(".bars .value").nth(row).inner_text()


def test_every_scene_fits_on_a_telephone_and_is_gone_back_to(look):
    page = look("?scene=groove&mu=0.7", 390, 844)
    for name, numbers in (("box", 2), ("column", 10), ("solid", 3)):
        choose(page, name)
        free(page, numbers)
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
    searched(page, "scene=solid")
    page.go_back()
    free(page, 10)
    page.go_back()
    page.go_back()
    free(page, 1)
    expect(page.get_by_role("textbox", name="μ")).to_have_value("0.7")


def test_friction_is_changed_under_the_eye(look):
    page = look("?scene=groove&mu=0.5")
    slider = page.get_by_role("slider", name="friction μ")
    slider.fill("0")
    says(page, "S is one point")
    slider.fill("0.8")
    says(page, "Every point of the blue line")
    page.locator(".bars .value").first.filter(has_text="(possible 0.393 to 3.536)").wait_for()
    slider.fill("1")
    says(page, "S has no end")
    page.get_by_role("button", name="Random points").click()
    says(page, "evenly spread random points are impossible")
    searched(page, "mu=1")


def test_the_point_is_dragged_by_hand_finger_and_keys_and_taken_back(look):
    page = look("?scene=groove&mu=0.5", 390, 844, has_touch=True)
    space = page.get_by_role("img", name="S: every point")
    before = value(page)  # read after the first frame, whose words move the picture
    box = space.bounding_box()
    # Not at a place of the page: texts above it may still change their height.
    space.tap(position={"x": box["width"] - 5, "y": box["height"] / 2})
    page.locator(".bars .value").first.filter(has_text="1.414 (").wait_for()
    page.get_by_role("button", name="Undo").click()
    page.locator(".bars .value").first.filter(has_text=before).wait_for()
    space.focus()
    for _ in range(60):
        page.keyboard.press("ArrowLeft")
    page.locator(".bars .value").first.filter(has_text="0.471 (").wait_for()


def test_what_falls_is_told_with_the_friction_that_would_do(look):
    page = look("?scene=pyramid")
    page.get_by_role("slider", name="friction μ").fill("0.2")
    says(page, "orange arrows show how disks 1, 2 and 3 give way")
    page.get_by_role("button", name="Set μ = 0.27").click()  # its least μ is tan 15°
    free(page)


def test_a_push_by_keyboard_shrinks_s_until_nothing_balances(look):
    page = look("?scene=pyramid")
    page.get_by_role("button", name="Test push").click()
    for _ in range(3):
        page.keyboard.press("n")
    page.keyboard.press("ArrowRight")
    says(page, "You push disk 3 with 0.020: at most")
    for _ in range(70):
        page.keyboard.press("ArrowRight")
    says(page, "Now nothing balances")
    page.get_by_role("button", name="Test push").click()
    free(page)


def test_a_push_in_many_dimensions_has_a_limit_too(look):
    """The server finds it: of such an S the page has only a shadow."""
    page = look("?scene=column")
    page.get_by_role("button", name="Test push").click()
    for _ in range(3):
        page.keyboard.press("n")
    page.keyboard.press("ArrowRight")
    page.locator(".says").filter(
        has_text=re.compile(r"^You push disk 3 with .*: at most")
    ).wait_for()


def test_many_dimensions_have_exact_ends_on_axes_that_are_chosen(look):
    page = look("?scene=thirteen")
    free(page, 8)
    page.get_by_text("Why 38?").click()
    page.get_by_text("13 disks × 3 − 2 + 1 = 38").wait_for()
    page.get_by_text("The range of each normal force").click()
    page.locator(".bars .value").nth(3).filter(has_text="possible 1.254 to 4.838").wait_for()
    page.get_by_role("combobox", name="force shown across").select_option("6")
    page.get_by_role("button", name="Random walk").click()
    before = value(page)
    page.locator(".bars .value").first.filter(has_not_text=before).wait_for()


def test_a_scene_is_built_by_keyboard_and_its_link_carries_it(look, tmp_path):
    page = look("?scene=own")
    free(page, 2)
    page.get_by_role("img", name="Disks").focus()
    for key in ["ArrowUp"] * 8 + ["ArrowLeft"] * 2:  # above both
        page.keyboard.press(key)
    page.keyboard.press("Enter")  # a disk is put, and let go
    page.keyboard.press("Enter")
    page.locator(".count b").filter(has_not_text="8 unknown").wait_for()
    counted = page.locator(".count b").inner_text()
    disks = "new URLSearchParams(location.search).get('built')?.split('|')[0].split(';').length"
    page.wait_for_function(f"() => {disks} === 3")
    page.reload()
    page.get_by_text(counted).wait_for()
    with page.expect_download() as file:
        page.get_by_role("button", name="Download data").click()
    file.value.save_as(tmp_path / "own.npz")
    assert gf.load_packing(tmp_path / "own.npz").info["disks"] == 3


def blocks(page):
    """Begin with one block, 2 × 1 at (4, 0.5) on the floor; the px of a position of the scene."""
    page.get_by_role("radio", name="Blocks").click()
    page.get_by_role("button", name="Clear").click()
    free(page, 1)
    box = page.get_by_role("img", name="Disks").bounding_box()
    wide, high, r = box["width"] - 2, box["height"] - 2, 1.25**0.5
    unit = min(wide / 9.6, high / (2.4 * r), 0.27 * high / r)
    return lambda x, y: (
        box["x"] + 1 + wide / 2 + unit * (x - 4),
        box["y"] + 1 + high / 2 - unit * (y - 0.5),
    )


def test_a_block_dragged_over_the_edge_falls(look):
    page = look("?scene=own")
    px = blocks(page)
    page.mouse.click(*px(4.2, 1.7))  # lands on the other
    free(page, 2)
    page.get_by_text("between blocks 1 and 2 (left end)").wait_for()
    page.mouse.move(*px(4.2, 1.4))
    page.mouse.down()
    page.mouse.move(*px(5.3, 1.45), steps=5)
    says(page, "orange arrows show how block 2 gives way")
    page.mouse.move(*px(4.8, 1.45), steps=5)
    page.mouse.up()
    free(page, 2)
    searched(page, "%3B4.8")
    page.get_by_role("radio", name="Disks").click()
    page.mouse.click(*px(1.5, 1.1))
    says(page, "holds the same bodies at rest")
    page.get_by_role("radio", name="Blocks").click()
    page.mouse.move(*px(1.5, 1))  # a disk is moved, and chosen
    page.mouse.down()
    page.mouse.move(*px(1.4, 1.1), steps=2)
    page.mouse.up()
    page.get_by_role("radio", name="Disks", checked=True).wait_for()


def test_a_ladder_is_leant_by_keys_and_its_link_and_file_carry_it(look, tmp_path):
    page = look("?scene=own")
    px = blocks(page)
    page.get_by_role("radio", name="Draw a wall").click()
    page.mouse.move(*px(0.5, 0))
    page.mouse.down()
    page.mouse.move(*px(0.5, 2.7), steps=3)
    page.mouse.up()
    page.get_by_role("radio", name="Blocks").click()
    page.mouse.click(*px(4, 0.4))
    for name, value in (("width", "3"), ("height", "0.1"), ("degrees", "-50")):
        page.get_by_role("textbox", name=name).fill(value)
        page.get_by_role("textbox", name=name).press("Enter")
    page.get_by_role("img", name="Disks").press("e")
    page.get_by_role("img", name="Disks").press("e")
    expect(page.get_by_role("textbox", name="degrees")).to_have_value("-60")
    page.get_by_role("textbox", name="height").fill("thin")
    page.get_by_role("textbox", name="height").press("Enter")
    page.get_by_text("Type a number.").wait_for()
    page.mouse.move(*px(4, 1.35))
    page.mouse.down()
    page.mouse.move(*px(1.3, 1.4), steps=8)
    page.mouse.up()
    free(page, 1)
    searched(page, "built=1.3", "%2C-60%7C")  # a moment after the count
    page.reload()
    page.get_by_text("at the left wall").first.wait_for()
    with page.expect_download() as file:
        page.get_by_role("button", name="Download data").click()
    file.value.save_as(tmp_path / "own.npz")
    assert gf.load_packing(tmp_path / "own.npz").shapes.sides.tolist() == [4, 2, 2]


def test_walls_press_in_place_of_gravity(look):
    page = look("?scene=own")
    page.get_by_role("radio", name="Pressure").click()
    free(page, 1)
    searched(page, "%7Cp1")
    page.get_by_role("slider", name="friction μ").fill("0.1")
    says(page, "the wall that presses give way")
    page.get_by_role("radio", name="Gravity").click()
    page.get_by_role("button", name="Clear").click()
    says(page, "Everything is determined")


def test_a_link_that_cannot_be_built_says_so_and_begins_anew(look):
    page = look("?scene=own&built=1,1,1;1.5,1,1%7C0,0,3,0")
    says(page, "two disks overlap")
    free(page, 2)


def test_400_disks_take_the_theme_and_the_friction_along(look):
    page = look("?scene=groove")
    page.get_by_role("button", name="Dark theme").click()
    page.get_by_role("textbox", name="μ").fill("1")
    page.get_by_role("textbox", name="μ").press("Enter")
    choose(page, "many")
    painted(page)
    searched(page, "mu=1&")
    page.get_by_role("button", name="Light theme").wait_for()
    assert "dark" not in page.url


def test_a_server_that_is_gone_is_told_and_its_return_restores_views(
    visit, opening, shipped, tmp_path
):
    """Meanwhile what is in the pages still plays, and S of a small scene is cut."""
    port, store = free_port(), {"GRANFORCE_DATA": str(shipped)}
    expected = ("WebSocket", "Failed to load resource", "not connected")
    with serve(tmp_path, port=port, **store) as (url, server):
        small = opening("?scene=groove", 1280, 800, at=url, wanted=expected)
        page = visit(at=url, wanted=expected)
        free(small, 1)
        ask(page, 1)
        shows(page, 1)
        searched(page, "mu=1&")
        page.locator("button.step").click()
        searched(page, "network=1")
        server.kill()
        for one in (page, small):
            one.get_by_role("alert").get_by_text("Connection lost").wait_for()
        painting = scene(page, "scene.painted")
        page.locator("button.play").click()
        until(page, f"scene.painted > {painting} + 3")
        page.locator(".scale button").first.click()  # μ = 0, of which nobody hears yet
        small.get_by_role("slider", name="friction μ").fill("0.8")
        small.locator(".bars .value").first.filter(has_text="(possible 0.393 to 3.536)").wait_for()
        searched(small, "mu=0.8")
        choose(small, "box")
    with serve(tmp_path, port=port, **store):
        for one in (page, small):
            one.get_by_text("Connection lost").wait_for(state="detached")
        free(small, 2)
        painted(page)
        shows(page, 0)
        searched(page, "mu=0&")
        ask(page, 1)  # and it listens again
        shows(page, 1)
