// What a browser remembers between visits; without storage, everything counts as known.

export const knows = (what) => { try { return localStorage.getItem(`granforce.${what}`) !== null } catch { return true } }
export const remember = (what) => { try { localStorage.setItem(`granforce.${what}`, "seen") } catch { /* private */ } }
