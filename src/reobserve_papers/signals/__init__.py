"""Things over time: series and their files, grids, signals, random streams."""
