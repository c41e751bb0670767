"""`panel serve app` from the repository's root.

It opens with the precomputed results in data/start.zarr, or in the folder named by the environment
variable GRANFORCE_DATA, and with the user's own cache (GRANFORCE_CACHE); GRANFORCE_LIMITS sets the
limits per visitor, see app/background/limits.py.
"""

# Bokeh runs this file for each visitor, and clears its names when the visitor leaves, while running
# work may still need them: only the call belongs here.
from .page import page

page().servable()
