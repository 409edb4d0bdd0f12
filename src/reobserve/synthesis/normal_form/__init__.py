"""Observers in normal form: coordinates in which the estimation error is exactly linear.

After Thomas, Kwatny & Chang, "Lie transform construction of exponential normal form observers".
The series S and T of the change of coordinates z = S(x), x = T(z) are found along three methods,
each in its own file, that meet in exact arithmetic.
"""
