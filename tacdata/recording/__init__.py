"""Records presses: one MCAP file per episode, and back to arrays."""

from tacdata.recording.episode import PHASES, Episode
from tacdata.recording.files.reader import read_episode
from tacdata.recording.session import Session, read_session

__all__ = ["PHASES", "Episode", "Session", "read_episode", "read_session"]
