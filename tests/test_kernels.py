"""The compiled kernels give what NumPy gives, whatever the plate and the number of threads."""

from __future__ import annotations

import ctypes
import itertools
import re
import shutil
import subprocess
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import h5py
import numpy as np
import pytest

import fecm
from fecm import Result, Rod
from fecm.mechanics import failure, impact, kernels, strains
from fecm.mechanics.contact_law import RELOADING, UNLOADING, VIRGIN
from fecm.mechanics.elements import Quadrature, gauss, nodal
from fecm.mechanics.impact_steps import COLUMNS, LawKind
from fecm.mechanics.impact_sweep import Given, ResultRow
from fecm.mechanics.interpolation import NDOF
from fecm.mechanics.kernels.element_groups import ElementKind
from fecm.mechanics.kernels.failure import COMPILED
from fecm.mechanics.kernels.layout import LANES
from fecm.mechanics.kernels.plate import CompiledProduct
from fecm.mechanics.kernels.strains import TYING, CompiledStrains, StrainsStruct
from fecm.mechanics.laminate import LaminateSection
from fecm.mechanics.plate import PlateModel
from fecm.mechanics.projectile import RodState, WilsonStep
from fecm.mechanics.rod_modes import ProjectileModes
from fecm.mechanics.stiffness_product import stiffness_operator
from fecm.mechanics.strains import StrainField
from fecm.mechanics.symmetry import symmetry_reduction
from fecm.problem.build import RunOptions, build_model
from fecm.problem.loading import load_deck
from fecm.problem.problem import Problem
from tests.builders import (
    boundary,
    distorted_square,
    general_plate,
    isotropic_plate,
    rules,
    square,
    with_restraints,
)
from tests.calls import call
from tests.decks import small
from tests.stopped_runs import StoppedError
from tests.stopped_runs import run as run_to
from tests.test_element_decks import deck as element_deck

compiled = pytest.mark.skipif(kernels.LIBRARY is None, reason="the kernels are not compiled")
NUMPY = RunOptions(solver="numpy")
SOURCES = Path(kernels.__file__).parent
WARNINGS = ("-std=gnu11", "-Wall", "-Wextra", "-Werror", "-Wno-psabi")


@lru_cache(maxsize=2)
def problem(text: str) -> Problem:
    """The checked problem of a deck."""
    (actual,) = load_deck(text).problems
    return actual


def assert_same_product(text: str, dofs: int, slips: frozenset[str]) -> None:
    """K u of both agrees to rounding for a random displacement; `dofs` move at a node.

    NumPy's elements are moved to the origin: its Jacobians have the rounding of large coordinates.
    """
    motion = build_model(problem(text), RunOptions(solver="numpy", slips=slips)).motion
    plate, kept = motion.plate, motion.reduction
    u = np.random.default_rng(0).standard_normal(len(motion.mass))
    product = CompiledProduct(plate, kept, 1)
    plate.__dict__["families"] = [
        replace(family, coordinates=family.coordinates - family.coordinates[:, :1])
        for family in plate.families
    ]
    wanted, actual = stiffness_operator(plate, "numpy", kept)(u), product(u)
    np.testing.assert_allclose(actual, wanted, rtol=0.0, atol=5e-15 * np.abs(wanted).max())
    assert len(product.plate.columns) == dofs


@compiled
@pytest.mark.parametrize("kind", [3, 4, 8, 9, 10, 12])
@pytest.mark.parametrize("coupled", [False, True])
@pytest.mark.few(3)  # of 12, 0.2 s each
def test_the_product_is_numpys_for_every_family_and_rule(kind: int, coupled: bool) -> None:
    meshes = square(5, 4, kind), distorted_square(5, 4, kind)
    for mesh, orders, variant in itertools.product(
        meshes, ((3, 3, 3), (4, 2, 3)), ("", "jacobian", "SHEA MITC", "SHEA MITC, jacobian")
    ):
        assumed = "SHEA MITC" in variant
        if assumed and kind not in (4, 9):
            continue
        text = element_deck(mesh, orders)
        if coupled:
            text = text.replace("2,90.,.053", "2,30.,.053").replace(",1,1,0,0,0", ",0,0,0,0,0")
            text = text.replace("800000.,800000.\n", "800000.,500000.\n")  # A*45 is not 0
        if assumed:
            text = text.replace("EXPE\n", "SHEA MITC\nEXPE\n", 1)
        slips = frozenset(["jacobian"] if "jacobian" in variant else [])
        assert_same_product(text, NDOF if coupled else 3, slips)


