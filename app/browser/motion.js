// Whether the visitor asks for reduced motion: STILL.matches.

export const STILL = matchMedia("(prefers-reduced-motion: reduce)")
