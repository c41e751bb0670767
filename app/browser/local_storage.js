// What a browser remembers from visit to visit; where it may not, all counts as known.

export const knows = (what) => { try { return localStorage.getItem(`granforce.${what}`) !== null } catch { return true } }
export const remember = (what) => { try { localStorage.setItem(`granforce.${what}`, "seen") } catch { /* private */ } }
