"""A site as it is drawn, the grids made from it, and the costmaps that planners search. Metres and arrays only."""
