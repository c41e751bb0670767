"""How large S is, and what lies in it: walks, uniform states, exact intervals, outlines."""
