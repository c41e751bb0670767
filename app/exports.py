"""What is on screen as files, made in memory: table, dataset, packing, picture, parameters."""

import io
import json
import zipfile
from typing import NamedTuple

import numpy as np
import xarray as xr
import zarr

from granforce import importers
from granforce.schema import packing_dataset
from granforce.store import canonical

from .selection import command

# The contact dimension of a packing's own arrays; that of the states holds the backbone only.
PACKING_CONTACTS = "packing_contact"

# Of the picture, as in the player: chain width of ⟨f_n⟩, least force drawn, marks of Fig. 5.
WIDTH, CARRYING, STRONG, DIM, MARK = 0.23, 1e-6, 2.0, 0.35, 0.24
PIXELS = 900  # of the picture's side


class File(NamedTuple):
    """A file to hand over."""

    name: str
    mime: str
    content: bytes


class Look(NamedTuple):
    """How the packing is seen."""

    frame: int  # row of the Replay
    reference: int  # row that is pinned
    colour: str  # as in state.COLOURS
    thickness: str  # as in state.WIDTHS
    overlay: bool
    palettes: dict  # of style.palettes
    background: str


def contacts(replay, exact, frame):
    """One row a contact of the backbone, forces in the packing's unit: {name: array}."""
    scale = replay.force_scale
    first = np.unique(replay.links.contact, return_index=True)[1]
    columns = {
        "contact": replay.backbone,
        "i": replay.links.i[first],
        "j": replay.links.j[first],
        "f_n_original": replay.normal[0] * scale,
        "f_t_original": replay.tangential[0] * scale,
        "f_n": replay.normal[frame] * scale,
        "f_t": replay.tangential[frame] * scale,
    }
    for k, part in enumerate(("f_n", "f_t")):
        columns[f"{part}_low"] = replay.low[:, k] * scale
        columns[f"{part}_high"] = replay.high[:, k] * scale
    if exact is not None and np.array_equal(exact["backbone"].values, replay.backbone):
        for k, part in enumerate(("f_n", "f_t")):
            columns[f"{part}_min"] = exact["low"].values[:, k]
            columns[f"{part}_max"] = exact["high"].values[:, k]
    return columns


def csv(columns):
    """Columns {name: array} as a table; whole numbers stay whole."""
    file = io.StringIO()
    whole = [np.issubdtype(values.dtype, np.integer) for values in columns.values()]
    np.savetxt(
        file,
        np.column_stack(list(columns.values())),
        fmt=["%d" if w else "%.9g" for w in whole],
        delimiter=",",
        header=",".join(columns),
        comments="",
    )
    return file.getvalue().encode()


def dataset(packing, states, exact=None):
    """Packing, states and, where known, exact intervals (exact_low, exact_high) in one dataset."""
    geometry = packing_dataset(packing)
    geometry = geometry.rename({"contact": PACKING_CONTACTS})
    parts = [states.copy(), geometry.drop_attrs(deep=False)]
    if exact is not None and np.array_equal(exact["backbone"].values, states["backbone"].values):
        names = {"low": "exact_low", "high": "exact_high", "eta3": "exact_eta3"}
        parts.append(exact[list(names)].rename(names))
    whole = xr.merge(parts, combine_attrs="override", join="exact", compat="no_conflicts")
    return whole.assign_attrs(states.attrs)


def netcdf(whole):
    """A dataset as NetCDF 3."""
    return bytes(whole.to_netcdf(engine="scipy"))


def zarr_zip(whole):
    """A dataset as a zipped Zarr group, which zarr.storage.ZipStore opens."""
    written = {}
    whole.to_zarr(zarr.storage.MemoryStore(store_dict=written), zarr_format=3, consolidated=False)
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        for name, content in sorted(written.items()):
            archive.writestr(name, content.to_bytes())
    return file.getvalue()


def npz(packing):
    """A packing as NPZ, to be read by `granforce` and load_packing."""
    file = io.BytesIO()
    importers.save_packing(packing, file)
    return file.getvalue()


def parameters(cell, link, view):
    """All that names what is on screen, as JSON: parameters, link, command, view."""
    told = {
        "kind": cell.kind,
        "entry": cell.name,
        "parameters": json.loads(canonical(cell.params)),
        "link": f"?{link}",
        "command": command(cell.selection),
        "view": view,
    }
    return json.dumps(told, indent=1, ensure_ascii=False).encode()


