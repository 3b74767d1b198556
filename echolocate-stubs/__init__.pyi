# The types of `echolocate.py`, installed as the package `echolocate-stubs`: a single module cannot carry `py.typed`.

from config.load import load_mission as load_mission
from config.load import load_model as load_model
from config.load import load_robot as load_robot
from config.load import load_settings as load_settings
from config.load import load_world as load_world
from drivers.messages import Firing as Firing
from drivers.messages import Pose as Pose
from perception.detected_object import DetectedObject as DetectedObject
from perception.polyline import Polyline as Polyline
from perception.recogniser import Recogniser as Recogniser
from runtime.recording.ring_log import read_ring_log as read_ring_log
from runtime.recording.ring_log_rows import write_ring_log as write_ring_log
from runtime.simulation.closed_loop import SimulationResult as SimulationResult
from runtime.simulation.closed_loop import simulate as simulate
from runtime.simulation.random_halls import random_hall as random_hall
