"""Grades of permanent magnets by name: what their makers state, at 20 °C."""

from __future__ import annotations

from dataclasses import dataclass
from difflib import get_close_matches

from magfem.errors import InputError
from magfem.units import quoted

REFERENCE_TEMPERATURE = 293.15  # K, 20 °C, at which remanences are stated


@dataclass(frozen=True)
class Family:
    """What grades of one alloy share, and who says so."""

    alloy: str
    recoil_permeability: float
    temperature_coefficient: float  # 1/K, reversible, of the remanence between 20 and 100 °C or so
    source: str


@dataclass(frozen=True)
class Grade:
    """One grade. The remanence is the middle of the stated range, or the stated typical value."""

    name: str
    family: Family
    remanence: float  # T at 20 °C
    range: tuple[float, float] | None  # T, what deliveries may have; None: only a typical value is stated
    highest_temperature: float  # K; thin magnets (a low permeance) lose flux for good well below it


NDFEB = Family(
    "sintered NdFeB",
    1.05,
    -0.12e-2,
    "ranges of remanence: makers' common tables (Shanghai Magnet, 'NdFeB Performance Parameter Table'; "
    "HGT Magnets; N55: Vormag); recoil permeability and temperature coefficient: the first of these; "
    "MMPA 0100-00 gives -0.09 to -0.13 %/K; highest temperature by suffix: none 80, M 100, H 120, SH 150, UH 180 °C",
)
SMCO_1_5 = Family(
    "sintered SmCo 1:5",
    1.05,
    -0.043e-2,
    "typical remanence: FEMM material notes (femm.info, SmCoProperties, after Bunting's data sheet); "
    "temperatures and recoil permeability: Magnet Sales & Manufacturing, properties of SmCo magnets",
)
SMCO_2_17 = Family("sintered SmCo 2:17", 1.05, -0.03e-2, SMCO_1_5.source)
FERRITE = Family(
    "sintered hard ferrite",
    1.1,
    -0.2e-2,
    "Y grades: ranges of SJ/T 10410-2000 and SJ 285-77; C grades: nominal values of the US industry standard, both as "
    "makers print them (Jingxin Magnet, Metalmat), with the temperature coefficient and the highest temperature; "
    "their recoil permeability is 1.05 to 1.3",
)


def _celsius(value: float) -> float:
    return value + 273.15


def _ndfeb() -> list[Grade]:
    ranges = {
        35: (1.17, 1.22),
        38: (1.22, 1.25),
        40: (1.25, 1.28),
        42: (1.28, 1.32),
        45: (1.32, 1.37),
        48: (1.37, 1.42),
        50: (1.39, 1.44),
        52: (1.42, 1.48),
        55: (1.47, 1.52),
    }
    hottest = {"": (80, 55), "M": (100, 52), "H": (120, 50), "SH": (150, 48), "UH": (180, 42)}
    grades = []
    for suffix, (temperature, strongest) in hottest.items():
        for number, (low, high) in ranges.items():
            if number <= strongest:
                limit = 70 if number >= 52 and not suffix else temperature  # the strongest plain grades are softer
                middle = round((low + high) / 2, 4)
                grades.append(Grade(f"N{number}{suffix}", NDFEB, middle, (low, high), _celsius(limit)))
    return grades


def _smco() -> list[Grade]:
    typical = {
        (SMCO_1_5, "SmCo5", 250): {18: 0.837, 20: 0.885, 22: 0.930, 24: 0.973},
        (SMCO_2_17, "Sm2Co17", 300): {24: 1.006, 26: 1.049, 28: 1.090, 30: 1.130, 32: 1.168},
    }
    return [
        Grade(f"{prefix}-{number}", family, remanence, None, _celsius(hottest))
        for (family, prefix, hottest), values in typical.items()
        for number, remanence in values.items()
    ]


def _ferrite() -> list[Grade]:
    ranges = {
        "Y10T": (0.200, 0.235),
        "Y20": (0.320, 0.380),
        "Y25": (0.360, 0.400),
        "Y30": (0.370, 0.400),
        "Y30BH": (0.380, 0.390),
        "Y35": (0.400, 0.410),
        "Y40": (0.440, 0.460),
    }
    nominal = {"C1": 0.230, "C5": 0.380, "C8": 0.385, "C10": 0.400, "C11": 0.420}
    hottest = _celsius(250)
    return [
        *(
            Grade(name, FERRITE, round((low + high) / 2, 4), (low, high), hottest)
            for name, (low, high) in ranges.items()
        ),
        *(Grade(name, FERRITE, remanence, None, hottest) for name, remanence in nominal.items()),
    ]


GRADES: dict[str, Grade] = {grade.name: grade for grade in (*_ndfeb(), *_smco(), *_ferrite())}
"""All grades by name."""


def grade_named(name: str) -> Grade:
    """The grade of a name, whatever the case of its letters. Raises InputError, which names the nearest."""
    by_name = {known.upper(): grade for known, grade in GRADES.items()}
    key = name.strip().upper()
    if key not in by_name:
        nearest = get_close_matches(key, by_name, n=1)
        advice = f"did you mean {quoted(by_name[nearest[0]].name)}?" if nearest else f"known: {', '.join(GRADES)}"
        raise InputError(f"unknown grade {quoted(name)}; {advice}")
    return by_name[key]


def grade_rows() -> list[tuple[str, str, float, float, float]]:
    """Name, alloy, remanence (T), temperature coefficient (1/K), highest temperature (K) of every grade, as lists
    show them."""
    return [
        (g.name, g.family.alloy, g.remanence, g.family.temperature_coefficient, g.highest_temperature)
        for g in GRADES.values()
    ]
