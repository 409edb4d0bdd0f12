"""Things over time: series and their files, grids, signals, past inputs."""
