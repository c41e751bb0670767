"""A movie of what plays, as GIF: drawn here, small enough for slides."""

import io
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import matplotlib as mpl
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from granforce.records import Cancelled
from granforce.types import Cancel, Floats, Progress

from ....results.geometry import CHAIN_WIDTH, FULL_CHANGE, FULL_DEVIATION
from ....results.replays import Replay

Look = dict[str, Any]  # of `shades`
Moment = tuple[int, int, float]

SIDE = 480  # pixels
FINER = 2  # times as many while drawing, for smooth edges
FRAMES = 60
FRAME_MS = 80
MOST_BYTES = 5e6
FEWER = (1.0, 0.7, 0.5, 0.35)  # parts of SIDE that are tried until it is small enough
TONES = 64  # colours of the whole movie
BELOW = 0.13  # height of what is written below the packing, in its sides
ENDS = "low", "high"  # words beside the scale of colours
LETTERS = 0.026  # the same of its letters


def gif(
    replay: Replay,
    look: Look,
    *,
    between: tuple[int, int] | None = None,
    progress: Progress | None = None,
    cancelled: Cancel | None = None,
) -> bytes:
    """GIF (bytes, at most MOST_BYTES) of the states, or to and fro between two of them.

    look: see `shades`, with ink, bar and lines of `captions.caption`. progress(done, total);
    cancelled() ends it with Cancelled.
    """
    for part in FEWER:
        images: list[Image.Image] = []
        for image in _drawn(replay, look, int(SIDE * part), between):
            if cancelled is not None and cancelled():
                raise Cancelled("the movie was cancelled")
            images.append(image)
            if progress is not None:
                progress(len(images), FRAMES)
        file = io.BytesIO()
        images[0].save(
            file, "GIF", save_all=True, append_images=images[1:], duration=FRAME_MS, loop=0
        )
        if file.tell() <= MOST_BYTES:
            break
    return file.getvalue()


def _drawn(
    replay: Replay, look: Look, side: int, between: tuple[int, int] | None
) -> Iterator[Image.Image]:
    fine = side * FINER
    ground = _disks(replay, look, fine)
    for k, (a, b, part) in enumerate(_moments(len(replay.normal), between)):
        normal, tangential = (
            (1 - part) * values[a] + part * values[b]
            for values in (replay.normal, replay.tangential)
        )
        image = ground.copy()
        _chains(ImageDraw.Draw(image), replay, look, normal, tangential, fine)
        small = image.resize((side, side), Image.Resampling.LANCZOS)
        small = _captioned(small, look, _place_in(replay, (a, b, part), between))
        # One palette for all frames, or colours would flicker: of the first and all that may come.
        if k == 0:
            tones = _with_all_colours(small, look).quantize(TONES, dither=Image.Dither.NONE)
        yield small.quantize(palette=tones, dither=Image.Dither.NONE)


def _with_all_colours(image: Image.Image, look: Look) -> Image.Image:
    """The picture, a quarter of it under all colours that chains can have."""
    shown, colours = image.copy(), look["colours"]
    part = image.width / len(colours)
    for k, colour in enumerate(colours):
        box = (k * part, 0, (k + 1) * part, image.height / 4)
        ImageDraw.Draw(shown).rectangle(box, fill=colour)
    return shown


def _place_in(replay: Replay, moment: Moment, between: tuple[int, int] | None) -> str:
    """Which network a frame shows, in words."""
    (a, b, part), states = moment, replay.summary["states"]

    def called(k: int) -> str:
        return f"network {replay.number[k]} of {states}" if replay.number[k] else "as packed"

    if between is not None:
        return f"{part:.0%} of the way from {called(a)} to {called(b)}"
    return called(a if part < 0.5 else b)


def _captioned(image: Image.Image, look: Look, place: str) -> Image.Image:
    """The picture with its scale of colours, what it shows and where it comes from below it."""
    side, colours, (low, high) = image.width, look["colours"], (look["bar"][k] for k in ENDS)
    whole = Image.new("RGB", (side, round(side * (1 + BELOW))), look["ground"])
    whole.paste(image, (0, 0))
    draw, gap = ImageDraw.Draw(whole), round(0.01 * side)
    path = f"{mpl.get_data_path()}/fonts/ttf/DejaVuSans.ttf"
    font = ImageFont.truetype(path, max(9, round(LETTERS * side)))
    row = (whole.height - side) / 3
    for k, words in enumerate([f"{place}. {look['lines'][0]}", look["lines"][1]]):
        draw.text((gap, side + row * k + gap), words, fill=look["ink"], font=font)
    x, y = gap + draw.textlength(low, font) + gap, side + 2 * row + gap
    draw.text((gap, y), low, fill=look["ink"], font=font)
    for k, colour in enumerate(colours):
        part = 0.2 * side / len(colours)
        draw.rectangle((x + k * part, y, x + (k + 1) * part, y + 0.6 * row), fill=colour)
    draw.text((x + 0.2 * side + gap, y), high, fill=look["ink"], font=font)
    return whole


