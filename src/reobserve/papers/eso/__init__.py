"""Indriawati, Agustinah & Jazidie: PI and PD/PI extended state observers by LMI, Figs 2 to 5."""
