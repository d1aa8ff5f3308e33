"""What the dissertation states of its coils: numbers, and the place in the text."""

from __future__ import annotations

# 5.2, the planar coil: outer radius 6 mm, inner radius 1 mm, 9 µm of copper.
PLANAR_RESISTANCE = 12.0  # Ω
# 5.2.1, at 1 A: "magnitudes up to 2 mT", "gradients in the near-field are on the order of 1 T/m"; heights not stated.
PLANAR_FIELD = 2e-3  # T/A
PLANAR_GRADIENT = 1.0  # T/m/A
# 5.2.1: 0.2 A take 0.5 W, which is 12.5 Ω.
PLANAR_POWER = (0.2, 0.5)  # A, W

# 6.1.2: the inner coil within the volume of the rotor, and the averages of inner and outer coil there.
STATOR_RANGE = (3e-3, 6e-3)  # T/A
STATOR_AVERAGES = (3.9e-3, 3.6e-3)  # T/A
ROTOR = (1e-3, 3e-3)  # m, diameter and length (6.3.2)
# 6.3.1: measured, soldered leads included or not is not said.
STATOR_RESISTANCES = (0.9, 0.82)  # Ω
