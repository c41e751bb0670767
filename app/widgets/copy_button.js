// A button that copies a text and confirms it briefly.

import { copyButton } from "../browser/clipboard.js"

export function render({ model }) { return copyButton(model.label, () => model.text, { className: "soft" }) }
