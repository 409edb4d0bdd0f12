"""Numerical basics: compiled loops, matrices, sampling, random streams, files, errors."""
