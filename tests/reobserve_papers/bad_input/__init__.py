"""Invalid input of the papers' commands, files and functions, as in `tests.reobserve.bad_input`."""
