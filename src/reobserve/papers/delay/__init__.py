"""Lechappe et al. 2018: joint observation of state and input delay, Figs 1 to 3."""
