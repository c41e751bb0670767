"""Photoelastic frames uploaded by a visitor: measured and inferred forces, as plain arrays."""

import json
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from granforce.experiment.listings.listing import plain
from granforce.experiment.pegs import open_frames, read_pegs
from granforce.experiment.regions import regions
from granforce.experiment.repair import KINDS
from granforce.packing.importers.network import alone
from granforce.records import Packing
from granforce.study import series
from granforce.study.keys import Parameters
from granforce.study.schema import dataset_packing

from ..background.jobs import Job
from ..background.limits import LIMITS
from . import uploads
from .saved_file import csv

DRAWS = 80  # for error bars in the app
CERTAIN = 2.0  # standard errors above 0 from which a contact certainly carries force


class Frame(NamedTuple):
    """A frame and its likeliest admissible network; forces in the mean measured f_n."""

    source: str  # names of its files
    report: dict[str, Any]  # report of read_pegs
    numbers: tuple[Any, ...]  # of all frames in the files
    packing: Packing  # the grains alone, with wall forces of the inferred network as loads
    x: np.ndarray  # (N, 2) centres of the grains
    r: np.ndarray  # (N,) radii
    ids: np.ndarray  # (N + walls,) their ids
    ends: np.ndarray  # (N_c, 2) grains of each contact; N and above: a wall
    lines: np.ndarray  # (N_c, 2, 2) ends of the line for each contact
    measured: np.ndarray  # (N_c, 2) f_n, f_t; NaN if not measured
    inferred: np.ndarray  # (N_c, 2)
    error: np.ndarray  # (N_c, 2) standard errors of the inferred forces
    deviation: np.ndarray  # (N_c, 2) inferred minus measured, in σ
    added: np.ndarray  # (N_c,) bool, contacts that were not listed
    suspects: np.ndarray  # contacts beyond 3 σ, the farthest first
    certain: np.ndarray  # unmeasured contacts that certainly carry force, strongest first
    at_wall: np.ndarray  # (N,) bool, grains at walls
    left_open: np.ndarray  # (N,) bool, other grains with open balance
    repaired: np.ndarray  # (k, 2) places of repairs
    region: np.ndarray  # (N_c,) number of the contact's region, see `regions`
    stress: np.ndarray  # (9, 3) xx, yy, xy by region, over the mean pressure
    stress_error: np.ndarray  # (9, 3)


class Measured(NamedTuple):
    """Measurements of a frame opened as a packing, for its contacts (N_c,)."""

    packing: Parameters  # its parameters
    force: np.ndarray  # f_n in the packing's unit; NaN if not measured
    off: np.ndarray  # inferred minus measured f_n in σ, NaN likewise


def measured(frame: Frame, packing: Parameters) -> Measured:
    """The measurements of the contacts between the grains of a frame."""
    between = (frame.ends < len(frame.r)).all(axis=1)
    unit = frame.report["mean_measured_normal_force"]
    return Measured(packing, unit * frame.measured[between, 0], frame.deviation[between, 0])


def infer(files: uploads.Files, **options: Any) -> Callable[[Job], Frame]:
    """Work for jobs.Task that reads a frame and infers its forces with errors; a Frame.

    files: {role: (name, content)}; options: of `read_pegs`.
    """

    def work(job: Job) -> Frame:
        LIMITS.check(mu=options["mu"])
        job.begin("finding balanced forces close to the measured ones")
        roles = uploads.FAMILIES[uploads.family(files)][1]
        frames = open_frames(*(uploads.opened(*files[part]) for part in roles))
        photo = read_pegs(frames, most_grains=LIMITS.n, **options)
        job.begin("simulating repeated measurements, for error bars")
        dataset = series.infer_frame(photo, states=DRAWS)
        names = " and ".join(name for name, _ in files.values())
        return frame_of(dataset, names, tuple(map(plain, frames.frames.tolist())))

    return work


def frame_of(dataset: xr.Dataset, names: str, numbers: tuple[Any, ...]) -> Frame:
    """The Frame of a dataset of `series.infer_frame`."""
    account = json.loads(dataset.attrs["account"])
    report, walls = account["report"], len(account["walls"])
    unit, count = report["mean_measured_normal_force"], dataset.sizes["grain"] - walls
    of = {name: dataset[name].values for name in dataset.data_vars}
    i, j = of["contact_i"], of["contact_j"]
    away = np.where(j < count, of["length"], of["arm_i"])[:, None] * of["normal"]
    begin = of["x"][i]
    inner = i < count  # not a load cell
    certain = inner & np.isnan(of["measured"][:, 0])
    certain &= of["inferred"][:, 0] > CERTAIN * of["standard_error"][:, 0]
    order = np.argsort(-of["inferred"][:, 0], kind="stable")
    left_open, at_wall = np.zeros((2, count + walls), dtype=bool)
    left_open[account["left_open"]] = True
    at_wall[account["at_wall"]] = True
    mended = [one for one in account["findings"] if KINDS[one["kind"]].repaired]
    places = np.array([[one["x"], one["y"]] for one in mended]).reshape(-1, 2)
    pressure = np.abs(of["regional_stress"][:, :2].mean()) or 1.0
    return Frame(
        source=f"{uploads.FAMILIES['pegs'][0]}: {names}",
        report=report,
        numbers=numbers,
        packing=alone(dataset_packing(dataset), count, of["inferred"], walls=0),
        x=of["x"][:count],
        r=of["r"][:count],
        ids=of["grain_id"],
        ends=np.column_stack([i, j]),
        lines=np.where(inner[:, None, None], np.stack([begin, begin + away], axis=1), np.nan),
        measured=of["measured"] / unit,
        inferred=of["inferred"] / unit,
        error=of["standard_error"] / unit,
        deviation=of["deviation"],
        added=of["added"].astype(bool),
        suspects=of["suspect"],
        certain=order[certain[order]],
        at_wall=at_wall[:count] & ~left_open[:count],
        left_open=left_open[:count],
        repaired=places[np.isfinite(places).all(axis=1)],
        region=regions(begin + of["arm_i"][:, None] * of["normal"], of["x"][:count])[0],
        stress=of["regional_stress"] / pressure,
        stress_error=of["regional_stress_error"] / pressure,
    )


