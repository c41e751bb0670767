"""The glossary: every symbol and every choice in a sentence or two, in everyday words.

The page shows these where a word stands, notebooks beside the names of their tables, the README
lists the symbols. Plain text; nothing is imported.
"""

from typing import NamedTuple


class Term(NamedTuple):
    """A word, its symbol where it has one, and what it means."""

    word: str
    sentence: str
    symbol: str = ""


TERMS = {
    # What everything is about
    "packing": Term(
        "packing",
        "Rigid disks pressed together until none can move. They never move here: every network is "
        "another set of contact forces on the same disks.",
    ),
    "network": Term(
        "force network",
        "One force at every contact, such that all disks are in balance: no net force and no net "
        "torque on any of them.",
    ),
    "s": Term(
        "force space",
        "All force networks that balance this packing at this pressure, with fₙ ≥ 0 and |fₜ| ≤ μ "
        "fₙ at every contact. Newton's laws are fewer equations than there are forces, so many "
        "networks remain; they form one convex body, without holes or dents.",
        "S",
    ),
    "indeterminacy": Term(
        "indeterminacy",
        "That geometry, load and the laws of mechanics do not fix the forces: disks that are "
        "rigid leave open which of the networks in S they carry.",
    ),
    "original": Term(
        "network as packed",
        "The forces that the packing came to rest with when it was compressed: one of all the "
        "networks that are possible.",
    ),
    "paper": Term(
        "the paper",
        "M. R. Shaebani, T. Unger, J. Kertész: Extent of force indeterminacy in packings of "
        "frictional rigid disks, Physical Review E 79, 052302 (2009).",
    ),
    # Symbols
    "mu": Term(
        "friction coefficient",
        "A contact holds as long as its tangential force is at most μ times its normal force. "
        "Each μ here has its own packing, made with that friction.",
        "μ",
    ),
    "n": Term("number of disks", "How many disks the packing has, loose ones included.", "N"),
    "phi": Term(
        "packing fraction", "The part of the box's area that the disks cover, loose ones too.", "φ"
    ),
    "z": Term(
        "contacts per disk",
        "How many contacts that can carry a disk has on average, loose disks left out: 4 without "
        "friction, near 3 with much of it.",
        "z",
    ),
    "h": Term(
        "dimensions of force space",
        "How many numbers can be chosen freely when all forces must balance: two forces per "
        "contact less the independent ones of the equations (three per disk and the pressure; in "
        "a periodic box two of them follow from the others). Where h = 0 the forces are "
        "determined.",
        "h",
    ),
    "fn": Term(
        "normal force",
        "How hard the two disks of a contact press on each other; never negative, as nothing "
        "sticks.",
        "fₙ",
    ),
    "ft": Term(
        "tangential force",
        "The force along the contact, by friction: at most μ fₙ either way.",
        "fₜ",
    ),
    "mean_force": Term(
        "mean normal force",
        "The mean of fₙ over the contacts; the page and figures give forces in this unit.",
        "⟨fₙ⟩",
    ),
    "extent": Term(
        "extent of a force",
        "Largest less smallest fₙ of one contact: over all of S (exact), or over those seen.",
        "ΔFₙ",
    ),
    "eta1": Term(
        "indeterminacy by spread",
        "By how much a contact's force scatters over the states, against the mean force: 0 if "
        "determined, 0.1 for a tenth.",
        "η1",
    ),
    "eta2": Term(
        "indeterminacy by distance",
        "How far apart two states are in force space on average, against the size of the mean "
        "state.",
        "η2",
    ),
    "eta3": Term(
        "indeterminacy by intervals",
        "How long the interval of a contact's force is on average, against the mean force. An "
        "interval is several times as long as forces scatter in it: plots show 0.15 η3, to be "
        "compared with η1 and η2.",
        "η3",
    ),
    "width": Term(
        "width of S",
        "How wide S is along each of its h free dimensions, in ⟨fₙ⟩, from its volume V: that of "
        "the normal distribution which leaves as much open.",
        "V^(1/h)/√(2πe)",
    ),
    "volume": Term(
        "volume of S",
        "How many force networks there are: the logarithm of the h-dimensional volume that they "
        "fill, with fₙ and fₜ of every contact in ⟨fₙ⟩. It is the entropy of the forces.",
        "ln V",
    ),
    "mobilisation": Term(
        "mobilisation",
        "How much of its friction a contact uses: ±1 is about to slide to one side or the other, "
        "0 carries no tangential force.",
        "fₜ/(μ fₙ)",
    ),
    "residual": Term(
        "residual",
        "The largest force that is left unbalanced on any disk, in ⟨fₙ⟩: how exactly a network is "
        "in balance.",
    ),
    "distance": Term(
        "distance from the centre",
        "How far this network is in force space from the mean of all networks shown, in ⟨fₙ⟩.",
    ),
    "accepted": Term(
        "accepted", "The part of the walk's attempts that ended in a network in balance."
    ),
    "r_hat": Term(
        "mixing",
        "Whether chains that began apart tell the same: 1 if they do, above 1.1 they have not "
        "mixed and the sample is not to be relied on.",
        "R̂",
    ),
    "ess": Term(
        "effective sample size",
        "How many independent states the sample is worth, for the force that is known least well.",
        "ESS",
    ),
    "limit_load": Term(
        "limit load",
        "The largest force pair on one contact for which any network in balance exists at all: "
        "more it cannot bear, whatever happened before.",
    ),
    "critical_force": Term(
        "critical force",
        "The force pair on one contact, grown from nothing, at which the disks set off. Never "
        "above the limit load; below it where networks in balance are left, but not the one that "
        "friction would have to build up on the way.",
        "Fᶜʳⁱᵗ",
    ),
    "alpha": Term(
        "decay exponent",
        "How fast the first motion falls with the distance r from the pushed contact: |u| ~ r⁻ᵅ.",
        "α",
    ),
    "correlation": Term(
        "correlation",
        "1 if the strongest contacts are the least determined, 0 if the one says nothing about "
        "the other.",
        "corr(fₙ, ΔFₙ)",
    ),
    # Kinds of knowing
    "exact": Term(
        "possible (exact)",
        "What a contact's force can be at all: bounds over all of S, computed and certified.",
    ),
    "known": Term(
        "known forces",
        "Forces of single contacts that are taken for known, held or within an error bar, as if "
        "they had been measured: fewer networks agree with them, and all intervals shrink.",
    ),
    "informative": Term(
        "which measurement next",
        "The contacts whose fₙ, once known, would leave the shortest intervals on average: chosen "
        "by how forces go together over uniform states, then put in order by exact bounds.",
    ),
    "seen": Term("seen", "What the networks passed so far had: always within what is possible."),
    "now": Term("now", "The network on screen."),
    "rattler": Term("rattler", "A loose disk that carries nothing; drawn pale, and left out."),
    "unloaded": Term(
        "unloaded contact", "Disks touch there, but no network in balance has a force there."
    ),
    "no_friction": Term(
        "forces along contacts",
        "Where a contact has no friction, no force acts along it: there is nothing to compute.",
    ),
    "determined": Term(
        "networks that could only be the same",
        "Where balance leaves no force open, every network is the one there is: none was computed.",
    ),
    "held_components": Term(
        "forces that cannot vary", "The same in every network of S: there is nothing to sample."
    ),
    "dropped": Term(
        "networks on the way",
        "The first networks of a sample, which still depend on where it began, do not count.",
    ),
    "failed": Term(
        "failed attempts",
        "Kicks after which no network in balance was found: the walk tries again.",
    ),
    "segment": Term(
        "force lines",
        "One line for each contact, as thick as its force. A contact across the edge of the box "
        "is drawn on both sides, so there are more lines than contacts.",
    ),
    "backbone": Term("backbone", "The disks and contacts that can carry a force."),
    # Where states come from
    "walk": Term(
        "the paper's random walk",
        "From one state to the next: all forces are kicked at random, then brought back into "
        "balance. Its states lie on the boundary of S; in a shadow of two directions out of many, "
        "even points of the boundary fall near the middle.",
    ),
    "uniform": Term(
        "uniform in S",
        "States drawn such that every part of S is visited in proportion to its volume.",
    ),
    "accelerated": Term(
        "nearest admissible state",
        "After a kick, the network in balance that is nearest to the kicked forces, in force "
        "space: fast, and always found.",
    ),
    "nearest": Term(
        "nearest admissible state, by PIQP",
        "The same network nearest to the kicked forces, found by another program as a check.",
    ),
    "gauss_seidel": Term(
        "Gauss–Seidel, finished exactly",
        "After a kick, contacts are adjusted one after the other, again and again (Gauss–Seidel), "
        "until nearly in balance, as in the paper; the nearest network takes the last digits.",
    ),
    "gauss_seidel_only": Term(
        "paper's plain Gauss–Seidel",
        "After a kick, contacts are adjusted one after the other, again and again (Gauss–Seidel), "
        "until all disks are in balance, as in the paper: slow, and some attempts fail.",
    ),
    # What colours, widths and orders show
    "change": Term(
        "change from the forces as packed",
        "Orange contacts carry more than when the disks came to rest, blue ones less.",
    ),
    "pinned": Term(
        "pinned network", "A network that was marked, for others to be compared with it."
    ),
    "sign": Term(
        "sign of fₙ − pinned fₙ",
        "Orange contacts carry more than in the pinned network, blue ones less.",
    ),
    "difference": Term(
        "|fₙ − pinned fₙ|", "By how much a contact's force differs from that in the pinned network."
    ),
    "gone": Term(
        "what is known",
        "How much shorter a contact's interval is by the forces that are known (held, or measured "
        "within an error bar): as colour in parts of its length, 1 where nothing is left open; as "
        "width in ⟨fₙ⟩.",
    ),
    "deviation": Term(
        "inferred less measured fₙ",
        "Orange contacts carry more in the inferred network than was measured, blue ones less, in "
        "standard deviations σ of the measurement; grey where nothing was measured.",
    ),
    "measured": Term(
        "measured fₙ", "The normal force that was measured; none where there was no measurement."
    ),
    "carrying": Term(
        "carry for certain",
        "Contacts with a force above 0 in every network that is left, by certified bounds.",
    ),
    "overlay": Term(
        "strong and undetermined contacts",
        "Filled: the tenth of the contacts with the largest force; rings: the tenth with the "
        "largest extent ΔFₙ. They are often not the same (Fig. 5 of the paper).",
    ),
    "place": Term(
        "place in its interval",
        "Where the force as packed lies between the least and the largest possible.",
    ),
    # Views of force space
    "principal": Term(
        "principal axes",
        "The shadow that S casts on the plane of the two directions along which the networks vary "
        "most; a shadow, not a section. The per cent at an axis are the part of their scatter "
        "(variance) that goes along it.",
    ),
    "cone": Term(
        "forces of one contact",
        "The shadow of S on fₙ and fₜ of one contact: it lies inside Coulomb's cone |fₜ| ≤ μ fₙ.",
    ),
    "pair": Term(
        "normal forces of two contacts",
        "The shadow of S on fₙ of two contacts, two strong ones at first; one that is clicked in "
        "the packing takes the place of the green one.",
    ),
    "stress": Term(
        "plane of stresses",
        "The stress of a network at this pressure P, as a point: how much more it presses along x "
        "than along y, and how much it shears. At (0, 0) it presses alike from all sides; the "
        "distance from it is the largest shear stress over P.",
    ),
    "outline": Term(
        "outline", "The edge of the shadow of all of S: no network in balance lies outside."
    ),
    # Doing
    "push": Term(
        "push a contact",
        "Two opposite forces press the disks of one contact apart, growing until the packing "
        "gives way: how it resists depends on how undetermined its forces are.",
    ),
    "seed": Term(
        "seed", "The number that chance starts from: the same seed gives the same packing."
    ),
    "states": Term("states", "How many force networks of the one packing are made."),
    "packed_mu": Term(
        "friction during packing",
        "The friction with which the packing was made, if it is not the one that its forces have "
        "now.",
    ),
    "store": Term(
        "precomputed results",
        "States that were computed before and kept, each series with the values of μ that it has: "
        "some came with the page, others were computed here since.",
    ),
    "study": Term(
        "the study",
        "Many packings at 14 to 16 values of μ, explored in all ways that the page knows; their "
        "averages came with the page.",
    ),
}


def title(key: str) -> str:
    """A term as it is named: "friction coefficient μ"."""
    return f"{TERMS[key].word} {TERMS[key].symbol}".strip()


def markdown() -> str:
    """The terms that have a symbol, as a Markdown table."""
    lines = ["| symbol | is called | means |", "|---|---|---|"]
    for word, sentence, symbol in TERMS.values():
        if symbol:
            escaped = symbol.replace("|", "\\|")
            lines.append(f"| {escaped} | {word} | {sentence.replace('|', chr(92) + '|')} |")
    return "\n".join(lines)
