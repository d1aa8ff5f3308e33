"""What a user gets from `pip install .`: the wheel, alone in a clean environment, used from another folder.

The clean environment holds the wheel and, as links, the packages that its metadata asks for, with what those
ask for in turn. Nothing else is importable: not the checkout, no test tool, no package that nobody declared.
This takes seconds and no network. It leaves out pip's choice of versions, which requirements.lock fixes.
"""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
import venv
import zipfile
from importlib.metadata import Distribution, distribution, distributions
from math import hypot
from pathlib import Path

import pytest
from packaging.requirements import Requirement

CHECKOUT = Path(__file__).parents[1]
CARD = "ring_magnet_4x1.5x1"


def run(*command: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run a command as a user would, with no trace of this test's own Python in its environment."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON") and k != "VIRTUAL_ENV"}
    done = subprocess.run(
        command,
        cwd=cwd,
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, f"{command} returned {done.returncode}\n{done.stdout}\n{done.stderr}"
    return done


def build_wheel(source: Path, folder: Path) -> Path:
    pip = (sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation")
    run(*pip, "--wheel-dir", folder, source, cwd=folder)
    (wheel,) = folder.glob("*.whl")
    return wheel


def declared_packages(package: Distribution) -> list[Distribution]:
    """The distributions that a package's metadata asks for, without its extras, and all that those need."""
    found: dict[str, Distribution] = {}
    waiting = [(package, "")]
    while waiting:
        package, extra = waiting.pop()
        for requirement in map(Requirement, package.requires or ()):
            if requirement.marker and not requirement.marker.evaluate({"extra": extra}):
                continue
            needed = distribution(requirement.name)
            assert requirement.specifier.contains(needed.version, prereleases=True), requirement
            if needed.name not in found or requirement.extras:
                found[needed.name] = needed
                waiting += [(needed, wanted) for wanted in requirement.extras or {""}]
    return list(found.values())


def link(package: Distribution, site_packages: Path) -> None:
    """Make an installed distribution importable from `site_packages`, it alone."""
    tops = {file.parts[0] for file in package.files or ()} - {"..", "__pycache__"}
    for top in tops:
        assert not top.endswith(".pth"), f"{package.name} brings {top}, which may open other folders"
        if not (site_packages / top).exists():
            (site_packages / top).symlink_to(str(package.locate_file(top)))


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_wheel(CHECKOUT, tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="module")
def programs(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of `python` and `magfem` in an environment of the wheel and its declared packages."""
    home = tmp_path_factory.mktemp("clean") / "venv"
    venv.create(home, with_pip=False, symlinks=True)
    (site_packages,) = home.glob("lib/python3*/site-packages")
    programs = home / "bin"
    pip = (sys.executable, "-m", "pip", "--python", programs / "python")
    run(*pip, "install", "--quiet", "--no-deps", "--no-index", wheel, cwd=home)
    (magfem,) = distributions(name="magfem", path=[str(site_packages)])
    for package in declared_packages(magfem):
        link(package, site_packages)
    return programs


def test_the_wheel_is_what_runs(programs: Path, tmp_path: Path) -> None:
    look = "import json, sys, magfem; print(json.dumps([magfem.__file__, sys.path]))"
    file, path = json.loads(run(programs / "python", "-c", look, cwd=tmp_path).stdout)
    assert Path(file).is_relative_to(programs.parent)
    running = Path(sys.prefix)
    foreign = [p for p in path if p and (Path(p).is_relative_to(CHECKOUT) or Path(p).is_relative_to(running))]
    assert not foreign, f"the clean environment sees {foreign}"


def test_undeclared_packages_cannot_be_imported(programs: Path, tmp_path: Path) -> None:
    tools = ["pytest", "hypothesis", "selenium", "hatchling"]
    look = f"from importlib.util import find_spec; print([name for name in {tools} if find_spec(name)])"
    assert run(programs / "python", "-c", look, cwd=tmp_path).stdout.strip() == "[]"


def test_the_catalogue_travels(programs: Path, tmp_path: Path) -> None:
    listed = run(programs / "magfem", "list", "--json", cwd=tmp_path).stdout
    json.loads(listed)
    for card in (CHECKOUT / "geometries").glob("*.toml"):
        assert f'"{card.stem}"' in listed, f"magfem list does not know {card.stem}"
    for model in (CHECKOUT / "fits").glob("*.json"):
        assert f'"{model.stem}"' in listed, f"magfem list does not know {model.stem}"
        load = f"import magfem; print(magfem.load_model({model.stem!r}).moment)"
        run(programs / "python", "-c", load, cwd=tmp_path)
    for system in (CHECKOUT / "geometries" / "systems").glob("*.toml"):
        load = f"import magfem; print(magfem.load_system({system.stem!r}))"
        run(programs / "python", "-c", load, cwd=tmp_path)


def test_exports_travel(programs: Path, tmp_path: Path) -> None:
    """The files that exports are made of are in the wheel; magpylib, an extra, is not needed to write its module."""
    for to, file in (("c", "ring.h"), ("mat", "ring.mat"), ("vti", "ring.vti"), ("magpylib", "ring.py")):
        run(programs / "magfem", "export", CARD, "--to", to, "-o", file, cwd=tmp_path)
        assert (tmp_path / file).exists()
    assert (tmp_path / "magfem_field.m").read_text().startswith("function [B, G] = magfem_field")
    use = "import magfem.errors\ntry: import ring\nexcept magfem.errors.InputError as error: print(error)"
    assert "pip install" in run(programs / "python", "-c", use, cwd=tmp_path).stdout


def test_the_sdist_makes_the_same_wheel(wheel: Path, tmp_path: Path) -> None:
    run(sys.executable, "-m", "hatchling", "build", "--target", "sdist", "--directory", tmp_path, cwd=CHECKOUT)
    (sdist,) = tmp_path.glob("*.tar.gz")
    (tmp_path / "wheel").mkdir()
    again = build_wheel(sdist, tmp_path / "wheel")
    assert sorted(zipfile.ZipFile(again).namelist()) == sorted(zipfile.ZipFile(wheel).namelist())


def axial_field(z: float, remanence: float, diameters: tuple[float, float], length: float) -> float:
    """B on the axis of an axially magnetised ring of recoil permeability 1: charged discs at the ends."""
    upper, lower = z + length / 2, z - length / 2
    solid = [remanence / 2 * (upper / hypot(upper, d / 2) - lower / hypot(lower, d / 2)) for d in diameters]
    return solid[0] - solid[1]


def test_from_card_to_field_model(programs: Path, tmp_path: Path) -> None:
    """Fit, validate and evaluate by catalogue name, in a folder that has nothing to do with the checkout."""
    magfem = programs / "magfem"
    run(magfem, "fit", CARD, "-o", "m.json", cwd=tmp_path)
    assert json.loads((tmp_path / "m.json").read_text())["unit"] == "T"
    run(magfem, "validate", "m.json", cwd=tmp_path)

    heights = [1.5e-3, 3e-3, 6e-3]
    (tmp_path / "p.csv").write_text("x,y,z\n" + "".join(f"0,0,{z}\n" for z in heights))
    run(magfem, "field", "m.json", "--points", "p.csv", "-o", "f.csv", "--gradient", cwd=tmp_path)
    rows = list(csv.DictReader((tmp_path / "f.csv").read_text().splitlines()))
    assert [float(row["z"]) for row in rows] == heights
    for row in rows:
        bx, by, bz = (float(row[name]) for name in ("Bx", "By", "Bz"))
        # The card's recoil permeability is 1.05, the closed form's 1: 3 % apart.
        assert bz == pytest.approx(axial_field(float(row["z"]), 1.35, (4e-3, 1.5e-3), 1e-3), rel=0.05)
        assert hypot(bx, by) < 0.01 * abs(bz)
        divergence = sum(float(row[f"dB{i}_d{i}"]) for i in "xyz")
        assert abs(divergence) < 1e-6 * abs(float(row["dBz_dz"]))
