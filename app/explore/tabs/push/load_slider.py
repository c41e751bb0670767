"""Slider for the push on a contact: the network in the packing follows until something moves."""

from collections.abc import Callable

import param

from ....browser.bundle import Scripted
from ....browser.messages import forward


class LoadSlider(Scripted):
    """The force that pushes two disks apart, in ⟨f_n⟩, while they hold; see load_slider.js."""

    contact = param.Integer(default=None, allow_None=True, doc="the one that is pushed")
    path = param.Dict(default={}, doc="networks under growing loads, see perturb.path; {} unknown")
    limit = param.Number(default=None, allow_None=True, doc="limit load; None: not known")
    most = param.Number(default=1.0, doc="end of the scale until the limit is known")
    running = param.Boolean(doc="whether it is being computed")

    def __init__(self, pushed: Callable[[], object], reached: Callable[[], object]) -> None:
        """pushed(): moved while no path is known; reached(): moved to the end of the path."""
        super().__init__(sizing_mode="stretch_width", margin=(4, 10))
        self._pushed, self._reached = pushed, reached

    _push = forward("_pushed", push=True)
    _reach = forward("_reached", reached=True)
