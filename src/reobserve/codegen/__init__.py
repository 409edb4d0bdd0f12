"""Observers as code of their own: one step of each as statements on matrices, and its printers.

`reobserve.codegen.programs.program_of` makes the statements of an observer; `c_code`, `python_code`
and `latex` print them.
"""
