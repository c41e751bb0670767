"""A table of all contacts that follows the network on screen; see contact_table.js."""

import param

from ....browser.bundle import Scripted
from ....state.view_settings import Looks


class Contacts(Scripted):
    """Number, disks, forces and bounds of each contact; can be sorted, searched and filtered."""

    open = param.Boolean()

    def __init__(self, looks: Looks) -> None:
        super().__init__(sizing_mode="stretch_width")
        looks.sync_opened(self, "table")
