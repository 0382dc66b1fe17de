"""State-space models with uncertainty from recordings, in open or closed loop; and what a simulation lacks.

>>> import innovant
>>> u, y, dt = innovant.examples.closed_loop(2000)
>>> model = innovant.identify(u, y, dt=dt)
>>> print(model.verdict)
Order 4 model of 2 outputs from 2 inputs, 2000 samples, 1 s: the residuals are white and show no nonlinearity
"""

from . import examples
from ._innovant import InnovantError, __version__
from .comparison import Comparison, compare
from .estimate import Estimate, EstimatedParameter
from .explanation import Explanation, explain
from .identification import identify
from .linearisation import Linearisation
from .model import Model
from .moments import Moments
from .plant import Plant, PlantEstimate
from .record import Record
from .responses import FrequencyResponse, Roots, StepResponse
from .simulator import Simulator, SimulatorEstimate
from .validation import PlantValidation, Validation

__all__ = [
    "Comparison",
    "Estimate",
    "EstimatedParameter",
    "Explanation",
    "FrequencyResponse",
    "InnovantError",
    "Linearisation",
    "Model",
    "Moments",
    "Plant",
    "PlantEstimate",
    "PlantValidation",
    "Record",
    "Roots",
    "Simulator",
    "SimulatorEstimate",
    "StepResponse",
    "Validation",
    "__version__",
    "compare",
    "examples",
    "explain",
    "identify",
]
