"""The pictures of models whose region is no shell all round magnets: windows, coils, workspaces, published fields."""

from __future__ import annotations

import logging

from magfem.fem import Solution
from magfem.fitting import validate
from magfem.fitting.sample_residuals import sample_residuals
from magfem.geometry import Coil, Magnets
from magfem.report.coil_scenes import coil_picture
from magfem.report.figures import Picture, meridian_figures
from magfem.report.figures.cuts import cuts
from magfem.report.figures.region import region_cut_figure
from magfem.report.figures.region_fields import (
    cut_errors,
    region_distance_figure,
    region_error_map,
    region_field_map,
    region_line_figure,
    region_lines,
)
from magfem.report.figures.residuals import residual_figure
from magfem.report.scenes import device_picture, mesh_pictures
from magfem.report.subject import Subject
from magfem.report.surface import surfaces

log = logging.getLogger("magfem")


def draw(subject: Subject) -> dict[str, tuple[Picture, ...]]:
    """The pictures of every section by its name; sections without a picture are left out."""
    found: dict[str, tuple[Picture, ...]] = {}
    geometry, model, truth = subject.geometry, subject.model, subject.truth
    region = model.region
    if isinstance(geometry, Coil):
        log.info("report: device")
        found["device"] = (coil_picture(geometry),)
    elif isinstance(geometry, Magnets):
        log.info("report: device in 3D")
        found["device"] = (device_picture(geometry, surfaces(geometry)),)
    if isinstance(subject.solution, Solution):
        log.info("report: mesh")
        mesh = subject.solution.mesh
        found["mesh"] = meridian_figures(mesh) if mesh.dimension == 2 else mesh_pictures(mesh)
    log.info("report: field in planes and along lines")
    planes = cuts(region)
    found["region"] = tuple(region_cut_figure(region, plane) for plane in planes)
    found["planes"] = tuple(region_field_map(model, plane) for plane in planes)
    lines = tuple(region_line_figure(model, truth, line) for line in region_lines(region))
    if lines:
        found["axis"] = lines
    if truth is not None:
        log.info("report: residuals")
        check = validate(model, truth, "FEM")
        errors = cut_errors(model, truth, planes[0])
        found["residuals"] = (
            *(region_error_map(model, check, errors, planes[0], key) for key in errors),
            *(region_distance_figure(model, check, key) for key in errors),
        )
    return {**found, **of_samples(subject)}


def of_samples(subject: Subject) -> dict[str, tuple[Picture, ...]]:
    """Residuals of the samples that the report was given, if any."""
    if subject.samples is None:
        return {}
    residuals = sample_residuals(subject.model, subject.samples)
    check = validate(subject.model, subject.samples, subject.samples.source)
    return {"samples": (residual_figure(subject.model, residuals, check),)}
