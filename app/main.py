"""`panel serve app` from the repository's root.

It opens on the precomputed results in data/start.zarr, or in the folder that the environment
variable GRANFORCE_DATA names, and on the user's own cache (GRANFORCE_CACHE); GRANFORCE_LIMITS says
how much a visitor may ask for, see app/limits.py.
"""

# Bokeh runs this file anew for each visitor, and clears its names when the visitor leaves while
# work goes on that may still need them: nothing but the call belongs here.
from .page import page

page().servable()
