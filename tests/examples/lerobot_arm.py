"""A robot without hardware for `lerobot-record`: two joints, two cameras of noise, and hands that lead it."""

from dataclasses import dataclass

import numpy as np
from lerobot.robots.config import RobotConfig
from lerobot.robots.robot import Robot
from lerobot.teleoperators.config import TeleoperatorConfig
from lerobot.teleoperators.teleoperator import Teleoperator

JOINTS = {"shoulder.pos": float, "elbow.pos": float}


@RobotConfig.register_subclass("still_arm")
@dataclass(kw_only=True)
class StillArmConfig(RobotConfig):
    pixels: int = 64


@TeleoperatorConfig.register_subclass("still_hand")
@dataclass(kw_only=True)
class StillHandConfig(TeleoperatorConfig):
    pass


class Still:
    is_connected = False
    is_calibrated = True

    def calibrate(self):
        pass

    def configure(self):
        pass

    def connect(self, calibrate=True):
        self.is_connected = True

    def disconnect(self):
        self.is_connected = False


class StillArm(Still, Robot):
    config_class, name = StillArmConfig, "still_arm"

    def __init__(self, config):
        super().__init__(config)
        self.cameras = {"left": None, "right": None}
        shape = (config.pixels, config.pixels, 3)
        self.observation_features = {**JOINTS, **dict.fromkeys(self.cameras, shape)}
        self.action_features = JOINTS
        self._image = np.random.default_rng(0).integers(0, 255, shape, np.uint8)

    observation_features = action_features = None

    def get_observation(self):
        return {**dict.fromkeys(JOINTS, 0.5), **dict.fromkeys(self.cameras, self._image)}

    def send_action(self, action):
        return action


class StillHand(Still, Teleoperator):
    config_class, name = StillHandConfig, "still_hand"
    action_features, feedback_features = JOINTS, {}

    def get_action(self):
        return dict.fromkeys(JOINTS, 0.5)

    def send_feedback(self, feedback):
        pass
