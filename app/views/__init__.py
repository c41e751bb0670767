"""One view a file: each takes the state and makes something to lay out."""
