// The eight chapters: their text, as functions of the numbers on screen, and the experiment of
// each.

import { AgainstFriction } from "./experiments/against_friction.js"
import { Chance } from "./experiments/chance.js"
import { Friction } from "./experiments/friction.js"
import { Grab } from "./experiments/grab.js"
import { HeldForces } from "./experiments/held_forces.js"
import { Push } from "./experiments/push.js"
import { SceneExperiment } from "./experiments/scene_experiment.js"

const two = (v) => v.toFixed(2)
const listed = (words) => new Intl.ListFormat("en-GB").format(words)
const touching = ({ contacts, disks }) => 2 * contacts / disks
/** Once S has no end: why; otherwise this question. */
const prompted = ({ endless }, question) => (endless ? "Two contacts now lie in each other’s wedges: they can press on what is between them as hard as you like, since such forces cancel." : question)
const percent = (v) => `${Math.round(100 * v)}\u00a0%`
const raised = (v) => [...String(v)].map((digit) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[digit]).join("")
// Without walls: a further row of the count.
const PRESSED = ["two follow from the others, as forces between disks cancel in the sum over all disks; one more: the pressure is given", "− 2 + 1"]

const tabled = (rows) => `<table>${rows.map((row) => `<tr>${row.map((cell) => `<td>${cell}</td>`).join("")}</tr>`).join("")}</table>`

/** The largest force in a groove of two walls at 45° as a linear program, folded. */
const PROGRAM = `<details><summary>A linear program, written out: the disk in the groove</summary>${tabled([
  ["largest", "N₁"], ["no net force sideways", "N₁ − T₁ = N₂ − T₂"], ["none up or down", "N₁ + T₁ + N₂ + T₂ = √2 × weight"], ["no turning", "T₁ = T₂"],
  ["friction is limited (T: up along the wall)", "−μN₁ ≤ T₁ ≤ μN₁, −μN₂ ≤ T₂ ≤ μN₂"], ["walls only press", "N₁ ≥ 0, N₂ ≥ 0"], ["the corner found, for μ = 0.5", "N₁ = N₂ = 1.41, T₁ = T₂ = −0.71"],
])}</details>`

export const SUMMARY = `<ul>
  <li><b>S</b>: all sets of forces that hold the same disks.</li>
  <li><b>Its dimension</b>: unknown forces minus equations.</li>
  <li><b>Walk</b>: what is typical. <b>Linear program</b>: what is possible.</li>
  <li><b>More friction</b>: first S is wider, then it loses dimensions.</li>
  <li><b>Limit load</b>: S ends. Disks move before.</li></ul>`

/** The count of free numbers, line by line, with the sum in the last row. */
function counted({ contacts, disks, equations, free }, pressed) {
  return [
    [`${contacts} contacts × 2 forces, normal and tangential`, 2 * contacts],
    [`${disks} ${disks > 1 ? "disks" : "disk"} × 3 equations: no net force sideways, none up or down, no turning`, 3 * disks],
    ...(pressed ? [PRESSED] : []),
    [`free numbers: ${2 * contacts} − ${equations}`, free],
  ]
}

/**
 * Each chapter: name in links; title in the list; card: the question in the last picture; heading; text and ask, shown first;
 * first: the instruction for predicting, if it is not the usual one; doing(facts), the instruction for dragging; see(facts): reason, surprise and more, as HTML; verdict(facts, prediction): {answer, so},
 * in place of "It is …" and of how far the prediction is off; count(facts): the rows of a sum, live during dragging if `live`;
 * x, y, second: axes; experiment with options.
 */
