"""What a controller leaves a model to be off by.

A loop is designed with a gain margin of 6 dB and a phase margin of 45 degrees or more ([Skogestad2005], sec. 2.4.3). A
model that spends half of either is no use, one that spends a sixth takes care.

[Skogestad2005] S. Skogestad, I. Postlethwaite, Multivariable Feedback Control, 2nd ed., Wiley, 2005.
"""

GAIN_MARGIN_DB, PHASE_MARGIN_DEG = 6.0, 45.0
HALF, SIXTH = 1 / 2, 1 / 6
