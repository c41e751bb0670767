"""Disks and contacts as they are drawn, with their periodic images: plain arrays."""

from typing import NamedTuple

import numpy as np

# Width of the strip around the periodic box in which images are drawn, in largest radii.
MARGIN = 1.0


class Disks(NamedTuple):
    """Disks and their periodic images that are seen, k rows."""

    x: np.ndarray  # (k,) length
    y: np.ndarray
    r: np.ndarray
    grain: np.ndarray  # (k,) number of the grain
    contacts: np.ndarray  # (k,) its number of force-bearing contacts
    image: np.ndarray  # (k,) bool, whether the centre lies outside the box


class Links(NamedTuple):
    """Contacts of the backbone and their periodic images as segments, k rows."""

    x0: np.ndarray  # (k,) centre of grain i, length
    y0: np.ndarray
    x1: np.ndarray  # (k,) that centre + ℓ n
    y1: np.ndarray
    contact: np.ndarray  # (k,) position among the backbone's contacts
    i: np.ndarray  # (k,) numbers of the two grains
    j: np.ndarray


def into_box(packing):
    """Centres (N, 2), moved into [0, L) along each periodic axis."""
    periodic = np.isfinite(packing.box)
    return np.where(periodic, packing.x % np.where(periodic, packing.box, 1.0), packing.x)


def square(x, packing):
    """(x_low, x_high, y_low, y_high) of a square around the box (where open, the grains)."""
    margin = MARGIN * packing.r.max()
    periodic = np.isfinite(packing.box)
    low = np.where(periodic, 0.0, (x - packing.r[:, None]).min(axis=0))
    high = np.where(periodic, packing.box, (x + packing.r[:, None]).max(axis=0))
    middle, half = (low + high) / 2, (high - low).max() / 2 + margin
    corners = np.stack([middle - half, middle + half], axis=1)
    return tuple(float(value) for value in corners.ravel())


def _shifts(packing):
    """Shifts by −1, 0, 1 boxes along each periodic axis, (k, 2)."""
    steps = [(-1, 0, 1) if np.isfinite(side) else (0,) for side in packing.box]
    sides = np.where(np.isfinite(packing.box), packing.box, 0.0)
    return np.array([(a, b) for a in steps[0] for b in steps[1]]) * sides


def _seen(low, high, packing, window):
    """Rows whose extent (k, 2) reaches into the drawn strip around the box."""
    margin = MARGIN * packing.r.max()
    open_low, open_high = np.array(window[::2]), np.array(window[1::2])
    edge_low = np.where(np.isfinite(packing.box), -margin, open_low)
    edge_high = np.where(np.isfinite(packing.box), packing.box + margin, open_high)
    return np.all((high > edge_low) & (low < edge_high), axis=1)


def disks(packing, x, window, backbone):
    """Disks; backbone: (N_c,) its contacts as positions in the packing."""
    i, j = packing.contacts.i[backbone], packing.contacts.j[backbone]
    number = np.bincount(i, minlength=len(x)) + np.bincount(j, minlength=len(x))
    parts = []
    for shift in _shifts(packing):
        r = packing.r[:, None]
        grain = np.flatnonzero(_seen(x + shift - r, x + shift + r, packing, window))
        at = x[grain] + shift
        image = np.full(len(grain), bool(np.any(shift)))
        parts.append((at[:, 0], at[:, 1], packing.r[grain], grain, number[grain], image))
    return Disks(*(np.concatenate(field) for field in zip(*parts, strict=True)))


def links(packing, x, window, backbone):
    """Segments of the backbone's contacts, given as positions in the packing."""
    i, j = packing.contacts.i[backbone], packing.contacts.j[backbone]
    reach = packing.contacts.length[backbone, None] * packing.contacts.normal[backbone]
    parts = []
    # From a centre inside the box a contact may reach out of it, so its image may come in.
    for shift in _shifts(packing):
        begin = x[i] + shift
        end = begin + reach
        low, high = np.minimum(begin, end), np.maximum(begin, end)
        contact = np.flatnonzero(_seen(low, high, packing, window))
        ends = (*begin[contact].T, *end[contact].T)
        parts.append((*ends, contact, i[contact], j[contact]))
    return Links(*(np.concatenate(field) for field in zip(*parts, strict=True)))
