// The page's sidebar, as the page is opened.

const ROOMY = 1200 // px; from there on the sidebar begins open
const OVER_PAGE = ".MuiDrawer-modal" // the sidebar where it does

/** The sidebar begins open. Below ROOMY it is closed: it would take the room of the packing; on
 * a narrow page it lies over it and is unseen until it has heard that it is closed, which it does
 * not before it listens. */
export function closeSidebar(page, view) {
  const data = [...page._all_models.values()].find(({ data }) => data?.sidebar_open !== undefined)?.data
  const close = () => {
    const over = view.root.shadow_el.querySelector(OVER_PAGE)
    if (over || window.innerWidth < ROOMY) {
      data.sidebar_open = true // as only a change is told
      data.sidebar_open = false
    }
    if (over) setTimeout(close, 100)
    else document.documentElement.style.setProperty("--sidebar", "visible")
  }
  if (data) close() // a page taken along has none
}
