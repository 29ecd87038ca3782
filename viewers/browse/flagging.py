"""Sets episodes of a list aside, or takes them back."""

from tacdata import provenance
from tacdata.dataset.flags import clear_flag, set_flag
from tacdata.viewers.browse.episode_list import Entry, EpisodeList


def flag_episode(listed: EpisodeList, number: int, reason: str) -> str:
    """Set an episode aside and return its name with the reason.

    Raises:
        UsageError: If there is no such episode, or no reason.
        DeviceError: If the disk refuses it.
    """
    entry = listed.numbered(number)
    flag = set_flag(listed.root, recording_of(listed, entry), entry.file, reason)
    return f"{entry.file or number}: {flag.reason}"


def unflag_episode(listed: EpisodeList, number: int) -> str:
    """Take an episode back and return its name.

    Raises:
        UsageError: If there is no such episode.
    """
    entry = listed.numbered(number)
    clear_flag(listed.root, recording_of(listed, entry))
    return entry.file or str(number)


def recording_of(listed: EpisodeList, entry: Entry) -> str:
    """Return the recording's hash; an episode that lost its record has one made of its dataset and number."""
    if entry.recording:
        return entry.recording
    path = listed.root / entry.file
    if entry.file and path.is_file():
        return provenance.file_hash(path)
    return provenance.content_hash([str(listed.root.resolve()), entry.number])
