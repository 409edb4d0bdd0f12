"""Observers on recorded data of one's own: a specification, a record, and what became of both.

A record goes through these hands, each of which takes a row or a block of rows and gives what is
settled by then, so that a file in pieces, and lines as they come, give the bits of a whole record:

    reading      rows of the file's columns, in the units of the model
    grid         rows at the sampling period: lost, uneven and missing samples by the policies
    estimation   the observer, which starts again where a policy says so
    alarms       residuals and estimates against thresholds
    writing      columns with names and units
"""