def picture(replay, extent, most, look):
    """The packing as on screen, as SVG; extent (N_c,): ΔF_n in ⟨f_n⟩, most: end of its scale."""
    x_low, x_high, y_low, y_high = replay.window
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{PIXELS}" height="{PIXELS}" '
        f'viewBox="{x_low:.6g} {-y_high:.6g} {x_high - x_low:.6g} {y_high - y_low:.6g}">',
        f'<rect x="{x_low:.6g}" y="{-y_high:.6g}" width="100%" height="100%" '
        f'fill="{look.background}"/>',
        *_disks(replay, look.palettes["scene"]),
        *_chains(replay, extent, most, look),
    ]
    if look.overlay:
        lines += _marks(replay, extent, look)
    return "\n".join([*lines, "</svg>"])


def _disks(replay, colours):
    disks = replay.disks
    kind = 2 * disks.image + (disks.contacts == 0)
    for x, y, r, k in zip(disks.x, disks.y, disks.r, kind, strict=True):
        paint = colours["disks"][k]
        yield (
            f'<circle cx="{x:.5g}" cy="{-y:.5g}" r="{r:.5g}" fill="{paint["fill"]}" '
            f'stroke="{paint["line"]}" stroke-width="0.03"/>'
        )
    if np.all(np.isfinite(replay.box)):
        width, height = replay.box
        yield (
            f'<rect x="0" y="{-height:.6g}" width="{width:.6g}" height="{height:.6g}" fill="none" '
            f'stroke="{colours["edge"]}" stroke-width="0.04" stroke-dasharray="0.2"/>'
        )


def _chains(replay, extent, most, look):
    width, colour = chain_widths(replay, extent, look), chain_colours(replay, extent, most, look)
    links = replay.links
    ends = zip(links.x0, links.y0, links.x1, links.y1, links.contact, strict=True)
    yield f'<g stroke-linecap="round" opacity="{DIM if look.overlay else 1}">'
    for x0, y0, x1, y1, c in ends:
        if width[c] > 0:
            yield (
                f'<line x1="{x0:.5g}" y1="{-y0:.5g}" x2="{x1:.5g}" y2="{-y1:.5g}" '
                f'stroke="{colour[c]}" stroke-width="{width[c]:.3g}"/>'
            )
    yield "</g>"


def chain_widths(replay, extent, look):
    """Width (N_c,) of each contact's chain, length; 0 for what carries nothing."""
    value = replay.normal[look.frame]
    if look.thickness == "extent":
        value = extent
    elif look.thickness == "difference":
        value = np.abs(value - replay.normal[look.reference])
    return np.where(value > CARRYING, WIDTH * value, 0.0)


def chain_colours(replay, extent, most, look):
    """Colour of each contact's chain, a list of "#rrggbb"."""
    normal, tangential = replay.normal[look.frame], replay.tangential[look.frame]
    mu = replay.summary["mu"]
    if look.colour == "mobilised" and mu == 0:
        return [look.palettes["neutral"]] * len(normal)
    if look.colour == "mobilised":
        part = 0.5 + np.divide(
            tangential, 2 * mu * normal, out=np.zeros_like(normal), where=normal > CARRYING
        )
    elif look.colour == "extent":
        part = extent / most if most > 0 else np.zeros_like(extent)
    elif look.colour == "change":
        part = 0.5 + (normal - replay.normal[0]) / 2
    else:
        part = 0.5 + 0.5 * np.sign(normal - replay.normal[look.reference])
    colours = look.palettes[look.colour]
    place = np.round((len(colours) - 1) * np.clip(part, 0, 1)).astype(int)
    return [colours[k] for k in place]


def _marks(replay, extent, look):
    """Fig. 5 of the paper: strong contacts filled, undetermined ones open."""
    links, scene = replay.links, look.palettes["scene"]
    x, y = (links.x0 + links.x1) / 2, (links.y0 + links.y1) / 2
    strong, loose = replay.normal[0] > STRONG, extent > extent.mean()
    filled = f'fill="{scene["strong"]}"'
    open_ = f'fill="none" stroke="{scene["loose"]}" stroke-width="0.09"'
    for chosen, size, paint in ((strong, 0.75, filled), (loose, 1.25, open_)):
        for k in np.flatnonzero(chosen[links.contact]):
            yield f'<circle cx="{x[k]:.5g}" cy="{-y[k]:.5g}" r="{MARK * size:.3g}" {paint}/>'
