"""Lechappe et al. 2018: joint observation of state and input delay, Figs 1 to 3.

What no code computes, and why:

- Assumptions 1 and 2: an assumption that holds for a pendulum with any parameters
- Remarks 2.1, 3.1 and 3.5: the claim `second_order_enough` tests that the order 2 is enough
- (2): a definition, the delay as another state; the observer is based on (8)
- Assumption 5 and (5): where the theory holds; the observer uses the condition (15) instead
- (7): Taylor's theorem; only tests compute the bound
- (8): the plant with the expansion (6), which (9) copies; the plant is simulated by (1)
- Remark 3.2: the claim `projection_keeps_convergence` tests it
- Assumption 7 and (15): part of the claim `assumptions`; below a threshold the observer switches
  gains off
- Remark 3.3: an argument; for m = 2 without a threshold the rate of xi^ grows without bound while
  all signals stay bounded, as a test shows
- Theorem 2 and (16): a bound without its constants, which the claim `bounded_error` tests
- (17) to (21): a step of the proof of Theorem 2
- (23) to (31): a step of the proof of Theorem 2; only tests compute the rho for which it holds
- (32): (6) with estimated derivatives, arithmetic by which `derivative_errors` is not testable
- after (33) and Table I: numbers in the parameter file
- Remark 4.1: the claim `slower_input_shorter_delay` tests it
"""
