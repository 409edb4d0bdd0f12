"""Numerical basics: compiled loops, matrices, sampling, files, errors."""
