"""Pages of models that are no shell all round a magnet: measured, published, windowed, per ampere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import magfem
from magfem.errors import InputError
from magfem.fitting import FieldModel, Recipe
from magfem.fitting.recipe_file import load_recipe
from magfem.report import write_report
from magfem.samples import Samples, read_samples

REFERENCES = Path(__file__).parents[1] / "references"
WINDOW = """
device = "ring_magnet_4x1.5x1"

[region]
clearance = "0.5 mm"
extent = "7 mm"
z = ["1 mm", "6 mm"]
rho = ["0 mm", "6 mm"]
"""


@dataclass(frozen=True)
class Written:
    model: FieldModel
    path: Path

    @property
    def html(self) -> str:
        return self.path.read_text(encoding="utf-8")


class Figures(HTMLParser):
    """Figures, sections and the texts of the cells of tables by their id."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.figures: list[str] = []
        self.sections: list[str] = []
        self.cells: dict[str, list[str]] = {}
        self._table = ""
        self._cell = False
        self.feed(html)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        name = dict(attributes).get("id") or ""
        if tag == "figure":
            self.figures.append(name.removeprefix("figure-"))
        if tag == "section" and name:
            self.sections.append(name)
        if tag == "table":
            self._table = name
        if tag in ("td", "th"):
            self._cell = True
            self.cells.setdefault(self._table, []).append("")

    def handle_endtag(self, tag: str) -> None:
        if tag in ("td", "th"):
            self._cell = False

    def handle_data(self, data: str) -> None:
        if self._cell:
            self.cells[self._table][-1] += data


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Written]:
    """A model's page, written from its file."""
    folder = tmp_path_factory.mktemp("pages")

    def write(name: str, model: FieldModel, samples: Samples | None = None) -> Written:
        model.save(folder / f"{name}.json")
        write_report(folder / f"{name}.json", folder / f"{name}.html", samples=samples)
        return Written(model, folder / f"{name}.html")

    return write


@pytest.fixture(scope="module")
def gradient(written: Callable[..., Written]) -> Written:
    """The measured gradient field, beside its samples."""
    samples = read_samples(REFERENCES / "ibi_gradient_2Tpm_tdesign36.csv")
    assert isinstance(samples, Samples)
    return written("gradient", magfem.fit(samples), samples)


@pytest.fixture(scope="module")
def scan(written: Callable[..., Written]) -> Written:
    """The measured scan of a magnet: pose and background free."""
    columns = {"x": "-magnet_x_mm", "y": "=0 mm", "z": "=-7 mm"}
    samples = read_samples(REFERENCES / "bomatec_D8H2_scan.csv", columns)
    assert isinstance(samples, Samples)
    disc = magfem.load_geometry("disc_magnet_8x2")
    recipe = Recipe(geometry=disc, family="device", free={"centre": None, "tilt": None}, background=True)
    return written("scan", magfem.fit(samples, recipe))


@pytest.fixture(scope="module")
def published(written: Callable[..., Written]) -> Written:
    return written("published", magfem.load_model("bigmag_air"))


@pytest.fixture(scope="module")
def window(written: Callable[..., Written], tmp_path_factory: pytest.TempPathFactory) -> Written:
    file = tmp_path_factory.mktemp("recipe") / "front.toml"
    file.write_text(WINDOW)
    recipe = load_recipe(file)
    assert recipe.geometry is not None
    return written("window", magfem.fit(magfem.solve(recipe.geometry), recipe))


@pytest.fixture(scope="module")
def loop(written: Callable[..., Written]) -> Written:
    return written("loop", magfem.fit(magfem.solve(magfem.load_geometry("loop_50"))))


def test_measured_page_tells_noise_bias_and_candidates(gradient: Written) -> None:
    page, report = Figures(gradient.html), gradient.model.report
    assert {"samples", "errors", "terms", "region"} <= set(page.sections) and "fem" not in page.sections
    assert "residuals" in page.figures and {"field_xz", "field_yz", "region_xz"} <= set(page.figures)
    assert report["uncertainty"]["bias_dominates"]
    assert "own error is larger than the noise" in gradient.html and "its error is estimated" in gradient.html
    cells = page.cells["candidate-table"]
    assert [one["label"] for one in report["candidates"]] == [cell for cell in cells if cell.startswith("interior")]
    assert len(page.cells["term-table"]) == 6 * (1 + gradient.model.lowered.coefficient.size)


def test_what_was_found_of_a_scan_stands_with_its_deviation(scan: Written) -> None:
    page, found = Figures(scan.html), scan.model.report["measurement"]
    cells = page.cells["free-table"]
    names = {"centre x", "centre y", "centre z", "tilt x", "tilt y", "tilt z", "remanence", "background, x"}
    assert names <= set(cells)
    for name in found["degenerate"]:
        row = cells.index(name.replace("_", " "))
        assert "±" not in cells[row + 1] and cells[row + 2] == "cannot be told from the coefficients"
    assert "±" in cells[cells.index("remanence") + 1]
    assert "device" in page.figures and "residuals" not in page.figures


def test_published_page_states_bound_and_ground_and_no_errors_of_a_fit(published: Written) -> None:
    page, report = Figures(published.html), published.model.report
    assert report["ground"][:40] in published.html and "T/A" in published.html
    assert not {"fem", "residuals", "samples"} & set(page.sections)
    assert "training points" not in published.html and "condition number" not in published.html
    assert len(page.cells["term-table"]) == 6 * (1 + published.model.lowered.coefficient.size)


def test_windowed_page_is_held_against_its_device_solved_again(window: Written) -> None:
    page = Figures(window.html)
    assert {"device", "mesh", "residual_B", "residual_gradient", "distance_B", "distance_gradient"} <= set(page.figures)
    assert "z from 1 to 6 mm and ρ ≤ 6 mm" in window.html


def test_coil_page_is_per_ampere(loop: Written) -> None:
    """The moment of a loop of one turn is its area, per ampere."""
    page = Figures(loop.html)
    assert {"device", "residual_B", "distance_B"} <= set(page.figures) and "fem" in page.sections
    area = float(np.linalg.norm(loop.model.moment))
    assert area == pytest.approx(np.pi * 0.025**2, rel=0.1)
    assert "mA·m²/A" in loop.html and "T/m/A out" in loop.html and "magfem.load_model" in loop.html


def test_samples_are_for_models(tmp_path: Path) -> None:
    samples = Samples(np.array([[0.0, 0.0, 0.1]]), np.ones((1, 3)))
    with pytest.raises(InputError, match="samples are held against a model"):
        write_report("loop_50", tmp_path / "loop.html", samples=samples)


@pytest.mark.parametrize("name", ["gradient", "scan", "published", "window", "loop"])
def test_pages_fit_a_phone_and_load_nothing(name: str, browser: Any, request: pytest.FixtureRequest) -> None:
    """In a real browser: no sideways scrolling, whole images, no broken anchors, nothing from outside."""
    browser.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride", {"width": 360, "height": 740, "deviceScaleFactor": 2, "mobile": True}
    )
    browser.get(request.getfixturevalue(name).path.as_uri())
    assert browser.execute_script("return document.scrollingElement.scrollWidth <= innerWidth")
    assert browser.execute_script("return [...document.images].every(i => i.complete && i.naturalWidth > 0 && i.alt)")
    anchors = "return [...document.querySelectorAll('nav a')].every(a => document.querySelector(a.hash))"
    assert browser.execute_script(anchors)
    loaded = browser.execute_script("return performance.getEntriesByType('resource').map(e => e.name)")
    assert [one for one in loaded if not one.startswith("data:")] == []
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
