"""A magnet in its place: what all permanent magnets are made of."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import hypot
from typing import Any

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from magfem.constants import MU_0
from magfem.geometry.body import Body
from magfem.geometry.material import PermanentMagnet
from magfem.geometry.shape import Shape
from magfem.typing import Booleans, Floats, Jet, Points

Vector = tuple[float, float, float]
NOWHERE: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Part:
    """A solid of one material, turned and then moved from its own frame into the device's."""

    name: str  # unique within its device
    shape: Shape
    material: PermanentMagnet  # its direction in the solid's own frame
    position: Vector = NOWHERE  # m
    rotation: Vector = NOWHERE  # rotation vector, rad

    @property
    def turn(self) -> Rotation:
        return Rotation.from_rotvec(self.rotation)

    @property
    def pose(self) -> RigidTransform:
        """From the solid's frame to the device's."""
        return RigidTransform.from_components(self.position, self.turn)

    @property
    def corners(self) -> Points:
        """Points (n, 3) m of the surface whose convex hull is the solid's, but for `shape.bulge`."""
        corners: Points = self.pose.apply(self.shape.corners)
        return corners

    @property
    def body(self) -> Body:
        """What the mesh and the solver need to know of it."""
        direction = self.material.magnetisation
        if self.rotation != NOWHERE:
            direction = tuple(self.turn.apply(direction))
        corners = self.shape.corners
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
        return Body(
            name=self.name,
            material=replace(self.material, magnetisation=direction),
            volume=self.shape.volume,
            area=self.shape.area,
            thickness=self.shape.thickness,
            radius=float(np.linalg.norm(corners - middle, axis=1).max()) + self.shape.bulge,
        )

    @property
    def moment(self) -> Floats:
        """Magnetic moment if magnetised rigidly, remanence·volume/µ₀, (3,) A·m², in the device's frame."""
        return self.body.material.remanence_vector * (self.shape.volume / MU_0)

    @property
    def axisymmetric(self) -> bool:
        """Whether body and magnetisation are of revolution about the device's z axis."""
        x, y, _ = self.position
        slack = 1e-12 * max(self.shape.hull.radius, 1e-3)
        upright = hypot(*self.rotation[:2]) < 1e-12 and self.shape.revolved
        direction = self.material.magnetisation  # off by rounding when it was rotated there
        return upright and hypot(x, y) < slack and hypot(*direction[:2]) < 1e-12

    def contains(self, points: Points) -> Booleans:
        """True (...) where points (..., 3) m of the device's frame lie inside."""
        return self.shape.contains(self._local(points))

    def build(self, occ: Any) -> list[int]:
        """Make the solid in its place in `gmsh.model.occ`; its volume tags, not synchronised."""
        tags = self.shape.build(occ)
        solids = [(3, tag) for tag in tags]
        angle = hypot(*self.rotation)
        if angle > 0:
            occ.rotate(solids, 0.0, 0.0, 0.0, *(component / angle for component in self.rotation), angle)
        if self.position != NOWHERE:
            occ.translate(solids, *self.position)
        return tags

    def build_meridian(self, occ: Any) -> list[int]:
        """Make the half section of a solid that is `axisymmetric`, x = rho and y = z; its surface tags."""
        tags = self.shape.build_meridian(occ)
        if self.position[2]:
            occ.translate([(2, tag) for tag in tags], 0.0, self.position[2], 0.0)
        return tags

    def jet(self, points: Points, order: int) -> Jet:
        """Closed-form field at points (n, 3) m, both in the device's frame, at recoil permeability 1."""
        magnetisation = self.material.remanence_vector / MU_0
        local = self.shape.jet(self._local(points), magnetisation, order)
        if self.rotation == NOWHERE:
            return local
        turn = self.turn.as_matrix()
        rules = ("ia,na->ni", "ia,jb,nab->nij", "ia,jb,kc,nabc->nijk")
        return tuple(
            np.einsum(rule, *[turn] * (rank + 1), values, optimize=True)
            for rank, (rule, values) in enumerate(zip(rules, local, strict=False))
        )

    def _local(self, points: Points) -> Points:
        moved = points - np.array(self.position)
        turned: Points = moved if self.rotation == NOWHERE else moved @ self.turn.as_matrix()
        return turned
