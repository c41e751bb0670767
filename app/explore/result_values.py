"""The numbers of the results line and of the status line, each with its reliability.

`measures`, `packing` and `sampling` describe what is on screen; `results_line` lays them out.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

from granforce.measures.sampling import FEWEST, MIXED

from ..results.library import Shown
from ..results.progress_feed import Summary
from ..results.replays import Replay, worded
from ..results.selection import KINDS, SOLVERS, Selection, differing
from ..state.app_state import AppState
from ..widgets.hints import term

UNBORNE = 1e-6  # ratio of two normal stresses below which the smaller one counts as none
LEAST_SIZE = 100  # effective size of a uniform sample below which its errors are large


class Quantity(NamedTuple):
    """A quantity with its values as text; empty if there is none (yet)."""

    key: str  # of the glossary
    symbol: str
    words: str
    seen: str = ""  # over the states, with its standard error if available
    exact: str = ""  # over all of S, or of the packing


class Sampling(NamedTuple):
    """How the states were generated, and whether they are reliable, in words."""

    sampler: str  # "nearest-network walk", with its explanation as HTML
    networks: str  # "1000 of 1000 attempts accepted, 50 kept"
    verdict: str  # "mixed", "not mixed", or empty if undecided
    mixing: str  # the reason: "R̂ 1.01 ≤ 1.1, effective size at least 49 ≥ 20", as HTML
    doubt: str  # why they are not reliable, "not mixed: …"; empty if they are

    def __str__(self) -> str:
        mixed = f"<b>{term('r_hat', self.verdict)}</b>: {self.mixing}"
        value = mixed if self.verdict else self.mixing
        return ", ".join(filter(None, (self.sampler, self.networks, value)))


def measures(state: AppState) -> list[Quantity]:
    """η1, η2, 0.15 η3 and the mean ΔF_n, over the states on screen and S; [] without states."""
    replay = state.replay
    if replay is None:
        return []
    summary, worth, possible = replay.summary, replay.sampling, state.settled
    extent = float((replay.high - replay.low)[:, 0].mean()) if len(replay.low) else math.nan
    return [
        Quantity("eta1", "η₁", "spread", with_error(summary["eta1"], worth.eta1_error)),
        Quantity("eta2", "η₂", "distance", with_error(summary["eta2"], worth.eta2_error)),
        Quantity(
            "eta3", "0.15 η₃", "intervals", short(0.15 * summary["eta3"]),
            "" if possible is None else short(0.15 * possible["eta3"].item()),
        ),
        Quantity("extent", "ΔFₙ", "mean", short(extent), _mean_extent(possible)),
    ]  # fmt: skip


def packing(state: AppState, volume: xr.Dataset | None = None) -> list[Quantity]:
    """z, φ, h and ln V of the packing on screen, exact; volume: from `compute.volume`."""
    if state.shown is None:
        return []
    summary = state.shown.summary
    unknowns = 2 * summary["contacts"] - summary.get("tangential_unknowns", 0)
    h, phi = summary["dimension"], summary["packing_fraction"]
    free, held = f"{h} = {unknowns} − {unknowns - h}", state.knowledge.whole
    if held is not None and state.narrows and not state.elsewhere:
        free = "{} → {} given the held forces".format(*held.dimension)
    each = worded(state.shown, "contacts per disk")
    return [
        Quantity("z", "z", each, exact=f"{summary['coordination']:.3f}"),
        Quantity(
            "phi", "φ", "packing fraction",
            exact="– (open box)" if math.isnan(phi) else f"{phi:.4f}",
        ),
        Quantity("h", "h", "free dimensions", exact=free),
        Quantity("volume", "ln V", "volume of S", exact=_volume(summary, volume)),
    ]  # fmt: skip


def _volume(summary: Summary, volume: xr.Dataset | None) -> str:
    """ln V, or why there is none; empty if it can be measured."""
    if volume is not None:
        return with_error(volume["log_volume"].item(), volume["log_volume_error"].item())
    if unbounded(summary):
        return "∞"
    return "" if summary["dimension"] else "– (one network)"


def unbounded(summary: Summary) -> bool:
    """Whether S is certified to be unbounded."""
    return math.isnan(summary.get("eta1", 0.0))


def changes(now: Shown, was: Shown | None = None) -> str:
    """μ, η, z, φ and h as HTML; with earlier states what has changed, as "old → new"."""
    shown = (now,) if was is None else (was, now)
    # η₃ of S only if S is that of the networks, without held forces, and differs between the two:
    # of the same packing only the networks have changed.
    exact = all(one.exact is not None and not one.cell.selection.held for one in shown)
    if was is None:
        return _listed(_compared(now, exact))
    new, old = now.cell.selection, was.cell.selection
    if not new.is_comparable(old):
        return f"Networks: {KINDS[old.kind]} → {KINDS[new.kind]}" * (new.kind != old.kind)
    exact = exact and not new.shares_packing(old)
    before, after = _compared(was, exact), _compared(now, exact)
    values = {name: f"{before[name]} → {one}" for name, one in after.items() if before[name] != one}
    old = old if new.mu == old.mu else old.at(new.mu)  # μ is among the values
    words = "" if new.names(old) else f"{differing(new, old)}: "
    return words * bool(values) + _listed(values)


def _listed(values: dict[str, str]) -> str:
    return ", ".join(f"<span>{name} {value}</span>" for name, value in values.items())


def _compared(shown: Shown, exact: bool) -> dict[str, str]:
    """exact: whether η3 is that of S, not of the networks."""
    summary, phi = shown.replay.summary, shown.replay.summary["packing_fraction"]
    eta3 = shown.exact["eta3"].item() if exact and shown.exact is not None else summary["eta3"]
    return {
        "μ": f"{shown.cell.mu:g}",
        "η₁": short(summary["eta1"]),
        "η₂": short(summary["eta2"]),
        f"0.15 η₃ ({'exact' if exact else 'seen'})": short(0.15 * eta3),
        "z": f"{summary['coordination']:.3f}",
        "φ": "–" if math.isnan(phi) else f"{phi:.4f}",
        "h": str(summary["dimension"]),
    }


def sampling(state: AppState) -> Sampling | None:
    """How the states on screen were generated, and whether they have mixed; None without states."""
    if state.replay is None or state.cell is None:
        return None
    selection, replay = state.cell.selection, state.replay
    name, networks = sampler(selection), _networks(replay)
    if not replay.summary["dimension"]:
        return Sampling(name, "", "", "one network: every force is determined", "")
    if selection.kind == "uniform":
        r_hat, size = replay.summary["worst_r_hat"], replay.summary["least_bulk_size"]
        return _judged(name, networks, r_hat, size, LEAST_SIZE, ("worst ", "least ", ""))
    worth = replay.sampling
    if math.isnan(worth.r_hat):
        few = f"{worth.states} networks are too few to say whether the walk has mixed"
        return Sampling(name, networks, "", "", few)
    bound = "at least " if replay.summary["kept"] < replay.summary["states"] else ""
    return _judged(name, networks, worth.r_hat, worth.effective, FEWEST, ("", "", bound))


def _judged(
    name: str, networks: str, r_hat: float, size: float, least: float, words: tuple[str, str, str]
) -> Sampling:
    """Whether networks have mixed, with the criterion; words: before R̂, size, and its value."""
    before, of_size, bound = words
    agree, enough = "≤" if r_hat <= MIXED else ">", "≥" if size >= least else "<"
    mixing = (
        f"{before}R̂ {r_hat:.2f} {agree} {MIXED:g}, "
        f"{of_size}{term('ess', 'effective size')} {bound}{size:.0f} {enough} {least:g}"
    )
    doubt = "; ".join(_doubts(r_hat, size, least))
    return Sampling(name, networks, "not mixed" if doubt else "mixed", mixing, doubt)


def sampler(selection: Selection) -> str:
    """The sampler, in words; a walk is also said not to be uniform."""
    if selection.kind == "uniform":
        return term("uniform", "uniform sample of S")
    return f"{term('walk', SOLVERS[selection.relax])} (not uniform)"


def _networks(replay: Replay) -> str:
    """The number of networks, and of the attempts they took."""
    summary = replay.summary
    states, stored = summary["states"], summary["kept"]
    words = f"{states} networks"
    if "accepted" in summary and not summary.get("skipped"):
        tried = sum(int(summary[name]) for name in ("accepted", "rejected", "unconverged"))
        words = f"{int(summary['accepted'])} of {tried} {term('accepted', 'attempts accepted')}"
    return f"{words}, {stored} kept" if stored < states else words


def _doubts(r_hat: float, size: float, least: float) -> Iterator[str]:
    if r_hat > MIXED:
        yield f"not mixed: R̂ = {r_hat:.2f}, more than {MIXED:g}"
    if size < least:
        yield (
            f"worth {size:.0f} independent networks, fewer than the {least:g} that reliable errors "
            "need"
        )


def _mean_extent(possible: xr.Dataset | None) -> str:
    if possible is None:
        return ""
    extent = (possible["high"] - possible["low"]).values[:, 0] / possible["force_scale"].item()
    if np.isinf(extent).any():
        return "∞"
    certified = extent[np.isfinite(extent)]
    return short(float(certified.mean())) if len(certified) else ""


def unborne(replay: Replay) -> str:
    """A warning if no network bears stress along a closed direction; empty if one does."""
    branch = replay.reach.T
    normal = branch / np.hypot(*branch)
    tangent = np.stack([-normal[1], normal[0]])
    # The first network of a packing without forces may carry less than others at this μ.
    stress = np.abs(
        replay.normal @ (normal * branch).T + replay.tangential @ (tangent * branch).T
    ).max(axis=0)
    small = np.isfinite(replay.box) & (stress < UNBORNE * stress.max(initial=0.0))
    if replay.outlines or not small.any():
        return ""
    missing, other = ("horizontal", "vertical") if small[0] else ("vertical", "horizontal")
    return (
        f"This packing bears no {missing} stress, only {other}: nothing holds it together "
        f"{'sideways' if small[0] else 'from above and below'}."
    )


def with_error(value: float, error: float) -> str:
    """A value and its standard error, to two digits of the error: "0.1021 ± 0.0012"."""
    if not error > 0 or not math.isfinite(error) or not math.isfinite(value):
        return short(value)
    digits = max(0, 1 - int(f"{error:.1e}".partition("e")[2]))
    return f"{value:.{digits}f} ± {error:.{digits}f}".replace("-", "−")


def between(low: float, high: float) -> str:
    """Two values with enough digits to distinguish them: "1.682 … 1.690"; one if they agree."""
    if not high > low:
        return short(low)
    digits = min(9, max(2, 1 - int(f"{high - low:.0e}".partition("e")[2])))
    return f"{low:.{digits}f} … {high:.{digits}f}".replace("-", "−")


def short(value: float) -> str:
    """A value to four digits, and 0 for rounding errors."""
    if not np.isfinite(value):
        return "–"
    return "0" if abs(value) < 1e-12 else f"{value:#.4g}".rstrip(".").replace("-", "−")
