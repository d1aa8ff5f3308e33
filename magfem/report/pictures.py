"""Which pictures a report has, drawn one after the other."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np

from magfem.closed_form import exact
from magfem.errors import InputError
from magfem.fields import Everywhere, Field
from magfem.fields.terms import Terms
from magfem.fields.terms_json import terms_from_list
from magfem.fitting.families import dissertation_families
from magfem.geometry import Magnets
from magfem.report.figures import (
    Contender,
    Picture,
    axis_figure,
    azimuth_figure,
    azimuth_ring,
    distance_figures,
    distance_layers,
    error_map,
    field_map,
    field_planes,
    meridian_figures,
)
from magfem.report.figures.planes import Plane
from magfem.report.figures.region import region_figure
from magfem.report.figures.rival import Rival
from magfem.report.scenes import device_picture, mesh_pictures
from magfem.report.subject import Subject
from magfem.report.surface import Surface, surfaces
from magfem.typing import Booleans, Floats

log = logging.getLogger("magfem")


def draw(subject: Subject) -> dict[str, tuple[Picture, ...]]:
    """The pictures of every section by its name; sections without a picture are left out."""
    found: dict[str, tuple[Picture, ...]] = {}
    geometry, solution, model = subject.geometry, subject.solution, subject.model
    moment = _snapped(model.moment)
    if geometry is None:
        found["axis"] = (axis_figure(model, model.region, moment, None, None, (), subject.measurements),)
        return found
    shapes = surfaces(geometry)
    log.info("report: device in 3D")
    found["device"] = (device_picture(geometry, shapes),)
    found["region"] = (region_figure(model.region, shapes),)
    planes = field_planes(geometry, shapes)
    if solution is not None:
        log.info("report: mesh")
        mesh = solution.mesh
        found["mesh"] = meridian_figures(mesh) if mesh.dimension == 2 else mesh_pictures(mesh)
    log.info("report: field in two planes")
    found["planes"] = tuple(field_map(solution or model, shapes, plane) for plane in planes)
    log.info("report: field along the axis")
    rivals = _rivals(subject)
    closed_form = _closed_form(geometry)
    found["axis"] = (axis_figure(model, model.region, moment, solution, closed_form, rivals, subject.measurements),)
    if solution is not None:
        log.info("report: residuals and comparison")
        found["residuals"] = _residuals(subject, shapes, planes[0], solution)
        found["comparison"] = _distances(subject, solution, rivals)
        if not geometry.axisymmetric:
            radius, circle = azimuth_ring(model.region, moment)
            fields = [(rival.label, rival.terms.jet(circle, 0)[0]) for rival in rivals]
            ours = model.B(circle, outside="extrapolate")
            found["azimuth"] = (azimuth_figure(radius, solution.B(circle), ours, fields),)
    return found


def _snapped(moment: Floats) -> Floats:
    """The moment's direction, cleaned of what rounding adds to its zeros."""
    direction = np.round(moment / np.linalg.norm(moment), 5) + 0.0
    unit: Floats = direction / np.linalg.norm(direction)
    return unit


def _closed_form(geometry: Magnets) -> Field | None:
    """The closed form of the same device at recoil permeability 1, where one is known."""
    material = getattr(geometry, "material", None)
    if material is None:
        return None
    try:
        rigid = replace(geometry, material=replace(material, recoil_permeability=1.0))  # type: ignore[type-var]
        return exact(rigid)
    except InputError:
        return None


def _residuals(subject: Subject, shapes: tuple[Surface, ...], plane: Plane, solution: Field) -> tuple[Picture, ...]:
    model, geometry = subject.model, subject.geometry
    pictures = []
    for derivative, key in enumerate(("B", "gradient")):
        mark = None
        if geometry is not None and geometry.axisymmetric:  # all azimuths are one: the worst point has a place
            x, y, z = model.report["worst"][key]["point"]
            mark = np.array([np.hypot(x, y), 0.0, z])
        pictures.append(error_map(model, solution, model.region, shapes, plane, derivative, mark))
    return tuple(pictures)


def _distances(subject: Subject, solution: Field, rivals: list[Rival]) -> tuple[Picture, ...]:
    model = subject.model
    distances, points = distance_layers(model.region)
    flat = points.reshape(-1, 3)

    def contender(label: str, terms: Terms, window: Booleans | None) -> Contender:
        jet = tuple(part.reshape(*points.shape[:2], *part.shape[1:]) for part in terms.jet(flat, 1))
        return Contender(label, jet, window, ours=terms is model.lowered)

    contenders = [contender(f"this model: {model.report['label']}", model.lowered, None)]
    contenders += [contender(rival.label, rival.terms, rival.window.contains(points)) for rival in rivals]
    return distance_figures(distances, solution.jet(points, 1), contenders, model.report["fem"])


def _rivals(subject: Subject) -> list[Rival]:
    """The families that the model's report compares it with, and where each is meant to hold."""
    geometry, entries = subject.geometry, subject.model.report.get("comparison", [])
    if geometry is None:
        return []
    families = dissertation_families(geometry, subject.model.region)
    windows = {one.window.describe(): one.window for one in families if one.window}
    rivals = []
    for entry in entries:
        window = windows.get(entry["window"], Everywhere())
        where = "" if isinstance(window, Everywhere) else f", {entry['window']}"
        author = entry["source"].partition(",")[0]
        rivals.append(Rival(f"{author}: {entry['label']}{where}", terms_from_list(entry["terms"]), window))
    return rivals
