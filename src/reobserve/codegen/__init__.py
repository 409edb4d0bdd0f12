"""C99 from observers: one step as a function, and a test that compares it with the library.

`programs` build the step of an observer, as its family says; `c_code` and `c_test` write the files.
"""
