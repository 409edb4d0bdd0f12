"""Chen & Saif 2007: iterative learning observer for satellite thruster faults, Figs 1 to 5.

What no code computes, and why:

- Assumption 1: an assumption, whose k_d is an argument of
  `reobserve.synthesis.ilo_certificate.bound18`
- Remark 2: an argument for Assumption 2, which the claim `assumption_2` discusses
- (7): a step of the proof of Lemma 1; the code squares (6) directly
- (8) to (10): Young's inequalities in that proof; their weights enter the constants of (11)
- Remark 3: a special case of (11), `reobserve.synthesis.ilo_certificate.lemma1_sides` without a
  mismatch
- (13): the Lyapunov function of the proof, which `reobserve.synthesis.ilo_certificate` bounds
- (14): a step of the proof of Theorem 1
- (15): Young's inequality in that proof; its weight enters the constants after (16)
- Remark 4: the claims `remark_4_statement` and `remark_4_proof` test it
- Remark 5: the claim `runs_from_the_start` tests it
- Remark 6: the claim `remark_6` tests it
- (19) and Section 4, faults: numbers in the parameter file
"""
