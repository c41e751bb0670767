// The seven chapters: their text, as functions of the numbers on screen, and the experiment of
// each.

import { Chance } from "./experiments/chance.js"
import { Friction } from "./experiments/friction.js"
import { Grab } from "./experiments/grab.js"
import { Push } from "./experiments/push.js"
import { SceneExperiment } from "./experiments/scene_experiment.js"

const two = (v) => v.toFixed(2)
const listed = (words) => new Intl.ListFormat("en-GB").format(words)
const whole = (v) => v.toFixed(0)
const percent = (v) => `${Math.round(100 * v)}\u00a0%`
const raised = (v) => [...String(v)].map((digit) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[digit]).join("")
// Without walls: further rows of the count.
const PRESSED = [
  ["two of them follow from the others: in the sum over all disks, forces between disks cancel, sideways and upwards", "− 2"],
  ["one more: the pressure on all sides is given", "+ 1"],
]

/** Contacts at their limits against free numbers, in words; nothing if fewer forces are fixed than numbers were free. */
function fixed(opened, sliding, free) {
  const forces = 2 * opened + sliding
  return forces < free ? "" : ` That fixes 2 × ${opened} + ${sliding} = ${forces} forces, enough for all ${free} free numbers: nothing is left to change.`
}

/** The count of free numbers, line by line: {rows, head}; head is null if the last row is the sum. */
function counted({ contacts, disks, equations, free }, pressed, disksNote = "") {
  const rows = [
    [`${contacts} contacts × 2 forces, normal and tangential`, 2 * contacts],
    [`${disks} ${disks > 1 ? "disks" : "disk"}${disksNote} × 3 equations: no net force sideways, none up or down, no turning`, 3 * disks],
    ...(pressed ? [...PRESSED, [`equations: ${3 * disks} − 2 + 1`, equations]] : []),
    [`free numbers: ${2 * contacts} − ${equations}`, free],
  ]
  return { head: null, rows }
}

/**
 * Each chapter: name in links; title in the list; heading; text and ask, shown first; doing, the instruction
 * for dragging; see(facts): reason and surprise; count(facts): a table, or null; x, y: axes; experiment with options.
 */
