"""Which pictures a report has, drawn one after the other."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np

from magfem.closed_form import exact
from magfem.errors import InputError
from magfem.fem import Solution
from magfem.fields import Everywhere, Field, Shell
from magfem.fields.terms import Terms
from magfem.fields.terms_json import terms_from_list
from magfem.fitting import FieldModel
from magfem.fitting.families import dissertation_families
from magfem.geometry import Magnets
from magfem.report import region_pictures
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
    geometry, region = subject.geometry, subject.model.region
    if not isinstance(region, Shell) or region.windowed or subject.model.unit != "T":
        return region_pictures.draw(subject)
    if isinstance(geometry, Magnets):
        return _of_magnets(subject, geometry, region)
    found = region_pictures.draw(subject)
    moment = _snapped(subject.model.moment)
    return {**found, "axis": (axis_figure(subject.model, region, moment, None, None, (), subject.measurements),)}


def _of_magnets(subject: Subject, geometry: Magnets, region: Shell) -> dict[str, tuple[Picture, ...]]:
    """The pictures of a model that holds all round its magnets."""
    found: dict[str, tuple[Picture, ...]] = {}
    truth, model = subject.truth, subject.model
    moment = _snapped(model.moment)
    shapes = surfaces(geometry)
    log.info("report: device in 3D")
    found["device"] = (device_picture(geometry, shapes),)
    found["region"] = (region_figure(region, shapes),)
    planes = field_planes(geometry, shapes)
    if isinstance(subject.solution, Solution):
        log.info("report: mesh")
        mesh = subject.solution.mesh
        found["mesh"] = meridian_figures(mesh) if mesh.dimension == 2 else mesh_pictures(mesh)
    log.info("report: field in two planes")
    found["planes"] = tuple(field_map(truth or model, shapes, plane) for plane in planes)
    log.info("report: field along the axis")
    rivals = _rivals(subject, geometry, region)
    closed_form = _closed_form(geometry)
    found["axis"] = (axis_figure(model, region, moment, truth, closed_form, rivals, subject.measurements),)
    if truth is not None:
        log.info("report: residuals and comparison")
        found["residuals"] = _residuals(model, geometry, region, shapes, planes[0], truth)
        found["comparison"] = _distances(model, region, truth, rivals)
        if not geometry.axisymmetric:
            radius, circle = azimuth_ring(region, moment)
            fields = [(rival.label, rival.terms.jet(circle, 0)[0]) for rival in rivals]
            ours = model.B(circle, outside="extrapolate")
            found["azimuth"] = (azimuth_figure(radius, truth.B(circle), ours, fields),)
    return {**found, **region_pictures.of_samples(subject)}


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


def _residuals(
    model: FieldModel, geometry: Magnets, region: Shell, shapes: tuple[Surface, ...], plane: Plane, truth: Field
) -> tuple[Picture, ...]:
    pictures = []
    for derivative, key in enumerate(("B", "gradient")):
        mark = None
        worst = (model.report.get("worst") or {}).get(key)
        if geometry.axisymmetric and worst is not None:  # all azimuths are one: the worst point has a place
            x, y, z = worst["point"]
            mark = np.array([np.hypot(x, y), 0.0, z])
        pictures.append(error_map(model, truth, region, shapes, plane, derivative, mark))
    return tuple(pictures)


def _distances(model: FieldModel, region: Shell, truth: Field, rivals: list[Rival]) -> tuple[Picture, ...]:
    distances, points = distance_layers(region)
    flat = points.reshape(-1, 3)

    def contender(label: str, terms: Terms, window: Booleans | None) -> Contender:
        jet = tuple(part.reshape(*points.shape[:2], *part.shape[1:]) for part in terms.jet(flat, 1))
        return Contender(label, jet, window, ours=terms is model.lowered)

    contenders = [contender(f"this model: {model.report['label']}", model.lowered, None)]
    contenders += [contender(rival.label, rival.terms, rival.window.contains(points)) for rival in rivals]
    return distance_figures(distances, truth.jet(points, 1), contenders, model.report.get("fem"))


def _rivals(subject: Subject, geometry: Magnets, region: Shell) -> list[Rival]:
    """The families that the model's report compares it with, and where each is meant to hold."""
    families = dissertation_families(geometry, region)
    windows = {one.window.describe(): one.window for one in families if one.window}
    rivals = []
    for entry in subject.model.report.get("comparison") or ():
        window = windows.get(entry["window"], Everywhere())
        where = "" if isinstance(window, Everywhere) else f", {entry['window']}"
        author = entry["source"].partition(",")[0]
        rivals.append(Rival(f"{author}: {entry['label']}{where}", terms_from_list(entry["terms"]), window))
    return rivals
