// Colours of the small scenes: blue for forces, green and violet for the two that are axes of S,
// magenta for dragging, grey for limits, orange for motion.

/** Colours by their role, on dark or on white background. */
export function palette(dark) {
  return {
    ink: dark ? "#e6e9ee" : "#22272e", paper: dark ? "#121212" : "#ffffff", edge: dark ? "#7a8798" : "#8fa1b5",
    fill: dark ? "rgba(150,172,200,0.25)" : "rgba(139,160,187,0.3)", lit: dark ? "rgba(150,172,200,0.45)" : "rgba(139,160,187,0.55)",
    cold: dark ? "#5fa2e8" : "#1464c8", warm: "#e8710a", hand: dark ? "#ff5ca8" : "#b5236b", weight: dark ? "#aab4c2" : "#4a5563",
    across: dark ? "#4ecb8d" : "#12793f", up: dark ? "#c39bff" : "#7a3fc4",
    cone: dark ? "rgba(95,162,232,0.16)" : "rgba(20,100,200,0.12)", coneLit: dark ? "rgba(255,92,168,0.3)" : "rgba(181,35,107,0.22)",
    coneFull: dark ? "rgba(230,233,238,0.55)" : "rgba(34,39,46,0.5)", shade: dark ? "rgba(95,162,232,0.2)" : "rgba(20,100,200,0.14)", state: dark ? "#8fbfee" : "#3d8bd4",
  }
}