export const CHAPTERS = [
  {
    name: "groove", title: "One disk in a groove", heading: "How hard does the wall press?",
    text: ({ mu }) => `A disk of weight 1 lies between two walls. Each wall exerts a normal force on it and a friction force along the wall, at most ${mu} times the normal force. Four unknown forces, three equations of balance: one number stays free.`,
    ask: "How large can the left wall’s normal force become?",
    doing: "Drag the dot to the right as far as it goes, or drag an arrow. All forces stay in balance; an arrow turns orange where its contact is about to slip.",
    see: ({ low, high, mu }) => [
      `At ${two(high)} the disk would slip upwards if friction did not pull it down along both walls, and friction gives ${two(mu * high)} at most: ${mu} × ${two(high)}. At ${two(low)} friction holds the disk up, as hard as it can.`,
      `So each wall can press harder than the disk weighs, and a photograph would not show it. The bar is called S: each of its points is one set of forces that holds the disk.`,
    ],
    count: (facts) => counted(facts, false),
    x: { low: 0, high: 3, label: "normal force at the left wall (weight of the disk = 1)" }, y: null,
    experiment: SceneExperiment, options: { scene: "groove", x: 0, y: null },
  },
  {
    name: "box", title: "Two disks in a box", heading: "How much can the floor carry?",
    text: ({ mu }) => `Two disks of weight 1 lie in a box, with friction of at most ${mu} times each normal force. Eight unknown forces, six equations: two numbers stay free, and S is an area. The axes of the plot are two of the forces, green and violet.`,
    ask: "How large can the floor’s normal force become?",
    doing: "Drag the dot to the right as far as it goes. Its path paints S.",
    see: ({ high, weight, mu }) => [
      `Both disks together weigh ${weight}. The other ${two(high - weight)} comes from the walls: the disks are wedged between them, and friction there pulls them down. With more, the lower disk would slip on the floor, where friction is at its limit, ${mu} × ${two(high)}.`,
      `So the floor can carry more than the disks weigh. Every point of the polygon is one set of forces that holds the same two disks; at its edges a disk is about to slip.`,
    ],
    count: (facts) => counted(facts, false),
    x: { low: 0, high: 5, label: "normal force at the floor (green)" }, y: { low: 0, high: 5, label: "between the disks (violet)" },
    experiment: SceneExperiment, options: { scene: "box", x: 4, y: 0 },
  },
  {
    name: "thirteen", title: "Thirteen disks", heading: "How strong can one contact get?",
    text: ({ contacts, equations, free, disks, start, mu, mean }) => `${disks === 13 ? "Thirteen" : disks} disks with friction μ = ${mu} are squeezed from all sides; beyond the dashed frame the picture repeats. ${2 * contacts} unknown forces, ${equations} equations: S has ${free} dimensions, so the plot shows its shadow on two of the forces. The green one starts at ${two(start)}; the mean of all normal forces is ${two(mean)}.`,
    ask: "How large can the green force become?",
    doing: "Drag the dot to the right as far as it goes, or drag an arrow. All disks stay in balance. Orange: a contact is about to slip (wedge) or to open (ring).",
    see: ({ low, high, free, others }) => [
      `Every contact must press, and friction is limited at each. At ${two(high)} so many contacts are about to open or to slip that none of the ${free} numbers is free any more. From ${two(low)} to ${two(high)} every value is possible, although no disk moves.`,
      others ? "The dot stayed, but the other forces changed: many sets of forces lie behind this point of the shadow. Change them again."
        : others === false ? "Here, at the edge of the shadow, there is only one set of forces. Move the dot inside, then change the others."
          : "What you painted is a shadow: inside it, many sets of forces lie behind each point. Move the dot inside, then change the others.",
    ],
    count: (facts) => counted(facts, true),
    x: { low: 0, high: 8, label: "normal force between disks 1 and 12 (green)" }, y: { low: 0, high: 5, label: "between disks 8 and 13 (violet)" },
    experiment: SceneExperiment, options: { scene: "thirteen", x: 6, y: 40 },
  },
  {
    name: "four-hundred", title: "Four hundred disks", heading: "Grab one force",
    text: ({ all, mu, start, free }) => `${all} disks at friction μ = ${mu}. A line joins two disks that press on each other, thicker for a larger force. By the same count, ${free} numbers are free: S, all sets of forces that hold the disks, has ${free} dimensions. The marked line carries ${two(start)} times the mean force.`,
    ask: "How large can you make this force while no disk moves?",
    doing: "Drag the dot to the right, or the marked line upwards; other lines move too. Blue: the force has changed. Orange: about to slip (wedge) or open (ring).",
    see: ({ high, opened, sliding, changed, free }) => [
      `At ${two(high)}, ${opened} contacts have lost both their forces, and friction is at its limit at ${sliding}.${fixed(opened, sliding, free)}`,
      `On the way there, ${changed} other forces change by more than a tenth of the mean force, yet no disk moves. On a photograph of the packing you would see no difference.`,
    ],
    count: (facts) => counted(facts, true, ` that carry (of ${facts.all})`),
    x: { low: 0, high: 6, label: "force of the marked line (mean force = 1)" }, y: null,
    experiment: Grab, options: {},
  },
  {
    name: "chance", title: "A random walk", heading: "How far does chance go?",
    text: ({ low, high, states }) => `By hand, the marked force goes from ${two(low)} to ${two(high)} times the mean (pale). Now a random walk takes ${states} steps through S, all sets of forces that hold the disks. At each step the marked force is noted.`,
    ask: "What is the largest value that chance finds?",
    doing: "Drag the dot upwards: network after network.",
    see: ({ part, mean, free }) => [
      `Chance covers ${percent(part)} of what is possible for this force, and ${percent(mean)} on average over all. To reach either end, most of the ${free} free numbers must work together, which chance hardly ever arranges.`,
      `And that is one force alone. A part half as wide as S in each of its ${free} directions fills one part in 10${raised(Math.round(free * Math.log10(2)))} of S: a value that chance never finds may still be possible.`,
    ],
    count: null,
    x: { low: 0, high: 6, label: "force of the marked line (mean force = 1)" }, y: { low: 0, high: 1000, label: "random networks", dragged: true },
    experiment: Chance, options: {},
  },
  {
    name: "friction", title: "Friction", heading: "Where are forces least determined?",
    text: ({ all, mu }) => `The forces of ${all} disks at μ = ${mu} walk at random through S, all sets of forces that hold the disks; watch the marked line. More friction lets each force lean further. But disks packed with more friction also come to rest with fewer contacts.`,
    ask: "At which friction μ do the forces vary most?",
    doing: "Drag the dot along the whole axis, to both ends. At each stop it shows the mean over several packings made with that friction.",
    see: ({ rows }) => {
      const most = rows.reduce((one, other) => (other.spread > one.spread ? other : one)), first = rows[0], last = rows.at(-1)
      return [
        `At small μ many numbers are free, but friction leaves each little room: at μ = ${first.mu}, ${whole(first.free)} are free and forces vary by ${percent(first.spread)}. Disks packed with more friction touch fewer others, and fewer numbers are free: ${whole(most.free)} at μ = ${most.mu}, ${whole(last.free)} at μ = ${last.mu}.`,
        `So more friction does not mean more freedom: S first grows wider and then loses its dimensions.`,
      ]
    },
    count: ({ rows }) => ({
      head: ["friction μ (means over packings)", "contacts of a disk", "free numbers", "forces vary by"],
      rows: rows.map(({ mu, touching, free, spread }) => [mu, two(touching), whole(free), percent(spread)]),
    }),
    x: { low: 0.001, high: 10, log: true, label: "friction μ" }, y: { low: 0, high: 0.25, label: "forces vary by (mean force = 1)" },
    experiment: Friction, options: {},
  },
  {
    name: "push", title: "Why it matters", heading: "When does something move?",
    text: ({ mu }) => `The same packing at μ = ${mu}. The two disks of the marked line press on each other. Now they are pushed apart. The other forces change as little as they can to carry the push.`,
    ask: "How hard can you push before a disk moves?",
    doing: "Drag the dot to the right, or an arrow away from the marked line.",
    see: ({ high, limit, limits, number, opened, slid, carried, moving, pushed }) => [
      moving ? `Now ${opened} contacts open (rings), ${slid} slip (wedges), and disks start to move. Orange arrows and the motion are drawn enlarged.`
        : pushed ? `Without a push, the two disks press on each other with ${two(carried)}. At a push of ${two(high)}, disks start to move.`
          : `The same disks with other forces, network ${number} of the random walk: the two press on each other with ${two(carried)}. Push again.`,
      `Up to a push of ${two(limit)}, S, all sets of forces that hold the disks, is not empty (line). But the packing gives way earlier, as it starts from the forces it has. ${limits.length > 1
        ? `The same disks gave way at ${listed(limits.map(two))}: no picture of them shows which. That is why it matters how undetermined forces are.`
        : "Would the same disks give way at the same push with other forces?"}`,
    ],
    count: null,
    x: { low: 0, high: 2, label: "push (mean force = 1)" }, y: null,
    experiment: Push, options: {},
  },
]
