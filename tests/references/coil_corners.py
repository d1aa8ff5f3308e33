"""Resistance of right-angled corners, in squares."""

from __future__ import annotations

import math

# A strip turns through a right angle, its width unchanged: what the corner's square counts for, exactly. By a conformal
# map of the bend to a half plane, dz/dt = ((t + 1)/(t − 1))^½ / t, whose outer wall is at
# z = ln t + ln 2 + π/2 + O(1/t) from the outer corner when the strip is π wide: 1 − (2/π) ln 2 squares.
# Published as 0.559: P. M. Hall, Resistance calculations for thin film patterns, Thin Solid Films 1, 277 (1968).
SQUARES = 1 - 2 / math.pi * math.log(2)
PUBLISHED = 0.559
