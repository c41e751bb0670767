"""The glossary: every symbol and every option in a sentence or two, in everyday words.

The app shows these next to a word, notebooks next to the names in tables, and the documentation
lists the symbols. Plain text; nothing is imported.
"""

from typing import NamedTuple


class Term(NamedTuple):
    """A word, its symbol if it has one, and its meaning."""

    word: str
    sentence: str
    symbol: str = ""


TERMS = {
    # The subject
    "packing": Term(
        "packing",
        "Rigid disks compressed until they jam. They never move here: every network is another "
        "set of contact forces on the same disks.",
    ),
    "network": Term(
        "force network",
        "One force at every contact such that all disks are in balance: no net force and no net "
        "torque on any of them.",
    ),
    "s": Term(
        "set of force networks",
        "All networks of this packing at this pressure, with fₙ ≥ 0 and |fₜ| ≤ μ fₙ at every "
        "contact: a convex body, without holes or dents, in force space, which has an axis for "
        "every force. Balance gives fewer equations than there are forces, so many networks "
        "remain.",
        "S",
    ),
    "indeterminacy": Term(
        "indeterminacy",
        "Geometry, load and the laws of mechanics do not determine the contact forces of rigid "
        "disks: any network in S is possible.",
    ),
    "original": Term(
        "original network",
        "The forces with which the packing came to rest after compression, one of the networks in "
        "S. For an imported packing, the imported forces. In short, the forces as packed.",
    ),
    "paper": Term(
        "the paper",
        "M. R. Shaebani, T. Unger, J. Kertész: Extent of force indeterminacy in packings of "
        "frictional rigid disks, Physical Review E 79, 052302 (2009).",
    ),
    # Symbols
    "mu": Term(
        "friction coefficient",
        "A contact can carry a tangential force of at most μ times its normal force. Each μ "
        "here has its own packing, made with that friction.",
        "μ",
    ),
    "n": Term("number of disks", "The number of disks in the packing, including loose ones.", "N"),
    "phi": Term(
        "packing fraction",
        "The fraction of the box area that the disks cover, including loose ones.",
        "φ",
    ),
    "z": Term(
        "contacts per disk",
        "The average number of contacts per disk that can carry force, not counting loose "
        "disks: about 4 without friction, close to 3 at high friction.",
        "z",
    ),
    "h": Term(
        "dimension of S",
        "How many numbers can be chosen freely once all forces balance. With friction: two "
        "forces per contact, minus the independent equations (three per disk and one for the "
        "pressure, two of which follow from the others in a periodic box). If h = 0, the forces"
        " are determined.",
        "h",
    ),
    "fn": Term(
        "normal force",
        "How hard the two disks of a contact press on each other. It is never negative, because"
        " disks do not stick together.",
        "fₙ",
    ),
    "ft": Term(
        "tangential force",
        "The friction force along the contact: at most μ fₙ in either direction.",
        "fₜ",
    ),
    "mean_force": Term(
        "mean normal force",
        "The mean of fₙ over the contacts that can carry force, the unit of force on the page "
        "and in the figures. If the pressure is prescribed, the mean is weighted by the "
        "distance between centres, which makes it the same in all networks. Otherwise it is the"
        " plain mean of the original network.",
        "⟨fₙ⟩",
    ),
    "extent": Term(
        "extent of a force",
        "Largest minus smallest fₙ of one contact, over all of S (exact) or over the networks "
        "seen. The latter grows with their number.",
        "ΔFₙ",
    ),
    "eta1": Term(
        "indeterminacy by spread",
        "How much a contact's force F scatters over the networks, relative to the mean force: "
        "η1 = ⟨δF⟩ / ⟨|G|⟩ over contacts, with its mean G and its scatter δF = √⟨|F − G|²⟩ over "
        "networks. 0 if determined, 0.1 for a scatter of a tenth.",
        "η1",
    ),
    "eta2": Term(
        "indeterminacy by distance",
        "The typical distance between two networks in force space, relative to the size of the "
        "mean network: η2 = √(⟨Σ|F − F′|²⟩ / Σ|G|²), with sums over contacts, a mean over pairs of "
        "networks F and F′, and the mean network G.",
        "η2",
    ),
    "eta3": Term(
        "indeterminacy by intervals",
        "The mean length of the intervals of fₙ and fₜ, divided by the mean of their midpoints,"
        " which are signed for fₜ: η3 = ⟨max − min⟩ / ⟨(max + min)/2⟩. The paper multiplies it by "
        "0.15, to plot it beside η1 and η2. The value seen grows with the number of networks, and "
        "can exceed the exact one, as midpoints differ.",
        "η3",
    ),
    "width": Term(
        "width of S",
        "The typical width of S along each of its h free dimensions, in ⟨fₙ⟩, computed from its "
        "volume V: the standard deviation of a normal distribution with the same entropy.",
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
        "How much of its available friction a contact uses: at ±1 it is about to slide one way "
        "or the other, at 0 it carries no tangential force.",
        "fₜ/(μ fₙ)",
    ),
    "residual": Term(
        "residual", "The largest unbalanced force on any body, in ⟨fₙ⟩: 0 is perfect balance."
    ),
    "distance": Term(
        "distance from the centre",
        "How far this network is from the mean of all networks shown, measured in force space "
        "in ⟨fₙ⟩.",
    ),
    "accepted": Term("accepted", "How many of the walk's attempts ended in a balanced network."),
    "error": Term(
        "standard error",
        "The sampling error of a mean over the networks of this one packing: how much it would "
        "vary if the walk were repeated. Other packings made with the same μ differ by more.",
        "±",
    ),
    "r_hat": Term(
        "mixing",
        "Whether parts of the sample agree, such as both halves of a walk: 1 if they do. Mixed "
        "means R̂ ≤ 1.1 and enough independent states. Otherwise the sample is unreliable.",
        "R̂",
    ),
    "ess": Term(
        "effective sample size",
        "How many independent networks the sample is worth, for the force that is sampled least "
        "well.",
        "ESS",
    ),
    "limit_load": Term(
        "limit load",
        "The largest pair of opposite forces, along the normal of one contact, that pushes its "
        "disks apart and for which a balanced network exists, whatever the history. The pair "
        "counts in the balance like fₙ, but not for the friction of the contact: the limit load is "
        "the largest fₙ − |fₜ|/μ, at most the largest fₙ.",
    ),
    "critical_force": Term(
        "critical force",
        "The pair of opposite forces on one contact, increased from zero, at which the disks "
        "start to move. It never exceeds the limit load. It is smaller where balanced networks "
        "still exist but friction does not build one up on the way.",
        "F_crit",
    ),
    "alpha": Term(
        "decay exponent",
        "How fast the first motion decays with the distance r from the pushed contact: |u| ~ r⁻ᵅ.",
        "α",
    ),
    "correlation": Term(
        "correlation",
        "1 if the strongest contacts are the least determined, 0 if a contact's force says "
        "nothing about its extent.",
        "corr(fₙ, ΔFₙ)",
    ),
    # Kinds of knowledge
    "exact": Term(
        "possible (exact)",
        "All values that a contact's force can take: bounds over all of S, computed and certified.",
    ),
    "certified": Term(
        "certified bounds",
        "Each end of an exact interval is a linear program. One network attains it, and a dual "
        "solution shows, in double precision, that none is beyond it by more than the gap.",
    ),
    "at_rest": Term(
        "at rest",
        "Tested: with its forces as packed, contact dynamics moves no disk. Not tested: the "
        "packing was imported, or made without this test.",
    ),
    "known": Term(
        "known forces",
        "Forces of single contacts that are treated as measured, exactly or within an error "
        "bar. Fewer networks agree with them, so intervals shrink.",
    ),
    "informative": Term(
        "which measurement next",
        "The contacts whose fₙ, once known, would leave the shortest intervals on average: "
        "selected by the covariance of forces over uniform networks, then ranked by exact bounds.",
    ),
    "seen": Term(
        "seen",
        "The interval of a contact's force over all random networks of the walk or sample, played "
        "or not. It is within the exact one, but for the residual of the paper's walk.",
    ),
    "now": Term("now", "The network on screen."),
    "rattler": Term(
        "loose disk",
        "A disk or block that carries no force, also called a rattler. It is drawn pale and "
        "left out of the equations.",
    ),
    "unloaded": Term(
        "contact without force",
        "The disks touch, but no balanced network has a force at this contact.",
    ),
    "no_friction": Term(
        "forces along contacts",
        "Without friction, no force acts along a contact: there is nothing to compute.",
    ),
    "determined": Term(
        "networks that could only be the same",
        "Where balance leaves no force open, there is only one network, so no others were "
        "computed.",
    ),
    "held_components": Term(
        "forces that cannot vary",
        "They are the same in every network of S: there is nothing to sample.",
    ),
    "dropped": Term(
        "networks before the sample",
        "The first networks of a sample still depend on its starting point and are discarded.",
    ),
    "failed": Term(
        "failed attempts", "Kicks after which no balanced network was found. The walk tries again."
    ),
    "segment": Term(
        "force lines",
        "One line for each contact, as thick as its force. A contact across the edge of the box "
        "is drawn on both sides, so there are more lines than contacts.",
    ),
    "backbone": Term("backbone", "The bodies and contacts that can carry a force."),
    # Sources of states
    "walk": Term(
        "random walk",
        "Each step kicks all forces at random, then restores balance: by moving to the nearest "
        "network, or, in the paper's walk, by sweeps. Most of its networks lie on the boundary of "
        "S: they are not uniform in S. Projected from many dimensions onto two, even boundary "
        "points can fall near the middle.",
    ),
    "uniform": Term(
        "uniform in S",
        "Networks drawn so that every part of S is visited in proportion to its volume.",
    ),
    "nearest": Term(
        "nearest-network walk",
        "After a kick, the balanced network nearest to the kicked forces in force space: fast, "
        "and always found.",
    ),
    "nearest_piqp": Term(
        "nearest-network walk, by PIQP",
        "The same network nearest to the kicked forces, computed by another program as a check.",
    ),
    "gauss_seidel": Term(
        "walk by sweeps, finished exactly",
        "After a kick, contacts are adjusted one by one, again and again (Gauss–Seidel), until "
        "nearly in balance, as in the paper. The nearest network supplies the last digits.",
    ),
    "gauss_seidel_only": Term(
        "the paper's walk, by sweeps alone",
        "After a kick, contacts are adjusted one by one, again and again (Gauss–Seidel), until "
        "all disks are in balance, as in the paper: slow, and some attempts fail.",
    ),
    # Meanings of colours, widths and orders
    "change": Term(
        "change from the forces as packed",
        "Orange contacts carry more than when the disks came to rest, blue ones less.",
    ),
    "gone": Term(
        "what is known",
        "How much the known forces (fixed, or measured within an error bar) shorten a contact's "
        "interval. Colour: the fraction of its length, 1 where nothing is left open. Width: the "
        "difference in ⟨fₙ⟩.",
    ),
    "deviation": Term(
        "inferred less measured fₙ",
        "Orange contacts carry more in the inferred network than measured, blue ones less, in "
        "standard deviations σ of the measurement, and grey where nothing was measured.",
    ),
    "measured": Term("measured fₙ", "The measured normal force, blank where nothing was measured."),
    "carrying": Term(
        "carry for certain",
        "Contacts with a force above 0 in every network that remains, by certified bounds.",
    ),
    "place": Term(
        "place in its interval",
        "Where the force as packed lies between the smallest and the largest possible.",
    ),
    # Views of force space
    "principal": Term(
        "principal axes",
        "The shadow of S on the plane of the two directions along which the networks vary most:"
        " a shadow, not a section. The percentage at an axis is its share of their scatter "
        "(variance).",
    ),
    "cone": Term(
        "forces of one contact",
        "The shadow of S on the plane of fₙ and fₜ of one contact. It lies inside Coulomb's "
        "cone |fₜ| ≤ μ fₙ.",
    ),
    "pair": Term(
        "normal forces of two contacts",
        "The shadow of S on the plane of fₙ of two contacts, initially two strong ones. Click a "
        "contact in the packing to replace the green one.",
    ),
    "stress": Term(
        "plane of stresses",
        "The stress of a network at this pressure P, as a point: how much more it presses along"
        " x than along y, and how much it shears. At (0, 0) it presses equally in all "
        "directions. The distance from there is the largest shear stress over P.",
    ),
    "outline": Term("outline", "The edge of the shadow of S: no balanced network lies outside."),
    # Actions
    "push": Term(
        "push a contact",
        "Two opposite forces push the disks of one contact apart, growing until the packing "
        "gives way. The paper relates this resistance to the indeterminacy of the forces.",
    ),
    "seed": Term(
        "seed", "The starting value of the random numbers: the same seed gives the same packing."
    ),
    "states": Term("networks", "The number of force networks generated for this packing."),
    "packed_mu": Term(
        "friction during packing",
        "The friction with which the packing was made, if it differs from the friction of its "
        "forces now.",
    ),
    "store": Term(
        "precomputed results",
        "Networks computed earlier and kept, listed with the values of μ available: some came "
        "with the page, others were computed here.",
    ),
    "study": Term(
        "the study",
        "Many packings at each of many values of μ, explored by every method of this page. Their "
        "averages come with the page.",
    ),
}


def title(key: str) -> str:
    """A term with its symbol: "friction coefficient μ"."""
    return f"{TERMS[key].word} {TERMS[key].symbol}".strip()