export const CHAPTERS = [
  {
    name: "four-hundred", title: "Pull a force", card: "Largest force at the marked contact (mean = 1)", heading: "Pull one force",
    text: ({ all, mu }) => `${all} disks with friction μ = ${mu}, pressed together from all sides. Each line is the force between two of them: the thicker, the stronger. <b>Pull the marked line upwards.</b> Others follow, orange ones grow, blue ones shrink, and every disk stays in balance.`,
    ask: "How large can this force become while no disk moves?",
    first: "Pull the marked line a little; then drag the marker to your prediction.",
    doing: () => "Drag the dot to the right, or the marked line upwards, as far as it goes.",
    see: ({ start, opened, sliding, changed, contacts }) => [
      `It began at ${two(start)}. ${changed} of ${contacts - 1} other forces have changed by more than a tenth of the mean, and no disk has moved: a photograph would be the same. It ends where ${sliding} contacts are about to slip (dots) and ${opened} about to open (rings).`,
      "So a packing alone does not fix its forces. How can that be? A ladder, one disk, two disks, thirteen: then you will know. Pull other lines, too.",
    ],
    x: { low: 0, high: 6, label: "force of the marked line (mean force = 1)" }, y: null,
    experiment: Grab, options: { marked: "grabbed" },
  },
  {
    name: "ladder", title: "A ladder", card: "A ladder’s force on the wall (its weight = 1)", heading: "Which will it be?",
    text: ({ mu }) => `A ladder of weight 1 leans against a rough wall on a rough floor: friction is at most μ = ${mu} times the normal force (blue wedges). A mechanics course solves it without friction at the wall. With it, four forces are unknown, two at each end, and there are three equations of balance. The arrows show one solution.`,
    ask: "What is the wall’s normal force?",
    doing: () => "Drag the dot to both ends, and past them, or drag an arrow. Wherever you stop in between, the ladder is in balance.",
    verdict: ({ low, high }, prediction) => ({
      answer: `Anything from ${two(low)} to ${two(high)}.`,
      so: +two(prediction) < +two(low) || +two(prediction) > +two(high) ? ", which is not among them" : ": possible, like all the others",
    }),
    see: ({ low, high, smooth, endless }) => [
      `At ${two(low)} the wall’s friction holds the ladder up as hard as it can; at ${two(high)} it pulls it down. Textbooks make the wall smooth and keep the floor rough: only ${two(smooth)} is left. (The slider changes both.)`,
      prompted({ endless }, "A real ladder takes one of the possible values. Which one depends on how it bends and was set up, and a rigid body knows neither. So we ask: what is possible? <b>All sets of forces that hold it are called S</b>: the blue bar."),
    ],
    x: { low: 0, high: 0.6, label: "normal force at the wall (weight of the ladder = 1)" }, y: null,
    experiment: SceneExperiment, options: { scene: "ladder", x: 2, y: null, goal: "both" },
  },
  {
    name: "groove", title: "One disk in a groove", card: "Friction at which a groove jams a disk", heading: "How hard can a wall press?",
    text: ({ mu, low, high }) => `A disk of weight 1 lies between two walls. Each exerts a normal force on it and a friction force along the wall, at most μ times as large (blue wedges). Four unknown forces, three equations: one number stays free. At μ = ${mu} the left wall’s normal force can be anything from ${two(low)} to ${two(high)}.`,
    ask: "From which friction μ on can it be as large as you like?",
    doing: () => "Drag the dot to the right; up and down changes the force at one μ, and an arrow can be dragged too. What is possible turns blue. A wedge turns grey where its contact is about to slip.",
    see: ({ mu, low, high, smooth, answer }) => [
      `From μ = ${answer} on, each contact lies in the other one’s wedge: the walls can press the disk between them as hard as you like, since such forces cancel. With less friction S has ends: ${two(low)} to ${two(high)} at μ = ${mu}, and ${two(smooth)} alone without friction.`,
      "Above each μ, every point of the blue area is one set of forces that holds the disk. Which one is real depends on how the disk was pressed in and how it deforms, if only by a hair; we call disks rigid to leave both open.",
    ],
    count: (facts) => counted(facts, false),
    x: { low: 0, high: 1.2, label: "friction μ", symbol: "μ = " }, y: { low: 0, high: 4, label: "left wall’s normal force" },
    experiment: AgainstFriction, options: { scene: "groove", x: 0, y: null, most: 1.2 },
  },
  {
    name: "box", title: "Two disks in a box", card: "Largest force on the floor below two disks of weight 1", heading: "How much can the floor carry?",
    text: ({ mu }) => `Two disks of weight 1 lie in a box, with friction of at most ${mu} times each normal force. Eight unknown forces, six equations: two numbers stay free, and S is an area. The axes of the plot are two of the forces, green and violet.`,
    ask: "How large can the floor’s normal force become?",
    doing: () => "Drag the dot as far as it goes: right, up, left and down. What its path encloses turns blue: between two possible sets of forces, every mixture is possible too.",
    see: ({ high, weight, endless }) => [
      `Together, the disks weigh ${weight}. The other ${two(high - weight)} comes from the walls, where friction pulls the wedged disks down. With more, the lower disk would slip on the floor.`,
      `Like any maximum of a force, it lies at a corner of S. Finding it is called a linear program; a computer does it for all forces of 400 disks in under a second.${PROGRAM}`,
      prompted({ endless }, "Drag the dot along the edges: above the drawing you read what is about to slip. Then raise the friction, until S has no end here either."),
    ],
    count: (facts) => counted(facts, false),
    x: { low: 1, high: 4, label: "normal force at the floor (green)" }, y: { low: 0, high: 5, label: "between the disks (violet)" },
    experiment: SceneExperiment, options: { scene: "box", x: 4, y: 0, goal: "round" },
  },
  {
    name: "thirteen", title: "Thirteen disks", card: "Forces to hold until no other can change", heading: "When is everything fixed?",
    text: ({ contacts, disks, mu }) => `${disks === 13 ? "Thirteen" : disks} disks with friction μ = ${mu} are squeezed from all sides; beyond the dashed frame the picture repeats. At ${contacts} contacts there are ${2 * contacts} unknown forces, and balance leaves many sets of them. Now hold one normal force at its value, then another, and so on.`,
    ask: "How many must you hold until none of the others can change?",
    doing: () => "Click an arrow: its normal force is held (magenta), and all forces that still can change jump. Grey ones can change no more.",
    see: ({ contacts, free, equations }) => [
      `${free} numbers fix all ${2 * contacts} forces: S has ${free} dimensions. That is what the count gives, ${2 * contacts} unknown forces minus ${equations} equations, whichever you hold.`,
      `No screen can show ${free} dimensions. A plot of two forces is only a shadow of S, as of a body on a wall: behind each of its points lie many sets of forces.`,
    ],
    count: (facts) => counted(facts, true),
    x: { low: 0, high: 23, digits: 0, stops: [...Array(24).keys()], label: "normal forces that are held" }, y: null,
    experiment: HeldForces, options: { scene: "thirteen" },
  },
  {
    name: "chance", title: "A random walk", card: "Largest force that a random walk finds (mean = 1)", heading: "How far does chance go?",
    text: ({ high, states, all, disks, contacts, free }) => `The ${all} disks again, ${all - disks} without forces: 2 × ${contacts} forces − (3 × ${disks} − 1) equations = ${free} free numbers. The force you pulled, green, goes up to ${two(high)}. Blue: all it can be together with a violet force, a shadow of S. Chance walks through S in ${states} steps: each changes all forces at random, then restores balance.`,
    ask: "What is the largest green force that chance finds?",
    doing: ({ step }) => `Press “Walk”, or drag the slider. Each dot is ${step > 1 ? `a network, one after about every ${step} steps` : "a step"}; network 0 is the one in which the packing came to rest.`,
    see: ({ part, share, free, states, step }) => [
      `All ${states} networks cover ${percent(part)} of what is possible for the green force; the dots, ${step > 1 ? "some of them" : "all of them"}, fill ${percent(share)} of the blue area. To get to its edge, most of the ${free} free numbers have to work together, which chance hardly ever arranges.`,
      `A walk shows what is typical, not what is possible: drag the dot there by hand. And this is only a shadow: a part half as wide as S in each of its ${free} directions fills one part in 10${raised(Math.round(free * Math.log10(2)))} of S.`,
    ],
    x: { low: 0.5, high: 4, label: "green force (mean force = 1)" }, y: { low: 0, high: 3, label: "violet force", follows: true },
    experiment: Chance, options: {},
  },
  {
    name: "friction", title: "Friction", card: "Friction at which forces are least determined", heading: "Where are forces least determined?",
    text: ({ all, packings }) => `Until now, μ changed and the disks stayed. <b>Here each of ${packings} values of μ has its own packing</b> of ${all} disks, pressed together with that friction. A walk through its S, all sets of forces that hold it, shows how much the forces vary: how far each typically is from its mean.`,
    ask: "At which friction μ do the forces vary most?",
    doing: () => "Drag the dot along the whole axis, to both ends. Blue: how much the forces vary. Grey: how many numbers are free.",
    see: ({ rows }) => {
      const most = rows.reduce((one, other) => (other.spread > one.spread ? other : one)), first = rows[0], last = rows.at(-1)
      return [
        `With little friction many numbers are free (grey), ${first.free} at μ = ${first.mu}, but each has little room: forces vary by ${percent(first.spread)} (blue). More friction gives them room: ${percent(most.spread)} at μ = ${most.mu}, the most of these ${rows.length === 6 ? "six" : rows.length} packings.`,
        `But with more friction a packing stands on fewer contacts, ${two(touching(last))} per disk instead of ${two(touching(first))}. With three per disk nothing would be free. So S first grows wider and then loses its dimensions.`,
      ]
    },
    live: true,
    count: (facts) => [
      [`μ = ${facts.mu}: contacts per disk, 2 × ${facts.contacts} / ${facts.disks}`, two(touching(facts))],
      [`free numbers, 2 × ${facts.contacts} − (3 × ${facts.disks} − 1)`, facts.free],
      ["forces vary by (typical deviation in the walk, mean force = 1)", percent(facts.spread)],
    ],
    x: { low: 0.001, high: 10, log: true, label: "friction μ", symbol: "μ = " }, y: { low: 0, high: 20, label: "forces vary by (% of the mean)", follows: true }, second: { low: 0, high: 400, label: "free numbers" },
    experiment: Friction, options: {},
  },
  {
    name: "push", title: "Why it matters", card: "Largest push before a disk moves (mean force = 1)", heading: "When does something move?",
    text: ({ mu }) => `The disks of chapter 1, μ = ${mu}, with another line marked: its two disks press on each other. Now they are pushed apart, harder and harder, and the other forces have to balance the push. Nothing searches S for the forces that hold longest: contacts that stick keep their forces, and change them only as far as balance demands.`,
    verdict: ({ limits: [first, ...others] }) => ({ answer: `It is ${two(first)}${others.length ? `; ${listed(others.map(two))} from other forces` : ""}.`, so: others.length ? "" : undefined }),
    ask: "How hard can you push before a disk moves?",
    doing: () => "Drag the dot to the right, or an arrow away from the marked line. Blue: what S allows, up to its limit load. Dots: about to slip.",
    see: ({ high, number, opened, slid, carried, moving, pushed, limit }) => [
      moving ? `Disks start to move (arrows): in the whole packing, ${opened} contacts open (rings) and ${slid} slip (dots).`
        : pushed ? `Without a push, the two disks press on each other with ${two(carried)}.`
          : `The same disks with other forces, network ${number} of the random walk: the two press on each other with ${two(carried)}. Push again.`,
      ...(pushed ? [`A contact that slips stays at its friction limit, and the others have to balance the rest. At ${two(high)} they no longer can.`] : []),
      `Other forces in S (blue) would balance a push up to ${two(limit)}, the limit load, but sliding disks do not search for them. So statics alone promises too much${pushed ? `, here ${percent(limit / high - 1)}` : ""}, and limits of slopes and foundations are often computed from statics.`,
    ],
    x: { low: 0, high: 2, label: "push (mean force = 1)" }, y: { low: 0, high: 1.5, label: "force of the line", follows: true },
    experiment: Push, options: {},
  },
]
