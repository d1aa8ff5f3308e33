"""The pages of studies and of the closed system, opened by themselves in a browser."""

from __future__ import annotations

import pytest
from scenario.test_closed_system import recipe as closed_recipe
from scenario.test_localization_studies import recipe as study_recipe

from magfem.geometry.card import parse_table
from magfem.report.closed_system_folder import write_closed_run
from magfem.report.study_folder import FILES, write_study
from magfem.report.study_pictures import draw
from magfem.scenario.closed_system import read_closed_system, simulate_closed_system
from magfem.scenario.localization_study.recipe import run_study

FEW = {
    "localize_isolines": {"strengths": '["20 uT"]', "beta": '["30 deg", "60 deg"]', "draws": "5", "band_draws": "20"},
    "localize_tracks": {"windows": "20", "random_paths": "1"},
    "localize_range": {"distances": '["20 mm", "40 mm"]', "draws": "5"},
    "localize_workspace": {"points": "9", "spacings": '["0 mm", "20 mm"]'},
    "isoline_functions": {},
    "stator_influence": {},
}


def opened(browser, page) -> None:
    browser.get(f"file://{page}")
    assert browser.execute_script("return document.images.length") > 0
    assert browser.execute_script("return [...document.images].every(one => one.complete && one.naturalWidth > 0)")
    outside = "performance.getEntriesByType('resource').filter(r => !r.name.startsWith('data:')).length"
    assert browser.execute_script(f"return {outside}") == 0
    assert not browser.get_log("browser")
    assert browser.execute_script("return document.documentElement.scrollWidth <= window.innerWidth")


@pytest.mark.parametrize("name", FEW)
def test_the_page_of_a_study(name, browser, tmp_path):
    study = run_study(parse_table(study_recipe(name, **FEW[name]).encode(), "a.toml"))
    assert {f"{one.name}.png" for one in draw(study)} <= FILES
    write_study(study, tmp_path / "out")
    opened(browser, tmp_path / "out" / "report.html")
    rows = browser.execute_script("return document.querySelectorAll('#comparison-table tbody tr').length")
    assert rows == len(study.comparisons)


def test_the_page_of_the_closed_system(browser, tmp_path):
    run = simulate_closed_system(read_closed_system(parse_table(closed_recipe(targets='["F"]').encode(), "a.toml")))
    write_closed_run(run, tmp_path / "out")
    opened(browser, tmp_path / "out" / "report.html")
    rows = browser.execute_script("return document.querySelectorAll('#junction-table tbody tr').length")
    assert rows == len(run.bendings)
