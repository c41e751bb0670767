"""What a word on the page means: told where it stands, on hover, focus and touch."""

from html import escape
from typing import ClassVar

import param

from granforce.glossary import TERMS, title

from .scripts import FOLDER, Scripted, module

# Words on the page that are not the glossary's own: what stands there → key of the glossary.
LABELS = {
    "Friction μ": "mu",
    "Disks N": "n",
    "Seed": "seed",
    "States": "states",
    "Friction during packing": "packed_mu",
    "States from": "s",
    "Relaxation": "accelerated",
    "Precomputed results": "store",
    "what is known: part of the interval gone": "gone",
    "what is known: length of the interval gone": "gone",
    "inferred less measured fₙ, in σ": "deviation",
    "Colour": "mobilisation",
    "Width": "fn",
    "mobilisation fₜ/(μ fₙ)": "mobilisation",
    "length of the interval ΔFₙ": "extent",
    "ΔFₙ": "extent",
    "normal force fₙ": "fn",
    "Strong and undetermined contacts": "overlay",
    "original fₙ": "original",
    "ΔFₙ of all states": "seen",
    "exact ΔFₙ": "exact",
    "place of the original in its interval": "place",
    "how much what is known shortened it": "known",
    "fₙ / ⟨fₙ⟩": "mean_force",
    "fₙ / original fₙ": "original",
    "Compute exact intervals": "exact",
    "principal axes": "principal",
    "fₙ, fₜ of a contact": "cone",
    "fₙ of two contacts": "pair",
    "stresses": "stress",
    "η against μ": "eta2",
    "lengths ΔFₙ": "extent",
    "correlation": "correlation",
    "ΔFₙ against fₙ": "correlation",
    "forces fₙ": "fn",
    "one contact": "push",
    "Which measurement next?": "informative",
    "Push": "push",
    "failure load of every contact": "limit_load",
    "critical force against η2": "critical_force",
    "Force space": "s",
    "Intervals": "exact",
    "limit load": "limit_load",
    "what limit loads are": "limit_load",
}


def labels():
    """{words on the page: key of the glossary}."""
    return {term.word: key for key, term in TERMS.items()} | LABELS


def term(key, words=None):
    """A word of the glossary as HTML, explained where it stands; words: how it is called there."""
    shown = escape(title(key) if words is None else words)
    return f'<span class="term" tabindex="0" data-term="{key}">{shown}</span>'


class Hints(Scripted):
    """Shows a sentence beside the word pointed at, focused or touched; see hints.js."""

    terms = param.Dict(default={key: [title(key), t.sentence] for key, t in TERMS.items()})
    labels = param.Dict(default=labels())

    _esm = module("hints")
    _stylesheets: ClassVar = [FOLDER / "hints.css"]
