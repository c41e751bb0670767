"""`granforce infer --frames`: many photoelastic frames, over processes, in one dataset."""

import argparse
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from granforce.packing.importers.repair import KINDS
from granforce.records import InputError, whole
from granforce.study import series
from granforce.study.series import Frame
from granforce.study.store import open_store
from granforce.system.terminal import Bar, print_list


def infer_frames(arguments: argparse.Namespace, options: dict[str, Any]) -> int:
    """Import and infer the frames that were asked for; print a line of each. 1 if one failed."""
    if arguments.mu is None:
        raise InputError("give the friction coefficient: --mu 0.5")
    if not arguments.files:
        raise InputError("--frames needs a folder, *_solved.mat files, or positions and adjacency")
    whole(arguments.workers, "--workers", 1)
    frames = _chosen(series.frames_of(*arguments.files), arguments.frames)
    if arguments.out is not None:
        series.check_folder(arguments.out)
    store = open_store(arguments.cache)
    with Bar("frames", "frame") as progress:
        dataset, failed = series.infer_series(
            store.path,
            frames,
            mu=arguments.mu,
            states=series.STATES if arguments.states is None else arguments.states,
            seed=arguments.sample_seed,
            unmeasured=series.UNMEASURED if arguments.unmeasured is None else arguments.unmeasured,
            workers=arguments.workers,
            scheduler=arguments.scheduler,
            progress=progress,
            **options,
        )
    for frame, message in failed:
        print(f"granforce: frame {frame.number:g}: {message}", file=sys.stderr)
    if dataset is not None:
        print_list(_rows(dataset), tuple(_rows(dataset)[0]), arguments.json)
        if arguments.out is not None:
            series.save_series(dataset, arguments.out)
    return 1 if failed else 0


def _chosen(frames: Sequence[Frame], text: str) -> Sequence[Frame]:
    """The frames that were asked for, by number."""
    if text == "all":
        return frames
    try:
        numbers = {float(part) for part in text.split(",")}
    except ValueError:
        raise InputError(f"--frames {text[:40]!r}: all, or numbers separated by commas") from None
    there = {frame.number for frame in frames}
    for number in sorted(numbers - there):
        raise InputError(f"no frame {number:g}: there are {min(there):g} … {max(there):g}")
    return [frame for frame in frames if frame.number in numbers]


def _rows(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """A line for each frame; forces in its mean measured normal force."""
    rows = []
    for k, number in enumerate(dataset["frame"].values.tolist()):
        one, unit = dataset.isel(frame=k), float(dataset["unit"][k])
        account = dict(zip(dataset["kind"].values, one["account"].values, strict=True))
        mended = sum(int(account[kind]) for kind in KINDS if kind != "beyond_friction")
        rows.append(
            {
                "frame": number,
                "grains": int(account["grains"]),
                "contacts": int(account["contacts_listed"]),
                "mended": mended,
                "unbalanced": int(account["unbalanced"]),
                "chi_square": float(one["chi_square"]),
                "freedom": int(one["freedom"]),
            }
        )
        if "standard_error" in one:
            moved = np.abs(one["change"].values) > 3 * one["change_error"].values
            rows[-1]["standard_error"] = float(np.nanmean(one["standard_error"].values) / unit)
            rows[-1]["changed"] = int(moved.any(axis=1).sum())
    return rows
