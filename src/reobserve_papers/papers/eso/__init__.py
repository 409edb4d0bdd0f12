"""Indriawati, Agustinah & Jazidie: PI and PD/PI extended state observers by LMI, Figs 2 to 5.

What no code computes, and why:

- (21): the output of (20) is the error itself; the identity is left out where the norm is computed
- (25) to (30): on a page that the available copy lacks;
  `reobserve.synthesis.extended_state.inequality` derives the steps between (24) and (19) again
- (34) to (36): on a page that the available copy lacks
- Table VII: numbers in the parameter file
"""
