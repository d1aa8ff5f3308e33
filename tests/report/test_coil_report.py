"""The report of a coil: a page of its own whose numbers are the solution's."""

from __future__ import annotations

import base64
import io
import re
from dataclasses import dataclass, replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

import magfem
from magfem.fem.coil_solution import CoilSolution
from magfem.report import write_report
from magfem.report.coil_page import render
from magfem.report.subject import CoilSubject, gather

SPIRAL, SOLENOID = "planar_coil_12mm", "solenoid_20x30x30"


@dataclass(frozen=True)
class Written:
    """A report and what it is about."""

    solution: CoilSolution
    path: Path

    @property
    def html(self) -> str:
        return self.path.read_text(encoding="utf-8")


class Page(HTMLParser):
    """Images by figure, links, ids, and the machine-readable numbers of every row of every table."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.images: dict[str, str] = {}
        self.links: list[str] = []
        self.ids: set[str] = set()
        self.rows: dict[str, list[list[float]]] = {}
        self._figure = self._table = ""
        self.feed(html)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        values = {key: value or "" for key, value in attributes}
        self.ids.add(values.get("id", ""))
        self.links += [values[key] for key in ("src", "href") if key in values]
        if tag == "figure":
            self._figure = values["id"].removeprefix("figure-")
        if tag == "img":
            self.images[self._figure] = values["src"]
        if tag == "table":
            self._table = values.get("id", "")
        if tag == "tr":
            self.rows.setdefault(self._table, []).append([])
        if tag == "data" and self._table:
            self.rows[self._table][-1].append(float(values["value"]))

    def handle_endtag(self, tag: str) -> None:
        if tag == "table":
            self._table = ""

    def numbers(self, table: str) -> list[list[float]]:
        """The rows of a table that hold numbers."""
        return [row for row in self.rows[table] if row]


def written(name: str, folder: Path, limit: float | None = None, resolution: float = 1.0) -> Written:
    geometry: Any = magfem.load_geometry(name)
    geometry = replace(geometry, conductor=replace(geometry.conductor, current_density_limit=limit))
    solution = magfem.solve(geometry, resolution=resolution)
    assert isinstance(solution, CoilSolution)
    subject = CoilSubject(geometry.name, name, solution)
    path = folder / f"{name}.html"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("magfem.report.subject.gather", lambda target: subject)
        assert write_report(name, path) == (path,)
    return Written(solution, path)


@pytest.fixture(scope="module")
def spiral(tmp_path_factory: pytest.TempPathFactory) -> Written:
    return written(SPIRAL, tmp_path_factory.mktemp("spiral"), limit=1e8, resolution=0.5)


@pytest.fixture(scope="module")
def solenoid(tmp_path_factory: pytest.TempPathFactory) -> Written:
    return written(SOLENOID, tmp_path_factory.mktemp("solenoid"))


@pytest.mark.parametrize("name", ["spiral", "solenoid"])
def test_the_page_stands_alone(name: str, request: pytest.FixtureRequest) -> None:
    page = Page(request.getfixturevalue(name).html)
    links = page.links
    assert [link[:60] for link in links if not link.startswith(("data:", "#"))] == []
    assert {link[1:] for link in links if link.startswith("#")} <= page.ids


def test_every_figure_is_there_and_not_blank(spiral: Written, solenoid: Written) -> None:
    images = Page(spiral.html).images
    assert {"device", "line_z", "line_x", "homogeneity_xy", "current_coil", "current_close_coil"} <= set(images)
    assert sum(key.startswith("field_xy") for key in images) == 3  # the clearance, 1 mm and 2 mm
    assert {"device", "field_xz", "field_xy", "homogeneity_xz", "homogeneity_xy"} <= set(Page(solenoid.html).images)
    for name, source in {**images, **Page(solenoid.html).images}.items():
        kind, _, data = source.partition(",")
        assert kind == "data:image/png;base64"
        pixels = imread(io.BytesIO(base64.b64decode(data)))[..., :3]
        assert pixels.std() > 0.03, name


def test_resistance_and_inductance_are_the_solutions(spiral: Written) -> None:
    page, solution = Page(spiral.html), spiral.solution
    (circuit,) = solution.circuits
    (row,) = page.numbers("conductor-table")
    length, leads, estimate, resistance, spread, of_leads = row
    assert (resistance, spread, of_leads) == (
        circuit.resistance,
        circuit.resistance_error,
        circuit.lead_resistance,
    )
    assert estimate == pytest.approx(resistance, rel=2e-3)
    assert length > 0.5 and leads < 0.01
    assert page.numbers("inductance-table") == [solution.inductance.ravel().tolist()]
    assert page.numbers("error-table")[-2:] == [[solution.error["B"]], [solution.error["gradient"]]]


def test_heights_hold_the_field_over_the_middle(spiral: Written) -> None:
    rows = Page(spiral.html).numbers("height-table")
    assert len(rows) == 3
    for (B, slope, largest), height in zip(rows, (0.2e-3, 1e-3, 2e-3), strict=True):
        jet = spiral.solution.jet([0.0, 0.0, 4.5e-6 + height], 1)
        assert pytest.approx(jet[0][2], rel=1e-9) == B
        assert slope == pytest.approx(jet[1][2, 2], rel=1e-9)
        assert largest >= 0.99 * B


def test_power_table_keeps_the_limit_of_the_card(spiral: Written) -> None:
    (circuit,) = spiral.solution.circuits
    ((power, per_watt, _, current, field, heat),) = Page(spiral.html).numbers("power-table")
    assert power == circuit.resistance
    assert current * circuit.crowding / circuit.section == pytest.approx(1e8)
    assert field == pytest.approx(current * per_watt * circuit.resistance**0.5)
    assert heat == pytest.approx(circuit.resistance * current**2)


def test_solenoids_middle_is_its_closed_form(solenoid: Written) -> None:
    """Axis of a thick solenoid: µ0 n I / 2 (b − a) · asinh differences; here by its own solution and by the page."""
    rows = Page(solenoid.html).numbers("homogeneity-table")
    middle = float(solenoid.solution.B([0.0, 0.0, 0.0])[2])
    assert middle == pytest.approx(0.0321986191, rel=1e-6)  # r 10–15 mm, 30 mm long, 1000 A-turns
    assert [row[0] for row in rows] == pytest.approx([middle] * len(rows), rel=2e-2)
    deviations = [row[3] for row in rows]
    assert deviations == sorted(deviations)
    assert "The card states no limit" in solenoid.html


def test_user_text_is_escaped(solenoid: Written, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("magfem.report.coil_pictures.draw", lambda *_: {})
    html = render(CoilSubject("<script>alert(1)</script>", '"/><b>', solenoid.solution))
    assert "<script" not in html and "<b>" not in html


def test_a_recipe_may_name_a_coil(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text('device = "loop_50"\ntitle = "My loop"\n')
    subject = gather(tmp_path / "mine.toml")
    assert isinstance(subject, CoilSubject)
    assert subject.title == "My loop"


def test_no_sideways_scrolling_on_a_phone(browser: Any, spiral: Written) -> None:
    size = {"width": 360, "height": 740, "deviceScaleFactor": 2, "mobile": True}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        browser.get(spiral.path.as_uri())
        width = browser.execute_script("return document.scrollingElement.scrollWidth")
        shown = browser.execute_script("return [...document.images].map(i => i.complete && i.naturalWidth)")
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    assert width <= 360
    assert len(shown) >= 9 and all(shown)
    assert re.search("Planar coil", browser.title)
    assert np.isfinite(width)
