"""Gadsden et al. 2011: KF-IMM and SVSF-IMM fault diagnosis, Figs 5 to 8."""
