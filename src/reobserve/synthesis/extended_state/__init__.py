"""Extended state observers that reconstruct actuator and sensor faults, and their gains by LMI.

After Indriawati, Agustinah & Jazidie, "Development of the PD/PI extended state observer to detect
sensor and actuator faults simultaneously".
"""
