"""Touch beside any LeRobot robot: taxel boards at the dataset's rate, and every sample at its own rate."""

from lerobot_robot_tacdata.config_tacdata import BoardConfig, TacdataRobotConfig
from lerobot_robot_tacdata.samples import Samples, samples
from lerobot_robot_tacdata.tacdata_robot import TacdataRobot

__all__ = ["BoardConfig", "Samples", "TacdataRobot", "TacdataRobotConfig", "samples"]
