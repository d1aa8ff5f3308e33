"""The report: a self-contained page whose numbers are the model's, readable on a phone and on paper."""

from __future__ import annotations

import base64
import ctypes
import io
import re
import shutil
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

import magfem
from magfem.errors import CardError, InputError, MissingProgramError
from magfem.report import measured, numbers, page, pdf, show_picture, write_report
from magfem.report.recipe import load_recipe
from magfem.report.subject import Subject, gather
from magfem.report.surface import surfaces

RING = "ring_magnet_4x1.5x1"
FIGURES = {
    "device",
    "mesh",
    "mesh_corner",
    "field_xz",
    "field_xy",
    "axis",
    "residual_B",
    "residual_gradient",
    "distance_B",
    "distance_gradient",
    "region",
}
RECIPE = """
device = "rotor_1x3"

[[measurement]]
position = ["10 mm", "0 mm", "0 mm"]
direction = [1, 0, 0]
value = "411 uT"
source = "a bench"
"""


@dataclass(frozen=True)
class Report:
    """The ring's report, written once for all tests."""

    subject: Subject
    path: Path

    @property
    def html(self) -> str:
        return self.path.read_text(encoding="utf-8")


class Page(HTMLParser):
    """What a page refers to, its images by figure, and its tables: texts and machine-readable values by row."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.images: dict[str, dict[str, str | None]] = {}
        self.rows: dict[str, list[list[float]]] = {}
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self._figure = self._table = ""
        self.feed(html)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        values = dict(attributes)
        self.tags.append((tag, values))
        self.links += [values[key] or "" for key in ("src", "href", "srcset", "action") if key in values]
        if tag == "figure":
            self._figure = (values.get("id") or "").removeprefix("figure-")
        if tag == "img":
            self.images[self._figure] = values
        if tag == "table":
            self._table = values.get("id") or ""
        if tag == "tr":
            self.rows.setdefault(self._table, []).append([])
        if tag == "data" and self._table:
            self.rows[self._table][-1].append(float(values["value"] or "nan"))

    def handle_endtag(self, tag: str) -> None:
        if tag == "table":
            self._table = ""


@pytest.fixture(scope="session")
def report(tmp_path_factory: pytest.TempPathFactory) -> Report:
    """Solved, fitted and written once."""
    subject, path = gather(RING), tmp_path_factory.mktemp("report") / "ring.html"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("magfem.report.subject.gather", lambda target: subject)
        assert write_report(RING, path) == (path,)
    return Report(subject, path)


@pytest.fixture
def phone(browser: Any, report: Report) -> Iterator[Any]:
    """The page in a browser window as wide as a phone."""
    size = {"width": 360, "height": 740, "deviceScaleFactor": 2, "mobile": True}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    browser.get(report.path.as_uri())
    yield browser
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


# The page by itself


def test_nothing_is_loaded_from_outside(report: Report) -> None:
    links = Page(report.html).links + re.findall(r"url\(([^)]*)\)", report.html)
    assert len(links) > len(FIGURES)
    assert [link[:60] for link in links if not link.startswith(("data:", "#"))] == []
    assert "@import" not in report.html and "<script" not in report.html


def test_links_within_the_page_have_their_places(report: Report) -> None:
    found = Page(report.html)
    places = {values.get("id") for _, values in found.tags}
    assert {link[1:] for link in found.links if link.startswith("#")} <= places


def test_every_figure_is_there_and_not_blank(report: Report) -> None:
    images = Page(report.html).images
    assert set(images) == FIGURES
    for name, values in images.items():
        kind, _, data = (values["src"] or "").partition(",")
        assert kind == "data:image/png;base64"
        pixels = imread(io.BytesIO(base64.b64decode(data)))[..., :3]
        assert pixels.std() > 0.03, name
        assert np.mean(pixels.min(axis=-1) < 0.95) > 0.01, name
        height, width = pixels.shape[:2]
        assert int(values["width"] or 0) / int(values["height"] or 1) == pytest.approx(width / height, rel=0.01)
        assert len(values["alt"] or "") > 20


def test_error_table_is_the_models_report(report: Report) -> None:
    stated = report.subject.model.report
    rows = [row for row in Page(report.html).rows["error-table"] if row]
    assert rows == [
        [stated["training"][key][which] for key in ("B", "gradient") for which in ("max", "rms")],
        [stated["heldout"][key][which] for key in ("B", "gradient") for which in ("max", "rms")],
        [stated["fem"][key] for key in ("B", "gradient")],
        [stated["bound"][key] for key in ("B", "gradient")],
    ]


def test_comparison_table_is_the_models_report(report: Report) -> None:
    rows = [row for row in Page(report.html).rows["comparison-table"] if row]
    assert rows == [
        [entry[whose][key]["max"] for whose in ("heldout", "ours") for key in ("B", "gradient")]
        for entry in report.subject.model.report["comparison"]
    ]


def test_our_model_beats_the_dissertations_on_the_same_points(report: Report) -> None:
    for entry in report.subject.model.report["comparison"]:
        for key in ("B", "gradient"):
            assert entry["ours"][key]["max"] < 0.1 * entry["heldout"][key]["max"]


def test_all_terms_and_the_whole_card_are_on_the_page(report: Report) -> None:
    model = report.subject.model
    rows = Page(report.html).rows["term-table"]
    assert len(rows) == 1 + model.lowered.coefficient.size
    card = model.provenance["device"]["card"]
    assert card["sha256"] in report.html
    assert "outer_diameter = &#34;4 mm&#34;" in report.html


def test_user_text_is_escaped(report: Report, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page, "draw", lambda subject: {})
    html = page.render(replace(report.subject, title="<script>alert(1)</script>", usage='"/><b>'))
    assert "<script" not in html and "<b>" not in html


def test_a_model_without_a_device_still_has_a_page(report: Report) -> None:
    model = report.subject.model
    bare = replace(
        model,
        provenance={**model.provenance, "device": None, "solver": None, "solution": None},
        report={**model.report, "fem": None, "comparison": []},
    )
    found = Page(page.render(Subject("A fit", "a.json", bare, is_model=True)))
    assert set(found.images) == {"axis", "region_xz", "region_yz", "field_xz", "field_yz"}
    assert [row for row in found.rows["error-table"] if row][-1] == list(model.report["bound"].values())


# The page in a browser


def test_the_page_asks_the_network_for_nothing(phone: Any) -> None:
    loaded = phone.execute_script("return performance.getEntriesByType('resource').map(e => e.name)")
    assert [name for name in loaded if not name.startswith("data:")] == []
    assert [entry for entry in phone.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")] == []


def test_no_sideways_scrolling_on_a_phone(phone: Any) -> None:
    width, window = phone.execute_script("return [document.scrollingElement.scrollWidth, innerWidth]")
    assert window == 360
    assert width <= window


def test_wide_tables_scroll_inside_their_box(phone: Any) -> None:
    boxes = phone.execute_script(
        "return [...document.querySelectorAll('.scroll, pre')].map(b => [b.clientWidth, b.scrollWidth,"
        " getComputedStyle(b).overflowX])"
    )
    assert any(content > box for box, content, _ in boxes)
    assert all(overflow == "auto" for _, _, overflow in boxes)


def test_every_image_loads_at_its_stated_shape(phone: Any) -> None:
    images = phone.execute_script(
        "return [...document.images].map(i => [i.complete && i.naturalWidth, i.naturalWidth / i.naturalHeight,"
        " i.clientWidth / i.clientHeight, i.alt])"
    )
    assert len(images) == len(FIGURES)
    for width, natural, shown, alt in images:
        assert width > 0
        assert shown == pytest.approx(natural, rel=0.02)
        assert alt


def test_page_has_language_title_and_one_main_heading(phone: Any) -> None:
    assert phone.execute_script("return document.documentElement.lang") == "en-GB"
    assert "Ring magnet" in phone.title
    assert phone.execute_script("return document.querySelectorAll('h1').length") == 1


# On paper


def test_pdf_has_pages(report: Report, tmp_path: Path) -> None:
    if not any(shutil.which(name) for name in pdf.BROWSERS):
        pytest.skip("needs chromium (Debian: chromium)")
    html = Path(shutil.copy(report.path, tmp_path))
    content = pdf.print_pdf(html).read_bytes()
    assert (tmp_path / "ring.pdf").is_file()
    assert content.startswith(b"%PDF")
    assert 3 <= len(re.findall(rb"/Type\s*/Page\b", content)) <= 12
    assert b"/MediaBox [0 0 594.95996 841.91998]" in content or re.search(rb"/MediaBox\s*\[0 0 59[45]", content)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["ring.html", "ring.pdf"]


def test_no_browser_is_said_before_anything_is_computed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(MissingProgramError, match="apt-get install chromium"):
        write_report(RING, tmp_path / "ring.html", pdf=True)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "message"),
    [("a.txt", "must end in .html"), ("nowhere/a.html", "no folder"), ("there.html", "this is a folder")],
)
def test_places_that_cannot_be_written_are_said_before_anything_is_computed(
    tmp_path: Path, name: str, message: str
) -> None:
    (tmp_path / "there.html").mkdir()
    with pytest.raises(InputError, match=message):
        write_report(RING, tmp_path / name)


# What a report is about


def test_a_model_file_is_reported_as_it_is_beside_its_device_solved_again(report: Report, tmp_path: Path) -> None:
    file = tmp_path / "model.json"
    report.subject.model.save(file)
    subject = gather(file)
    assert subject.is_model and subject.usage == str(file)
    assert subject.model.report == report.subject.model.report
    assert subject.solution is not None and report.subject.solution is not None
    np.testing.assert_allclose(subject.solution.moment, report.subject.solution.moment, rtol=1e-9)


def test_a_recipe_finds_its_card_beside_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []
    monkeypatch.setattr("magfem.report.subject._from_card", lambda device, recipe=None: asked.append(device))
    (tmp_path / "mine.toml").write_text('device = "card.toml"\n')
    gather(tmp_path / "mine.toml")
    gather("rotor_1x3")  # a recipe of the catalogue, whose device is a name
    gather("geometries/rotor_1x3.toml")
    assert asked == [str(tmp_path / "card.toml"), "rotor_1x3", "geometries/rotor_1x3.toml"]


def test_unknown_names_are_refused() -> None:
    with pytest.raises(InputError, match="nearest"):
        gather("ring_magnet_4x1.5x2")


def test_rotor_recipe_holds_the_dissertations_readings() -> None:
    recipe = load_recipe("rotor_1x3")
    assert recipe.device == "rotor_1x3"
    readings: list[Any] = [(m.position.tolist(), m.direction.tolist(), m.value) for m in recipe.measurements]
    assert readings == [
        ([x * 1e-3, 0.0, 0.0], [1.0, 0.0, 0.0], pytest.approx(b * 1e-6))
        for x, b in ((10, 411), (20, 55), (30, 18), (40, 7))
    ]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('device = "rotor_1x3"', "", 'missing key "device"'),
        ("device", "devise", "did you mean"),
        ('["10 mm", "0 mm", "0 mm"]', '["10 mm", "0 mm"]', r"list of three .* measurement\[0\].position"),
        ('"10 mm"', "10", r'such as "4 mm", got the bare number 10 .* measurement\[0\].position'),
        ("[1, 0, 0]", "[0, 0, 0]", "zero vector"),
        ("[1, 0, 0]", '["x", 0, 0]', "finite bare numbers"),
        ('"411 uT"', '"411 mm"', r"not a flux density .* measurement\[0\].value"),
        ('source = "a bench"', "", r'missing key "source" .* measurement\[0\].source'),
        ("[[measurement]]", "[measurement]", "list of tables"),
        ('source = "a bench"', 'source = "a bench"\nuncertainty = "0 T"', "must be positive"),
    ],
)
def test_recipe_errors_name_file_and_key(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in RECIPE
    file = tmp_path / "recipe.toml"
    file.write_text(RECIPE.replace(old, new, 1))
    with pytest.raises(CardError, match=message) as caught:
        load_recipe(file)
    assert str(file) in str(caught.value)


# Measurements and numbers


def test_implied_remanence_scales_with_the_reading() -> None:
    rotor = magfem.load_geometry("rotor_1x3")
    rigid = replace(rotor, material=replace(rotor.bodies[0].material, recoil_permeability=1.0))  # type: ignore[type-var]
    truth = magfem.exact(rigid)
    readings = load_recipe("rotor_1x3").measurements
    shrunk = tuple(replace(m, value=0.9 * float(truth.B(m.position) @ m.direction)) for m in readings)
    compared = measured.compare(shrunk, truth, 1.42)
    np.testing.assert_allclose([one.remanence for one in compared], 0.9 * 1.42, rtol=1e-12)
    assert "fits all of them" in measured.reading(compared, 1.42)
    assert "no single remanence" in measured.reading(measured.compare(readings, truth, 1.42), 1.42)


def test_numbers_are_written_for_people() -> None:
    narrow = numbers.NARROW
    assert numbers.percent(1.2345e-4) == f"0.012{narrow}%"
    assert numbers.percent(4.6e-7) == f"4.6 × 10⁻⁵{narrow}%"
    assert numbers.bound(1.0714e-4) == f"0.011{narrow}%"
    assert numbers.bound(1.1e-4) == f"0.011{narrow}%"
    assert numbers.bound(1.1001e-4) == f"0.012{narrow}%"
    assert numbers.quantity(0.011287, "A·m²", 4) == f"11.29{narrow}mA·m²"
    assert numbers.quantity(9.9996e-4, "T") == f"1.00{narrow}mT"
    assert numbers.measured(4.11e-4, 5e-7, "T") == f"411 ± 0.5{narrow}µT"
    assert numbers.direction([0, 0, -2]) == "−z"
    assert numbers.millimetres([1e-3, -2.5e-4, 1e-19]) == f"(1, −0.25, 0){narrow}mm"
    assert numbers.rounded_down(38512.7) == 30000


# Pictures


def test_sections_of_the_ring_have_the_closed_forms_length() -> None:
    (ring,) = surfaces(magfem.load_geometry(RING))

    def length(normal: list[float]) -> float:
        cut = ring.section(np.zeros(3), np.array(normal))
        return float(np.linalg.norm(cut[:, 1] - cut[:, 0], axis=-1).sum())

    assert length([0, 1, 0]) == pytest.approx(4 * (1.25e-3 + 1e-3), rel=1e-3)
    assert length([0, 0, 1]) == pytest.approx(2 * np.pi * (2e-3 + 0.75e-3), rel=2e-3)
    assert ring.section(np.array([0, 0, 1e-3]), np.array([0, 0, 1.0])).size == 0


def test_shown_device_has_its_north_pole_where_the_moment_points(tmp_path: Path) -> None:
    show_picture(magfem.load_geometry("rotor_1x3"), tmp_path / "rotor.png")
    red, _, blue = np.moveaxis(imread(tmp_path / "rotor.png")[: 2 * 300, :, :3], -1, 0)  # above the legend
    middle = {
        name: float(np.nonzero(mask)[1].mean())
        for name, mask in {"north": red > blue + 0.25, "south": blue > red + 0.25}.items()
    }
    assert middle["north"] > middle["south"]  # x points to the right


def test_a_missing_graphics_library_is_named_with_the_line_to_type(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> None:
        raise OSError(name)

    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(ctypes, "CDLL", absent)
    with pytest.raises(MissingProgramError, match=r"libX11.*apt-get install .*libx11-6"):
        show_picture(magfem.load_geometry("rotor_1x3"), Path("never.png"))