def table(frame: Frame) -> bytes:
    """All results as one CSV (bytes).

    Above: the stress of each region. Then a row for each contact: ids, measured and inferred
    forces, errors, marks and region.
    """
    suspect, certain = np.zeros((2, len(frame.ends)), dtype=int)
    suspect[frame.suspects], certain[frame.certain] = 1, 1
    one, two = frame.ids[frame.ends].T
    x, y = frame.lines.mean(axis=1).T
    columns = {"contact": np.arange(len(one)), "id1": one, "id2": two, "x": x, "y": y}
    for name, values in (
        ("measured [mean measured]", frame.measured),
        ("inferred [mean measured]", frame.inferred),
        ("error [mean measured]", frame.error),
        ("deviation [sigma]", frame.deviation),
    ):
        columns |= {f"f_{part}_{name}": values[:, k] for k, part in enumerate("nt")}
    columns |= {"added": frame.added.astype(int), "suspect": suspect, "certain": certain}
    columns |= {"region": frame.region}
    unit = frame.report["mean_measured_normal_force"]
    head = [
        f"{frame.source}, frame {frame.report['frame']}",
        f"forces in their mean measured normal force, {unit:.9g}; f_t along (-n_y, n_x)",
        "id2 below 0: a wall; added: not listed; suspect: beyond 3 sigma; certain: not measured, "
        "and inferred above 2 standard errors",
        "stress by region over the mean pressure, ± standard error; regions column by column:",
    ]
    for k, (values, errors) in enumerate(zip(frame.stress, frame.stress_error, strict=True)):
        parts = zip(("xx", "yy", "xy"), values, errors, strict=True)
        stresses = (f"{part} {value:.4g} ± {error:.2g}" for part, value, error in parts)
        head.append(f"region {k}: {', '.join(stresses)}")
    return csv(columns, "".join(f"# {line}\n" for line in head))


def account(report: dict[str, Any]) -> Iterator[str]:
    """Findings, repairs and open questions as sentences with numbers."""
    count = report.get
    if "names" in report:
        yield f"Warning: {report['names']}."
    if "flags_ignored" in report:
        yield (
            f"Warning: {report['flags_ignored']} disks are flagged as touching a wall, which is "
            "implausibly many. The flags are ignored; disks at the boundary of the frame count "
            "as those at walls."
        )
    yield (
        f"The files list {count('contacts_listed')} contacts of {count('grains')} disks. "
        f"{_walls(report)}"
    )
    mended = [f"{kind.words} ({report[name]})" for name, kind in KINDS.items()
              if kind.repaired and report[name]]  # fmt: skip
    if mended:
        yield f"Repaired, and marked with crosses: {'; '.join(mended)}."
    for key, words in DOUBTS:
        if report[key]:
            yield f"{report[key]} {words}"
    if report["unbalance_saved_if_tangential_forces_were_reversed"] > REVERSED:
        yield (
            "Disks would be closer to balance if all tangential forces had the opposite sign. "
            "Programs differ in this sign; try “Tangential forces reversed”."
        )
    yield (
        "On the listed contacts alone, no admissible forces balance "
        f"{count('unbalanced_on_listed_contacts')} of the inner disks. {count('candidates')} "
        "pairs at similar distances were added as unmeasured contacts."
    )
    yield _left(report)
    if "measured_pressures" in report:
        yield f"The pressures of {count('measured_pressures')} disks count as measurements, too."
    yield (
        "The admissible network nearest to the measurement differs from it by "
        f"{count('mean_change_of_f_n'):.2f} ⟨mₙ⟩ in fₙ and {count('mean_change_of_f_t'):.2f} ⟨mₙ⟩ "
        f"in fₜ on average, in units of the mean measured normal force ⟨mₙ⟩; "
        f"{count('candidates_that_carry')} of the added contacts carry force in "
        "it. It is one of many: unmeasured forces may differ. The standard error of "
        f"{count('error'):.2f} ⟨mₙ⟩ was estimated from how far the measured forces are from "
        "balance."
    )


def _walls(report: dict[str, Any]) -> str:
    at = f"{report['grains_at_walls']} disks are at walls"
    if report["walls"] == "open":
        return f"{at}: wall forces were not measured, so these disks need not balance."
    return (
        f"{at}: the directions of {report['wall_contacts']} contacts with the walls are known, so "
        "that the forces there are inferred like all others."
    )


DOUBTS = (
    ("listed_twice_with_other_forces", "contacts are listed twice with different forces: their "
                                       "mean is used, and the difference counts as an error."),
    ("beyond_friction", "measured tangential forces exceed the friction limit at this μ."),
)  # fmt: skip
REVERSED = 0.05  # fraction of the unbalance from which the sign of f_t is in doubt
NAMED = 12  # disks listed by name


def _left(report: dict[str, Any]) -> str:
    names = report["left_open"]
    if not names:
        return "With them every inner disk is balanced."
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return (
        f"With them {len(names)} inner disks still cannot be balanced; the remaining unbalance is "
        f"{report['unbalance']:.2g} ⟨mₙ⟩ in total. Their balance is not required (disks "
        f"{', '.join(map(str, names[:NAMED]))}{more})."
    )
