"""Observers on recorded data: a specification, a record, and what became of both.

A record goes through these hands, each of which takes a row or a block of rows and gives what is
settled by then, so that a file in pieces, and lines as they come, give bitwise the estimates of a
whole record:

    reading         rows of the file's columns, in the units of the model
    timestamps      at which times there is to be a sample: lost and uneven ones by the policies
    interpolation   values at these times, where samples are uneven
    gaps            missing samples, by the policies
    estimate        the observer, which starts again where a policy says so
    alarms          residuals and estimates against thresholds
    writing         columns with names and units
"""
