"""The study of PRE 79, 052302, reproduced: its cells, its reduced table and its claims."""
