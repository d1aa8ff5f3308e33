"""The measured files that the project ships: read right, by their own text, by geometry and by another program."""

from __future__ import annotations

from pathlib import Path

import magpylib
import numpy as np
import pytest

from magfem.samples import Samples, parse_columns, read_samples

REFERENCES = Path(__file__).parents[1] / "references"
SCAN = {"x": "-magnet_x_mm", "y": "=0 mm", "z": "=-7 mm"}


def read(name: str, columns: dict[str, str] | None = None) -> Samples:
    samples = read_samples(REFERENCES / name, columns)
    assert isinstance(samples, Samples) and samples.source == name
    return samples


def test_the_gradient_field_is_its_first_and_last_row() -> None:
    field = read("ibi_gradient_2Tpm_tdesign36.csv")
    assert (field.count, field.unit, field.measured.all()) == (36, "T", True)
    assert field.sigma is not None
    assert field.points[0].tolist() == [0.0050139687, -0.0090604006, 0.035077871]
    assert field.B[0].tolist() == [-0.022950001, 0.0134562, 0.064935503]
    assert field.sigma[0].tolist() == [3.7950001e-05, 2.84562e-05, 7.9935503e-05]
    last = (REFERENCES / "ibi_gradient_2Tpm_tdesign36.csv").read_text().split()[-1]
    assert np.hstack([field.points[-1], field.B[-1], field.sigma[-1]]).tolist() == [float(x) for x in last.split(",")]


def test_the_gradient_field_lies_on_its_sphere_and_is_maxwells() -> None:
    """The source states a sphere of 42 mm and 2 T/m; a gradient has no trace and is symmetric."""
    field = read("ibi_gradient_2Tpm_tdesign36.csv")
    centred = field.points - field.points.mean(axis=0)
    assert np.linalg.norm(centred, axis=1) == pytest.approx(42e-3, rel=1e-3)
    gradient = np.linalg.lstsq(np.column_stack([np.ones(36), field.points]), field.B, rcond=None)[0][1:]
    assert np.abs(gradient).max() == pytest.approx(2.0, rel=0.1)
    assert abs(np.trace(gradient)) < 0.02 * 2.0
    assert np.abs(gradient - gradient.T).max() < 0.02 * 2.0


def test_the_scan_is_its_first_and_last_row_in_si() -> None:
    scan = read("bomatec_D8H2_scan.csv", SCAN)
    assert (scan.count, scan.sigma) == (61, None)
    assert scan.points[0].tolist() == [0.015, 0, -0.007]  # 15 mm, exactly
    assert scan.points[-1].tolist() == [-0.015, 0, -0.007]
    assert scan.B[0].tolist() == pytest.approx([-2.12464e-3, 0.093078e-3, -1.04507e-3], rel=1e-15, abs=0)
    last = (REFERENCES / "bomatec_D8H2_scan.csv").read_text().split()[-1].split(",")
    assert scan.B[-1].tolist() == pytest.approx([1e-3 * float(x) for x in last[1:]], rel=1e-15, abs=0)


def test_the_scan_is_the_field_of_its_magnet() -> None:
    """Seen from the magnet, the sensor moves the other way; tilt and place of the sensor are known to some per cent."""
    scan = read("bomatec_D8H2_scan.csv", SCAN)
    magnet = magpylib.magnet.Cylinder(polarization=(0, 0, 1.22), dimension=(8e-3, 2e-3))
    largest = np.abs(scan.B).max()
    assert np.abs(scan.B - magnet.getB(scan.points)).max() < 0.15 * largest
    wrong_way = read("bomatec_D8H2_scan.csv", SCAN | {"x": "magnet_x_mm"})
    assert np.abs(wrong_way.B - magnet.getB(wrong_way.points)).max() > 0.5 * largest


def test_the_command_lines_mapping_is_the_same() -> None:
    columns = parse_columns(["x=-magnet_x_mm", "y==0 mm", "z = =-7 mm"])
    assert columns == SCAN