def _moments(count: int, between: tuple[int, int] | None) -> list[Moment]:
    """(state, next state, part of the way) of each frame of the movie."""
    if between is not None:
        way = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(FRAMES) / FRAMES)
        return [(*between, float(part)) for part in way]
    places = np.linspace(0, count - 1, FRAMES)
    before = np.minimum(places.astype(int), max(count - 2, 0))
    return [
        (int(a), min(int(a) + 1, count - 1), float(place - a))
        for a, place in zip(before, places, strict=True)
    ]


def _place(
    replay: Replay, fine: int
) -> tuple[Callable[[float, float], tuple[float, float]], float]:
    """Pixels of places, and pixels for each unit of length."""
    left, right, _, top = replay.window
    scale = fine / (right - left)
    return lambda x, y: ((x - left) * scale, (top - y) * scale), scale


def _disks(replay: Replay, look: Look, fine: int) -> Image.Image:
    image = Image.new("RGB", (fine, fine), look["ground"])
    draw, (place, scale) = ImageDraw.Draw(image), _place(replay, fine)
    disks = replay.disks
    for x, y, r, touching, outside in zip(
        disks.x, disks.y, disks.r, disks.contacts, disks.image, strict=True
    ):
        px, py = place(x, y)
        fill = look["pale"] if touching == 0 or outside else look["disk"]
        box = (px - r * scale, py - r * scale, px + r * scale, py + r * scale)
        draw.ellipse(box, fill=fill, outline=look["edge"], width=FINER)
    return image


def _chains(
    draw: ImageDraw.ImageDraw,
    replay: Replay,
    look: Look,
    normal: Floats,
    tangential: Floats,
    fine: int,
) -> None:
    place, scale = _place(replay, fine)
    links = replay.links
    width = CHAIN_WIDTH * look["stretch"] * look["thickness"](normal) * scale
    colours = look["colours"]
    tone = np.clip(look["shade"](normal, tangential), 0, 1) * (len(colours) - 1)
    for k in np.argsort(width[links.contact], kind="stable"):
        c = links.contact[k]
        if width[c] < 0.2:
            continue
        ends = (*place(links.x0[k], links.y0[k]), *place(links.x1[k], links.y1[k]))
        draw.line(ends, fill=colours[int(tone[c] + 0.5)], width=max(1, round(float(width[c]))))


def shades(
    replay: Replay,
    exact: Mapping[str, Floats],
    palettes: Mapping[str, Any],
    *,
    colour: str,
    thickness: str,
    reference: int,
    most: float,
    dark: bool,
    loads: Floats | None = None,
    gone: Floats | None = None,
    measured: Mapping[str, Floats] | None = None,
    full: float | None = None,
    stretch: float = 1.0,
) -> Look:
    """How forces are drawn, as on screen: colours, and functions of the forces of a moment.

    exact: {"low", "high"} (N_c,) or empty; the others as in the state, most: ΔF_n at full colour,
    loads (N_c,) limit loads or None; gone (N_c,) of ΔF_n by what is known, or None; measured: of a
    frame, "normal" and "off" (N_c,), or nothing; full: ⟨f_n⟩ at which colours are full, or None;
    stretch: how many times as wide chains are.
    """
    low, high = (exact["low"], exact["high"]) if exact else (replay.low[:, 0], replay.high[:, 0])
    extent, first, pinned = high - low, replay.normal[0], replay.normal[reference]
    mu, of = replay.summary["mu"], measured or {}
    neutral = (
        (colour == "mobilised" and mu == 0)
        or (colour == "known" and gone is None)
        or (colour == "deviation" and not of)
    )
    shade = {
        "neutral": lambda normal, tangential: np.zeros_like(normal),
        "mobilised": lambda normal, tangential: (
            0.5 + tangential / np.maximum(mu * normal, 1e-9) / 2
        ),
        "extent": lambda normal, tangential: extent / (most or 1.0),
        "change": lambda normal, tangential: 0.5 + (normal - first) / (2 * (full or FULL_CHANGE)),
        "sign": lambda normal, tangential: 0.5 + 0.5 * np.sign(normal - pinned),
        "load": lambda normal, tangential: (
            np.full_like(normal, 0.5) if loads is None else loads / (full or loads.max())
        ),
        "known": lambda normal, tangential: gone / np.maximum(gone + extent, 1e-6),
        "deviation": lambda normal, tangential: (
            0.5 + np.nan_to_num(of["off"]) / (2 * FULL_DEVIATION)
        ),
    }["neutral" if neutral else colour]
    width = {
        "normal": lambda normal: normal,
        "extent": lambda normal: extent,
        "difference": lambda normal: np.abs(normal - pinned),
        "load": lambda normal: normal if loads is None else loads,
        "known": lambda normal: normal if gone is None else gone,
        "measured": lambda normal: np.nan_to_num(of["normal"]) if of else normal,
    }[thickness]
    tones = {"ground": "#121212", "disk": "#3b444f", "pale": "#22272d", "edge": "#55606e"}
    if not dark:
        tones = {"ground": "#ffffff", "disk": "#d0d8e2", "pale": "#eef1f5", "edge": "#a9b7c8"}
    colours = [palettes["neutral"]] if neutral else palettes[colour]
    return {"shade": shade, "thickness": width, "stretch": stretch, "colours": colours, **tones}
