"""Where each equation of a paper is implemented, and which test shows it."""
