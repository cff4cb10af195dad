"""Bodies of linear tetrahedra or hexahedra pressed by rigid ones, for studies of elements and the race against CalculiX.

`softtact.models.solid` is the model for users; this is the plainer one that came before it, kept for the numbers that it gave.
"""
