"""Names of this room for other rooms and for tests; each is imported when it is first used."""

from fecm.simulation.checkpoint import Checkpointer as Checkpointer
from fecm.simulation.checkpoint import CheckpointError as CheckpointError
from fecm.simulation.checkpoint import checkpoint_of as checkpoint_of
from fecm.simulation.checkpoint import spool_of as spool_of
from fecm.simulation.interpreter import Action as Action
from fecm.simulation.interpreter import Interpreter as Interpreter
from fecm.simulation.job import Run as Run
from fecm.simulation.job import Solver as Solver
from fecm.simulation.job import run as run
from fecm.simulation.recorder import Recorder as Recorder
from fecm.simulation.run import run_program as run_program
from fecm.simulation.run import simulate as simulate
from fecm.simulation.saved import restore as restore
from fecm.simulation.saved import saved_values as saved_values
from fecm.simulation.simulation import Simulation as Simulation
