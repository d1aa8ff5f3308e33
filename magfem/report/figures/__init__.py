"""The report's figures: one subject per file, all in the look of `style`."""

from magfem.report.figures.axis import axis_figure
from magfem.report.figures.azimuth import azimuth_figure, azimuth_ring
from magfem.report.figures.distance import Contender, distance_figures, distance_layers
from magfem.report.figures.mesh import meridian_figures
from magfem.report.figures.planes import Plane, error_map, field_map, field_planes, near_window
from magfem.report.figures.style import Picture

__all__ = [
    "Contender",
    "Picture",
    "Plane",
    "axis_figure",
    "azimuth_figure",
    "azimuth_ring",
    "distance_figures",
    "distance_layers",
    "error_map",
    "field_map",
    "field_planes",
    "meridian_figures",
    "near_window",
]
