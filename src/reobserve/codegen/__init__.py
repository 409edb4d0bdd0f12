"""C99 from observers: one step as a function, and a test that compares it with the library.

`program_of` builds the step of an observer by `programs`; `c_code` and `c_test` write the files.
"""
