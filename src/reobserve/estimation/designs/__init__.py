"""Designs as files: a system, the gains of an observer for it, and a certificate that is checked.

`reobserve.load_design` makes of a file an observer that is ready to run.
"""
