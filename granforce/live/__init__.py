"""The app's door to physics: what it computes while a visitor drags, in tenths of a second.

Nothing here is stored. Longer computations are kinds of stored results (`granforce.study.kinds`).
"""