@compiled
@pytest.mark.parametrize("laminate", [isotropic_plate(0.1), general_plate()], ids=["B = 0", "B"])
@pytest.mark.parametrize("orders", [(3, 2), (2, 2), (4, 3)], ids=str)
def test_assumed_shear_strains_of_curved_elements_are_sums_along_xi_and_eta(
    laminate: LaminateSection, orders: tuple[int, int]
) -> None:
    """With every node moved, mid-sides and centres too, so that no slope of the mapping is 0."""
    coordinates, elements = square(5, 4)
    inner = ~boundary(coordinates, elements)[:, :1]
    shifts = np.random.default_rng(2).uniform(-0.02, 0.02, coordinates.shape)
    mesh = with_restraints(coordinates + inner * shifts, elements, boundary(coordinates, elements))
    plate = PlateModel(mesh, laminate, replace(rules(*orders), assumes_shear=True))
    kept = symmetry_reduction(plate, None)
    u = np.random.default_rng(0).standard_normal(kept.count)
    wanted = stiffness_operator(plate, "numpy", kept)(u)
    product = CompiledProduct(plate, kept)
    np.testing.assert_allclose(product(u), wanted, rtol=0.0, atol=5e-15 * np.abs(wanted).max())
    chunk = product.plate.structure.chunk[0]
    kinds = {chunk.block[number].group.contents.kind for number in range(chunk.blocks)}
    assert kinds == {ElementKind.FACTORIZED}


@compiled
@pytest.mark.parametrize("kind", [4, 9])
@pytest.mark.parametrize("slip", [False, True])
@pytest.mark.parametrize("rule", [gauss(1), gauss(3), nodal(3), gauss(4)], ids=lambda r: len(r.xi))
def test_assumed_shear_strains_of_fields_are_numpys(
    kind: int, slip: bool, rule: Quadrature, monkeypatch: pytest.MonkeyPatch
) -> None:
    coordinates, elements = distorted_square(3, 2, kind)
    fields = np.random.default_rng(3).standard_normal((2, len(coordinates), NDOF))
    known = StrainField(elements, coordinates, rule, transposed_jacobian=slip, assumes_shear=True)
    wanted = known.evaluate(fields)
    monkeypatch.delattr(StrainField, "evaluate")
    actual = CompiledStrains(
        elements, coordinates, rule, transposed_jacobian=slip, assumes_shear=True
    )
    atol = 1e-14 * np.abs(wanted).max()
    np.testing.assert_allclose(actual.evaluate(fields), wanted, rtol=0.0, atol=atol)


@compiled
def test_the_product_does_not_depend_on_the_number_of_threads() -> None:
    coordinates, elements = distorted_square(48, 48)
    mesh = with_restraints(coordinates, elements, boundary(coordinates, elements))
    plate = PlateModel(mesh, isotropic_plate(0.1), rules(3, 2))
    kept = symmetry_reduction(plate, None)
    u = np.random.default_rng(1).standard_normal(kept.count)
    products = [CompiledProduct(plate, kept, threads) for threads in (1, 2, 3)]
    assert products[0].plate.structure.chunks == 4
    one, *others = (product(u) for product in products)
    for other in others:
        np.testing.assert_array_equal(other, one)


