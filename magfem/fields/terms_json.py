"""Terms as model files hold them: a list of tables, one for each source; every float keeps all its bits."""

from __future__ import annotations

from typing import Any

import numpy as np

from magfem.fields.term_kinds import CHARGE_DISC, HARMONIC, INTERIOR, LOOP, NAMES, OBLATE, PATH
from magfem.fields.terms import Terms, charge_discs, closed_path, concatenate, frame_about, harmonics, loops
from magfem.typing import Floats

_PARTS = {HARMONIC: ("cos", "sin"), INTERIOR: ("cos", "sin"), OBLATE: ("real", "imaginary")}
_KINDS = {name: kind for kind, name in NAMES.items()}


def terms_to_list(terms: Terms) -> list[dict[str, Any]]:
    """Terms as JSON-ready objects, one per source."""
    result: list[dict[str, Any]] = []
    for k in range(terms.kind.size):
        run, kind = slice(terms.start[k], terms.start[k + 1]), int(terms.kind[k])
        term: dict[str, Any] = {
            "kind": NAMES[kind],
            "centre": terms.centre[k].tolist(),
            "direction": terms.frame[k][:, 2].tolist(),
            "azimuth": terms.frame[k][:, 0].tolist(),
        }
        if kind == PATH:
            term["nodes"] = terms.nodes[terms.node_start[k] : terms.node_start[k + 1]].tolist()
        else:
            term["radius"] = float(terms.radius[k])
        if kind in _PARTS:
            term["degrees"] = terms.degree[run].tolist()
            if kind != OBLATE:
                term["orders"] = terms.order[run].tolist()
            term["parts"] = [_PARTS[kind][sine] for sine in terms.sine[run]]
        term["coefficients"] = terms.coefficient[run].tolist()
        result.append(term)
    return result


def terms_from_list(data: list[dict[str, Any]]) -> Terms:
    """Inverse of `terms_to_list`; `azimuth` may be left out where it does not matter.

    Raises KeyError, TypeError, ValueError, InputError … for what is not a term, or no field in air.
    """
    if not isinstance(data, list) or not data:
        raise ValueError("a list of at least one term")
    terms = concatenate([_source(term) for term in data])
    terms.check_sources()
    return terms


def _source(term: dict[str, Any]) -> Terms:
    if not isinstance(term, dict):
        raise ValueError("terms that are tables")
    if term["kind"] not in _KINDS:
        raise ValueError(f"a kind among {', '.join(_KINDS)}, got {term['kind']!r}")
    kind = _KINDS[term["kind"]]
    centre, direction, coefficients = (numbers(term[key]) for key in ("centre", "direction", "coefficients"))
    if centre.shape != (3,) or direction.shape != (3,) or not np.linalg.norm(direction) > 0:
        raise ValueError("centre and direction of three numbers")
    if coefficients.ndim != 1 or coefficients.size < 1:
        raise ValueError("a list of coefficients")
    if kind in (LOOP, PATH, CHARGE_DISC) and coefficients.size != 1:
        raise ValueError(f"one coefficient for a {NAMES[kind].replace('_', ' ')}")
    frame = _frame(term, direction)
    if kind == PATH:
        nodes = numbers(term["nodes"])
        if nodes.ndim != 2 or nodes.shape[1] != 3 or len(nodes) < 3:
            raise ValueError("nodes of three numbers each, three nodes or more")
        if np.any(np.all(nodes == np.roll(nodes, 1, axis=0), axis=1)):
            raise ValueError("nodes that differ from their neighbours; the last joins the first by itself")
        return closed_path(nodes, coefficients[0], centre, frame)
    radius = number(term["radius"])
    if not radius > 0:
        raise ValueError("a positive radius")
    if kind in (LOOP, CHARGE_DISC):
        return (loops if kind == LOOP else charge_discs)(centre[None], radius, coefficients, frame)
    degrees, parts = term["degrees"], term["parts"]
    orders = [0] * len(degrees) if kind == OBLATE else term["orders"]
    if not len(degrees) == len(orders) == len(parts) == coefficients.size:
        raise ValueError("degrees, orders, parts and coefficients of one length")
    if not all(type(value) is int for value in (*degrees, *orders)):
        raise ValueError("whole numbers as degrees and orders")
    names = _PARTS[kind]
    if not set(parts) <= set(names):
        raise ValueError(f'parts "{names[0]}" or "{names[1]}"')
    return harmonics(radius, degrees, orders, [part == names[1] for part in parts], coefficients, centre, frame, kind)


def _frame(term: dict[str, Any], direction: Floats) -> Floats:
    if "azimuth" not in term:
        return frame_about(direction)
    x = numbers(term["azimuth"])
    if x.shape != (3,):
        raise ValueError("azimuth of three numbers")
    # The stored axes are used as they are: making them orthogonal again would change bits.
    frame = np.stack([x, np.cross(direction, x), direction], axis=1)
    if not np.allclose(frame.T @ frame, np.eye(3), atol=1e-9):
        raise ValueError("direction and azimuth of length one and perpendicular")
    return frame


def numbers(data: Any) -> Floats:
    """A list of lists … of finite numbers as an array; ValueError for anything else."""
    try:
        array = np.array(data)
    except ValueError:
        array = np.array(None)
    # An array of numbers takes true for 1.
    truths = any(isinstance(entry, bool) for entry in np.array(data, dtype=object).flat) if array.ndim else False
    if array.dtype.kind not in "fiu" or truths or not np.isfinite(array).all():
        raise ValueError("finite numbers, in lists of one length")
    return array.astype(float)


def number(data: Any) -> float:
    """One finite number; ValueError for anything else."""
    array = numbers(data)
    if array.shape != ():
        raise ValueError("one number")
    return float(array)
