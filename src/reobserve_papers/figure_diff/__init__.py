"""The figure diff: every built figure, and the numbers behind it, against the accepted ones."""
