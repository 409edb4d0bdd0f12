"""Thomas, Kwatny & Chang: normal-form observers by Lie transforms, Van der Pol, Fig. 1 and T(z)."""
