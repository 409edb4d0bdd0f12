"""Speed as ratios against peers measured in the same run: C, numpy, scipy, sympy, DACE, imports."""
