// What a browser remembers between visits; without storage, everything counts as known. And, for as
// long as its tab is open, the last view of Explore, that of a packing of the visitor's own, and the last chapter of
// Learn.

export const knows = (what) => { try { return localStorage.getItem(`granforce.${what}`) !== null } catch { return true } }
export const remember = (what) => { try { localStorage.setItem(`granforce.${what}`, "seen") } catch { /* private */ } }

const LAST = "granforce.explore", OWN = "granforce.packing", CHAPTER = "granforce.chapter"
const kept = (key) => { try { return sessionStorage.getItem(key) ?? "" } catch { return "" } }
const keep = (key, value) => { try { sessionStorage.setItem(key, value) } catch { /* private */ } }
export const lastView = () => kept(LAST)
export const lastPacking = () => kept(OWN)
export const lastChapter = () => kept(CHAPTER)
export const keepChapter = (name) => keep(CHAPTER, name)

export function keepView(query) {
  keep(LAST, query)
  if (new URLSearchParams(query).has("packing")) keep(OWN, query)
}
