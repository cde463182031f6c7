"""Names of this room for other rooms and for tests; each is imported when it is first used."""

from fecm.problem.build import ImpactModel as ImpactModel
from fecm.problem.build import RunOptions as RunOptions
from fecm.problem.build import build_model as build_model
from fecm.problem.contact_estimates import wave_impedance as wave_impedance
from fecm.problem.estimates import NoCurveError as NoCurveError
from fecm.problem.estimates import nonlinear_curve as nonlinear_curve
from fecm.problem.findings_page import all_rules as all_rules
from fecm.problem.generate import restraint_codes as restraint_codes
from fecm.problem.loading import LoadedDeck as LoadedDeck
from fecm.problem.loading import load_deck as load_deck
from fecm.problem.memory import needed_bytes as needed_bytes
from fecm.problem.outline import unsupported as unsupported
from fecm.problem.parts import build_law as build_law
from fecm.problem.parts import build_plate as build_plate
from fecm.problem.parts import build_projectile as build_projectile
from fecm.problem.parts import is_coupled as is_coupled
from fecm.problem.parts import laminates_of_deck as laminates_of_deck
from fecm.problem.parts import strengths_of_deck as strengths_of_deck
from fecm.problem.plate_mesh import PlateMesh as PlateMesh
from fecm.problem.plate_mesh import read_mesh as read_mesh
from fecm.problem.problem import Problem as Problem
from fecm.problem.refine import RefineError as RefineError
from fecm.problem.refine import refined_deck as refined_deck
from fecm.problem.rules.time_step import clamped_frequency as clamped_frequency
from fecm.problem.rules.units import likely_unit as likely_unit
from fecm.problem.summary import deck_summary as deck_summary
