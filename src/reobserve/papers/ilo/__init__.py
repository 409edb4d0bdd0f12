"""Chen & Saif 2007: iterative learning observer for satellite thruster faults, Figs 1 to 5."""