REPORT = Path("decks/impact-115.inp").read_text()
FIRST = REPORT.replace("LOOP       4000", "LOOP       1500")  # of two contacts
DECKS = {
    "small": small(),
    "point": FIRST,
    "patch and gage": FIRST.replace(
        "EXPE",
        "PATC\nDISC             0.2\n\nGAGE\n    1       2.5       2.0     0.053        0.\n\nEXPE",
    ),
    "rigid mass": FIRST.replace("EXPE", "PROJ\n    0    0  0.000181\n\nEXPE"),
    "one rigidity": FIRST.replace(
        "EXPE\n  1912000. 0.0006564     0.094       2.0", "EXPE ACR\n  1912000. 0.0006564"
    ),
    "damping": FIRST.replace("EXPE", "DAMP\n     3000.\n\nEXPE"),
    "distorted": element_deck(distorted_square(6, 6), (3, 2, 3), steps=300),
    "assumed shear strains": element_deck(distorted_square(6, 6), (3, 2, 3), steps=300).replace(
        "EXPE\n", "SHEA MITC\nEXPE\n", 1
    ),
    "rows far apart": REPORT.replace("EXPE\n", "SHEA MITC\nEXPE\n", 1).replace(
        "        20", "      3000"
    ),
    "shorter steps": REPORT.replace("4000", "  37"),
}


# Rounding decides which of the equal exposures of a symmetric plate is the largest.
PLACES = {f"exposures/{name}" for name in ("mode", "ply", "x", "y")}


def assert_close(result: Result, wanted: Result) -> None:
    """Every dataset agrees to 1e-10 of its maximum, but for the places of largest exposures."""
    assert list(result) == list(wanted)
    for name in wanted:
        if name in PLACES:
            continue
        values = wanted[name]
        scale = np.abs(values[np.isfinite(values)]).max(initial=0.0)
        if name == "energy/balance_error":
            scale = max(scale, wanted.attributes_of("energy")["initial"])
        # NumPy's step of the rod carries the rounding of its rigid velocity, 1e-11 of a step's
        # acceleration, where the modes of the kernels are exact to 2e-15.
        atol = (1e-9 if name.endswith("acceleration") else 1e-10) * scale
        np.testing.assert_allclose(result[name], values, rtol=0.0, atol=atol, err_msg=name)


@compiled
@pytest.mark.parametrize("name", DECKS)
@pytest.mark.few(3)  # of 10, 0.2 s each
def test_a_run_is_that_of_numpy(name: str) -> None:
    actual, wanted = (fecm.run_one(DECKS[name], solver=s) for s in ("kernels", "numpy"))
    assert_close(actual, wanted)


@compiled
def test_a_run_does_not_depend_on_the_number_of_threads(tmp_path: Path) -> None:
    # So many elements that the threads share them.
    deck = element_deck(distorted_square(34, 34), (3, 2, 3), steps=40).replace("2.0E-7", "5.0E-8")
    for threads in (1, 3):
        fecm.run_one(deck, output=tmp_path / f"{threads}.h5", threads=threads)
    assert (tmp_path / "1.h5").read_bytes() == (tmp_path / "3.h5").read_bytes()


@compiled
def test_a_run_resumed_between_bursts_gives_the_same_bytes(tmp_path: Path) -> None:
    """Of a run that ends at an observer, as an interrupted one does."""
    deck, whole, cut = REPORT.replace("4000", " 300"), tmp_path / "whole.h5", tmp_path / "cut.h5"
    run_to(deck, whole, interval=50)
    with pytest.raises(StoppedError):
        run_to(deck, cut, 3, interval=50)
    run_to(deck, cut, resume=True, interval=50)
    assert cut.read_bytes() == whole.read_bytes()


