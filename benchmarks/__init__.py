"""Speed as ratios to peers of the same run: C, numpy, scipy, filterpy, sympy, DACE, imports."""
