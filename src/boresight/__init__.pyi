# What type checkers and editors see of the lazy __init__; a test keeps the two equal.
from boresight.catalogue import cite as cite
from boresight.errors import BoresightError as BoresightError
from boresight.errors import DataError as DataError
from boresight.errors import Status as Status
from boresight.errors import UsageError as UsageError
from boresight.experiments.metrics import anees as anees
from boresight.experiments.metrics import rmse as rmse
from boresight.experiments.reproduce import reproduce as reproduce
from boresight.experiments.scenario import Scenario as Scenario
from boresight.experiments.simulate import simulate as simulate
from boresight.interfaces.converting import convert as convert
from boresight.interfaces.python import inspect as inspect
from boresight.interfaces.python import read as read
from boresight.interfaces.python import report as report
from boresight.interfaces.python import run as run
from boresight.interfaces.python import smooth as smooth
from boresight.interfaces.python import stream as stream
from boresight.interfaces.python import track as track
from boresight.maths.frames import Site as Site
from boresight.maths.gaussian import Gaussian as Gaussian
from boresight.models.atmosphere import EffectiveEarth as EffectiveEarth
from boresight.models.atmosphere import ExponentialAtmosphere as ExponentialAtmosphere
from boresight.models.atmosphere import NoAtmosphere as NoAtmosphere
from boresight.models.coordinates import CartesianPlots as CartesianPlots
from boresight.models.coordinates import PositionSensor as PositionSensor
from boresight.models.motion import ConstantAcceleration as ConstantAcceleration
from boresight.models.motion import ConstantVelocity as ConstantVelocity
from boresight.models.motion import CoordinatedTurn as CoordinatedTurn
from boresight.models.motion import SphericalUnitRate as SphericalUnitRate
from boresight.models.motion import Static as Static
from boresight.models.motion import WithHeightOffset as WithHeightOffset
from boresight.models.polar import Given as Given
from boresight.models.sensors import Bearings as Bearings
from boresight.models.sensors import Pose as Pose
from boresight.models.sensors import Radar as Radar

__version__: str
