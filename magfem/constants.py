"""Physical constants."""

MU_0 = 1.25663706127e-6
"""Vacuum permeability, N/A² (CODATA 2022; 4π·1e-7 to 1.6e-10)."""
