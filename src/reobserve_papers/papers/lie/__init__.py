"""Thomas, Kwatny & Chang: normal-form observers by Lie transforms, Van der Pol, Fig. 1 and T(z).

What no code computes, and why:

- (2): a general form, of which the identity observer (11) is a case
- Lemma 2.2, (3) and (4): a general form, of which the normal form (6), (7) is a case
- (5): a step of the proof of Lemma 2.2
- Definition 3.4: a definition; the test of the erratum `poincare_domain_of_a` computes it
- Proposition 3.6: a theorem from the literature; the claim `series_converge` and the erratum
  `nonresonance_of_a` test how it is used
- Remark 3.7: the claims `series_converge` and `siegel_domain` and the errata `nonresonance_of_a`
  and `poincare_domain_of_a` test it
- Definition 3.8: a definition; the divisors are those of Proposition 3.10, and series may exist
  without it, as a test shows
- (14): its powers of epsilon count degrees, by which series are ordered here
- Proposition 4.14 and (15) to (17): not computed in this form; (19) turns it into (20) and (21)
- Remark 4.15: the order of computation, here that of (22)
- (19): a requirement, from which (20) and (21) follow
- Remark 4.19: not required, as a series may exist once the gain is solved for; Proposition 3.10 has
  the condition
- Remark 4.21: the order of computation of (22)
- Section 5, system: numbers in the parameter file
"""
