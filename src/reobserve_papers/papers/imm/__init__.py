"""Gadsden et al. 2011: KF-IMM and SVSF-IMM fault diagnosis, Figs 5 to 8.

What no code computes, and why:

- Section IV, layers: numbers in the parameter file
- Appendix, nomenclature: definitions of symbols
"""
