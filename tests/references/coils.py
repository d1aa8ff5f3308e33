"""Published numbers of coils."""

from __future__ import annotations

# Nagaoka's coefficient by diameter over length: H. Nagaoka, J. Coll. Sci. Tokyo 27, art. 6 (1909); reprinted in
# E. B. Rosa and F. W. Grover, Bull. Bureau of Standards 8, table XXI (1912).
NAGAOKA = {0.5: 0.818136, 1.0: 0.688423, 2.0: 0.525510, 5.0: 0.319825}

# log10 of M/(4π√(Aa)) in centimetres, sin γ the modulus: J. C. Maxwell, Treatise on Electricity and Magnetism, appendix
# I of chapter XIV, by γ in degrees. In SI units M/(µ0 √(Aa)).
MAXWELL = {60.0: 0.4994783 - 1}

# Inductance of Brooks's coil (inner radius c, outer radius 2c, length c) over N² and its mean radius, H/m:
# F. W. Grover, Inductance Calculations (1946), chapter 13: 0.016994 µH per turn² and cm.
BROOKS = 1.6994e-6

# B_z on the axis of a winding, radii 10 to 15 mm, length 30 mm, 1000 ampere turns: z in m, B_z in T; from the closed
# form B_z = µ0 J/2 Σ ± ζ ln(a + √(a² + ζ²)).
AXIS = {0.0: 0.0321986191, 0.015: 0.0193222619, 0.030: 0.0040730006}
