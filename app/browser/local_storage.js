// What a browser remembers between visits; without storage, everything counts as known. And, for as
// long as its tab is open, the last view of Explore.

export const knows = (what) => { try { return localStorage.getItem(`granforce.${what}`) !== null } catch { return true } }
export const remember = (what) => { try { localStorage.setItem(`granforce.${what}`, "seen") } catch { /* private */ } }

const LAST = "granforce.explore" // the query of that view
export const lastView = () => { try { return sessionStorage.getItem(LAST) ?? "" } catch { return "" } }
export const keepView = (query) => { try { sessionStorage.setItem(LAST, query) } catch { /* private */ } }
