"""The scenario that tests run: two magnets in the plane of BigMag's coils, and its rod in plain numbers."""

from __future__ import annotations

TWO_MAGNETS = """
kind = "scenario"
name = "A test"
system = "bigmag"
planar = true
compare_forces = true
hold = 3

[materials.rubber]
youngs_modulus = "5.5 MPa"
density = "1040 kg/m^3"

[rod]
position = ["-30 mm", "0 mm", "0 mm"]
direction = [1, 0, 0]

[[rod.sections]]
material = "rubber"
length = "25 mm"
radius = "1.5 mm"

[[rod.sections]]
moment = "-21 mA m^2"
length = "4 mm"
mass = "0.147 g"

[[rod.sections]]
material = "rubber"
length = "25 mm"
radius = "1.5 mm"

[[rod.sections]]
moment = "21 mA m^2"
length = "4 mm"
mass = "0.147 g"

[plant]
stiffness = 1.15

[controller]
current_limit = "6 A"
current_step = "0.3 A"

[[targets]]
angles = ["80 deg", "60 deg"]

[[targets]]
angles = ["85 deg", "70 deg"]
"""

CAMERAS = """
[sensing]
kind = "cameras"
seed = 4
noise = 0.3
points = 100

[[sensing.cameras]]
position = ["120 mm", "-300 mm", "0 mm"]
focal_length = 2500

[[sensing.cameras]]
position = ["-120 mm", "-300 mm", "0 mm"]
focal_length = 2500

[controller]
tolerance = "0.2 deg"
"""


def with_cameras() -> str:
    """The same, seen by two cameras, with one target."""
    text = TWO_MAGNETS.replace("[controller]\n", CAMERAS).replace("compare_forces = true\n", "")
    return text[: text.rindex("[[targets]]")]
