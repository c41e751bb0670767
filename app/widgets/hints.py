"""Explanations of words on the page, shown on hover, focus and touch."""

from html import escape

import param

from granforce.glossary import TERMS, title

from ..browser.bundle import Scripted
from ..state.view_settings import COLOURS, EXPLAINED, WIDTHS

# Other words on the page → key of the glossary.
LABELS = {
    "Friction μ": "mu",
    "Disks N": "n",
    "Seed": "seed",
    "Networks": "states",
    "Friction during packing": "packed_mu",
    "Relaxation": "nearest",
    "Precomputed results": "store",
    "network as packed": "original",
    "force as packed": "original",
    "interval ΔFₙ, seen": "extent",
    "interval ΔFₙ, exact": "extent",
    "place in exact interval": "place",
    "reduction by held forces": "known",
    "mean force = 1": "mean_force",
    "force as packed = 1": "original",
    "Compute exact intervals": "exact",
    "the plane in which networks differ most": "principal",
    "both forces of one contact": "cone",
    "the normal forces of two contacts": "pair",
    "the stress that networks carry": "stress",
    "one contact": "push",
    "every contact": "limit_load",
    "against indeterminacy (Figure 2)": "critical_force",
    "Which force to measure next?": "informative",
    "Push": "push",
    "Force space": "s",
    "Intervals": "exact",
} | {words: EXPLAINED[key] for shown in (COLOURS, WIDTHS) for key, words in shown.items()}


def labels() -> dict[str, str]:
    """{words on the page: key of the glossary}."""
    return {term.word: key for key, term in TERMS.items()} | LABELS


def term(key: str, words: str | None = None) -> str:
    """A glossary word as HTML with its explanation; words: the text to display."""
    shown = escape(title(key) if words is None else words)
    return f'<span class="term" tabindex="0" data-term="{key}">{shown}</span>'


class Hints(Scripted):
    """Shows a sentence next to the word that is hovered, focused or touched; see hints.js."""

    terms = param.Dict(default={key: [title(key), t.sentence] for key, t in TERMS.items()})
    labels = param.Dict(default=labels())
