"""Files of points: the same habits as files of samples, and a text that gives back every bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from magfem.cli.points import field_text, read_points


@pytest.mark.parametrize(
    "text",
    [
        "x,y,z\n0.001,-0.0025,0.03\n",
        "x_mm;y_mm;z_mm\n1;-2.5;30\n",
        "# places\nx [um]\ty [mm]\tz (cm)\tname\n1000\t-2.5\t3\tedge\n",
    ],
)
def test_points_of_every_delimiter_and_unit(text: str, tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    path.write_text(text)
    assert np.allclose(read_points(path), [[1e-3, -2.5e-3, 30e-3]], rtol=1e-15, atol=0)


def test_a_field_file_is_a_file_of_points_again(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    points, B, gradient = rng.normal(size=(5, 3)), rng.normal(size=(5, 3)), rng.normal(size=(5, 3, 3))
    path = tmp_path / "f.csv"
    path.write_text(field_text(points, B, gradient))
    assert np.array_equal(read_points(path), points)
    values = np.loadtxt(path, delimiter=",", skiprows=1)
    assert np.array_equal(values, np.hstack([points, B, gradient.reshape(5, 9)]))
