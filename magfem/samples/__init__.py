"""Field data at points, as measured or computed: samples of one source or of a coil system, recordings over time, and
their files.

Importing is cheap: NumPy alone.
"""

from __future__ import annotations

from magfem.samples.columns import parse_columns
from magfem.samples.comsol import read_comsol
from magfem.samples.read_csv import read_samples
from magfem.samples.recording import Recording
from magfem.samples.recording_csv import read_recording
from magfem.samples.samples import Samples, SystemSamples
from magfem.samples.write_csv import samples_text

__all__ = [
    "Recording",
    "Samples",
    "SystemSamples",
    "parse_columns",
    "read_comsol",
    "read_recording",
    "read_samples",
    "samples_text",
]