@compiled
def test_rows_are_those_of_one_burst_if_memory_ends_it_earlier(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    deck = REPORT.replace("4000", " 300")
    wanted = fecm.run_one(deck)
    monkeypatch.setattr("fecm.simulation.macros.FIELDS", 3000)  # one field
    assert_close(fecm.run_one(deck), wanted)


@pytest.mark.parametrize("elements", [1, 2, 20, 60])
@pytest.mark.parametrize("tapered", [False, True])
def test_the_modes_of_a_rod_take_the_step_of_its_matrices(elements: int, tapered: bool) -> None:
    """To the rounding of the latter, which hold the rigid velocity."""
    diameters = 0.02 * (1.0 + 0.5 * np.linspace(0.0, 1.0, elements) * tapered)
    rod = Rod(0.025, tuple(diameters.tolist()), 2.07e11, 7850.0)
    K, M = rod.stiffness(), rod.mass()
    integrator, modes = WilsonStep(K, M, 2e-7), ProjectileModes.of(K, M)
    rng = np.random.default_rng(0)
    state = RodState(np.stack([scale * rng.standard_normal(len(M)) for scale in (1e-9, 30.0, 1e6)]))
    T, h = modes.step(integrator)
    moved = np.einsum("abm,bm->am", T.reshape(3, 3, -1), modes.motion(state)) + 5e3 * h
    after = integrator.advance(state, 5e3)
    for actual, wanted in zip(moved[1:] @ modes.shapes.T, after.motion[1:], strict=True):
        np.testing.assert_allclose(actual, wanted, rtol=0.0, atol=1e-9 * np.abs(wanted).max())


HEADER = Path(kernels.__file__).with_name("structures.h")
NUMBERS = {"int64_t": ctypes.c_int64, "double": ctypes.c_double}
POINTERS = {
    "double": kernels.Doubles, "int32_t": kernels.Integers, "int64_t": kernels.Longs,
    "int8_t": kernels.Codes,
}  # fmt: skip


def declared_structures() -> dict[str, list[tuple[str, str, bool]]]:
    """Name, type and whether it is a pointer, of the fields of each structure of structures.h."""
    code = re.sub(r"/\*.*?\*/", "", HEADER.read_text(encoding="utf-8"), flags=re.DOTALL)
    structures = {}
    for body, name in re.findall(r"typedef struct \{(.*?)\} (\w+);", code, flags=re.DOTALL):
        fields = []
        for declaration in filter(None, map(str.strip, body.split(";"))):
            words = re.fullmatch(r"(?:const )?(\w+) (.*)", declaration, re.DOTALL)
            assert words is not None, declaration
            kind, names = words.groups()
            for field in (field.strip() for field in names.split(",")):
                fields.append((field.lstrip("*"), kind, field.startswith("*")))
        structures[name] = fields
    return structures


def declared_constants() -> dict[str, int]:
    """Values of the enumerators of structures.h by name."""
    code = re.sub(r"/\*.*?\*/", "", HEADER.read_text(encoding="utf-8"), flags=re.DOTALL)
    constants = {}
    for body in re.findall(r"enum \{(.*?)\};", code, flags=re.DOTALL):
        value = 0
        for enumerator in filter(None, map(str.strip, body.split(","))):
            name, _, given = enumerator.partition("=")
            value = int(given) if given else value
            constants[name.strip()] = value
            value += 1
    return constants


def test_the_structures_of_python_have_the_fields_of_those_of_c() -> None:
    python = {
        kind.__name__.removesuffix("Struct"): kind for kind in kernels.Structure.__subclasses__()
    }
    expected = {
        name: [
            (
                field,
                (POINTERS.get(kind) or ctypes.POINTER(python[kind]))
                if is_pointer
                else NUMBERS.get(kind) or python[kind],
            )
            for field, kind, is_pointer in fields
        ]
        for name, fields in declared_structures().items()
    }
    assert len(expected) == HEADER.read_text(encoding="utf-8").count("typedef struct {")
    assert {name: [tuple(field) for field in kind._fields_] for name, kind in python.items()} == (
        expected
    )


def test_the_enumerations_of_python_have_the_values_of_those_in_c() -> None:
    expected = {one.name: one.value for kind in (ElementKind, LawKind) for one in kind}
    expected |= {f"GIVEN_{one.name}": one.value for one in Given}
    expected |= {f"FOUND_{one.name}": one.value for one in ResultRow}
    expected |= {"VIRGIN": VIRGIN, "UNLOADING": UNLOADING, "RELOADING": RELOADING}
    expected |= {name.upper(): place for place, name in enumerate(COLUMNS)}
    expected |= {
        "COLUMNS": len(COLUMNS),
        "GIVEN": len(Given),
        "FOUND": len(ResultRow),
        "LANES": LANES,
        "CRITERIA": len(COMPILED),
        "TIED": 2 * max(len(along) * len(across) for along, across, _ in strains.TYING.values()),
        "PASSES": impact.PASSES,
        "TYING": TYING,
    }
    assert declared_constants() == expected


def test_the_failure_criteria_of_c_have_the_names_candidates_and_modes_of_those_in_python() -> None:
    code = HEADER.with_name("kernels.c").read_text(encoding="utf-8")
    (named,) = re.findall(r"enum \{ CANDIDATES = (\d+), HASHIN = (\d+), PUCK = (\d+) \};", code)
    lists = dict(re.findall(r"(CODES|BEGIN)\[.*?\] = \{(.*?)\};", code))
    codes, begin = (list(map(int, lists[name].split(","))) for name in ("CODES", "BEGIN"))
    one = np.ones(1)
    strengths = fecm.Strengths(1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 2.0, 1.0, 0.3, 1.0)
    modes = [
        [mode for mode, _ in failure.CRITERIA[name](strengths, one, one, one)] for name in COMPILED
    ]
    assert list(failure.CRITERIA)[: len(COMPILED)] == list(COMPILED)
    assert begin == [0, *itertools.accumulate(map(len, modes))]
    assert [failure.MODES[number] for number in codes] == [*itertools.chain.from_iterable(modes)]
    places = [COMPILED.index(name) for name in ("hashin", "puck")]
    assert [int(number) for number in named] == [len(codes), *places]


def test_a_structure_takes_arrays_of_its_types_in_c_order() -> None:
    table = np.zeros((2, 3, 4))
    assert StrainsStruct(table=table).table[5] == 0.0
    with pytest.raises(TypeError, match="LP_c_double"):
        StrainsStruct(table=table.astype(np.int64))
    with pytest.raises(ValueError, match="not in C order"):
        StrainsStruct(table=table[:, :2])


@compiled
def test_the_result_names_its_solver(tmp_path: Path) -> None:
    for solver in ("kernels", "numpy", "csr"):
        path = tmp_path / f"{solver}.h5"
        fecm.run_one(small(), output=path, solver=solver)
        with h5py.File(path) as file:
            assert file.attrs["solver"] == solver


def test_without_kernels_numpy_runs_and_the_word_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    wanted = fecm.run_one(small(), solver="numpy")
    monkeypatch.setattr(kernels, "LIBRARY", None)
    monkeypatch.setattr("fecm.problem.build.LIBRARY", None)
    np.testing.assert_array_equal(fecm.run_one(small()).force, wanted.force)
    with pytest.raises(ValueError, match="no compiled kernels; take the solver numpy"):
        fecm.run_one(small(), solver="kernels")


def test_info_shows_whether_the_kernels_are_compiled() -> None:
    shown = call("info", "--system").stdout
    assert f"kernels   {kernels.description()}\n" in shown


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
@pytest.mark.parametrize(
    "options", [["-fsyntax-only"], pytest.param(["-O1"], marks=pytest.mark.long)], ids=" ".join
)
def test_the_kernels_compile_without_a_warning(options: list[str], tmp_path: Path) -> None:
    command = ["cc", *WARNINGS, *options, "-DFECM_STAMP=0", "-c"]
    command += [str(SOURCES / "kernels.c"), "-o", str(tmp_path / "kernels.o")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
