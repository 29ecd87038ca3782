"""The role of each column of a foreign table, by its name, its unit and its values."""

import re

import numpy as np

from tacdata.errors import FormatError
from tacdata.importing.mapping import SourceClock
from tacdata.importing.proposing.shapes import are_letters, drive_by_shape, without_signal
from tacdata.importing.source_table import SourceTable
from tacdata.importing.times import times
from tacdata.importing.units import OTHERS, plain, quantity_of, split_unit

BODY = r"(pos(ition)?|loc(ation)?|stage|tcp|tip|tool|ee|robot|probe|indenter|actual|trans(lation)?)"
"""Bodies whose coordinates a column may hold."""
GUESSES = {
    "time": (
        r"(x_value|time|t|ts|utc|gmt|timestamp|stamp|zeit|clock|datetime|date|datum|uhrzeit|elapsed|tiempo|temps|tempo|zaman|时间|時間)"
        r"([_ ]?(time|zeit|uhrzeit))?|((realtime|sys(tem)?)_?)?ticks?|\w+_(time_?)?stamp(_(ns|us|ms|s|sec))?"
    ),
    "depth": (
        r"(depth|indentation|displacement|disp|travel|stroke|extension|crosshead|((present|actual|measured)_)?pos(ition)?"
        r"|(traversen|verfahr)?weg|eindringtiefe|d|dist(ance)?|desplazamiento|d[eé]placement|spostamento|uzama|位移|変位)"
    ),
    "set_point": (
        r"set_?point|(set|target|cmd|command(ed)?|desired|demand(ed)?|ref(erence)?)_?"
        r"(pos(ition)?|depth|disp(lacement)?|z)|(pos(ition)?|depth|p?_?z)_?(set|target|cmd|ref)"
    ),
    "error": r"((pos(ition)?|tracking|following|control|depth|z)_?)?(error|err|deviation)",
    "x": rf"({BODY}[_.]?)?x|p_?x|x_?{BODY}|(actual_)?tcp_pose_?0",
    "y": rf"({BODY}[_.]?)?y|p_?y|y_?{BODY}|(actual_)?tcp_pose_?1",
    "z": rf"({BODY}[_.]?)?z|p_?z(_?(meas(ured)?|act(ual)?|ist))?|z_?{BODY}|height|(actual_)?tcp_pose_?2",
    "force": (
        r"(f|fz|fn|force(_?z)?|load(_?cell)?|weight|kraft|kuvvet|normal_?force|force_?[xyz]|f[xy]|力|荷重|载荷)"
        r"|(actual_)?tcp_force_?[0-2]"
    ),
    "torque": r"(torque|moment)(_?[xyz])?|tau_?[xyz]|drehmoment|(actual_)?tcp_force_?[3-5]",
    "temperature": r"(temp(erature)?(_?\w{1,4})?|t_?amb)",
    "trial": r"(trial|run|cycle|episode|press|repeat|rep|test|versuch|zyklus|element)(_?(id|no|nr|number))?",
    "specimen": (
        r"(specimen|material|coupon|silicone|elastomer|werkstoff|probe)(_?(id|no|nr|number|name))?"
        r"|sample_?(id|no|nr|number|name)"
    ),
    "counter": (
        r"(counter|frame|seq(uence)?|sample|index|n|row|line|iter(ation)?|loop|packet)(_?(id|no|nr|number|count))?|no|nr"
    ),
    "number": r"(channel|ch|taxel|sensor)(_?(id|no|nr|number|index))?",
    "value": r"(value|val|reading|wert)",
    "setting": (
        r"((set_?|target_?)?(speed|velocity|vel|feed_?rate|geschwindigkeit))"
        r"|(set|target|goal|cmd|demand|desired|commanded)_\w+|\w+_(limit|target|set)|gain|k[pid]|(\w+_)?actions?"
    ),
    "state": (
        r"(segment|segm|state|status|moving|flag|block|mode|phase|enabled?|valid)(_?(id|no|nr|number|index))?"
        r"|(rel(ative)?_)?humidity|rh|rssi|snr|signal_strength|(barometric|air|ambient)_pressure|dew_?point"
        r"|(\w+_)?(flag|fault|alarm|warning|status|state|error(_code)?)|is_\w+|battery\w*|cpu\w*"
        r"|present_(velocity|current|pwm|load|temperature|input_voltage)"
    ),
    "orientation": r"(rot(ation)?|quat(ernion)?|orientation|q)_?[xyzw]|roll|pitch|yaw",
    "joint": (
        r"(joint|axis|q)_?\d(_?(pos(ition)?|angle|vel(ocity)?|torque|effort))?"
        r"|actual_(qd{0,2}|current|moment|tcp_\w+|joint_\w+)_?\d"
    ),
    "motion": r"((linear|angular)(_(velocity|acceleration|speed))?|velocity)_[xyz]",
    "derived": (
        r"((true|eng(ineering)?|nominal|tensile|compressive|shear)_?)?(stress|spannung)"
        r"|grad(ient)?|derivative|slope|rms|std(_?dev)?|variance|r_?(2|squared)"
    ),
    "strain": (
        r"((true|eng(ineering)?|nominal|axial|tensile|compressive|compression|shear|hencky|log(arithmic)?|applied)_?)?"
        r"(strain|stretch|elongation|dehnung|stauchung)(_?ratio)?"
    ),
    "angle": r"((rotary|joint|motor)_?)?(enc(oder)?|angle)(_?(pos(ition)?|counts?|ticks?))?",
}
"""Meaning of a column by its name without the unit."""
PLACE = r"(pos(ition)?s?|pose|xyz|(tip|tcp|probe|indenter|stage|eef?|end_?effector|robot)(_?pos(e|ition)?)?)"
"""Name of an array whose first three columns are a place."""
PARTS = (3, 6, 7)
"""Columns of a place, and of a place with an orientation."""
WRENCH = r"wrench|f(orce)?_?(/|_|and)?_?t(orque)?|force_?torque|(\w+_)?(ft|wrench)_?(sensor|data)?"
"""Name of an array whose first three columns are a force, and the others a torque."""
TORQUE = re.compile(
    r"[kmucn]?N[ .*\u00b7\u22c5-]?[mc]?m|(in|ft)[ .*\u00b7-]?(lbf?|ozf?)|(lbf?|ozf?)[ .*\u00b7-]?(in|ft)"
)
"""Units of torques."""
GAUGE = r"lvdt|laser|gauge|extensometer|encoder|true|actual|measured"
"""Words that mark a length as measured, in addition to the commanded one."""
COMMAND = r"(?<![a-z])(set|target|cmd|command(ed)?|desired|demand(ed)?|soll)(?![a-z])|set_?point|sollw"
"""Words that mark a length as commanded, which the machine may not have reached."""
DEGREES = ("degc", "c", "k", "degf")
ROWS = 50
"""Rows of a text column that are tried as times."""
EVEN = 1e-4
"""Steps that scatter by less are uniform [step]."""
NO_PLACE = (
    r"\w*(force|torque|moment|wrench|orientation|rotation|quat(ernion)?|linear|angular|velocity|acceleration|gyro|imu)"
    r"|(mag\w*|taxel|cell|pad|sensor)_?\d*"
)
"""What has axes and is no place, in the path of a name."""
ROBOT = re.compile(r"\W*(?:axis|joint)\w*\.[aej]?(\d)|\W*pose?(?:_\w+)?\.[abc]")
"""Joints and angles of robots, as $AXIS_ACT.A1 and $POS_ACT.A."""
AGAIN = tuple(map(re.compile, (r"(.+?)\.\d+", r"(.+?)[ _-]?[(#]?\d+\)?", r".+ (\S+)")))
"""A name that comes again, as pandas numbers it, as people do, and below the name of its trial."""
NAMED = re.compile(r"_?(id|no|nr|number|index)$")
"""Ends of names of columns that number things, and so read nothing."""


def roles_of(table: SourceTable) -> dict[str, list[str]]:
    """Return the columns of each role; ``channels`` are those of no other."""
    roles: dict[str, list[str]] = {"channels": []}
    later = later_blocks(table)
    lettered, numbered = are_letters(list(table.columns)), _numbered(list(table.columns))
    for name, values in table.columns.items():
        if name in later or (values.dtype.kind == "f" and np.isnan(values).all()):
            continue  # a comma at the end of each row makes an empty one
        role = None if lettered and values.dtype != object else numbered.get(name) or _role(table, name, values)
        if role in ("place", "wrench"):
            parts = "xyz" if role == "place" else ("force",) * 3 + ("torque",) * 3
            for number, part in enumerate(parts):
                roles.setdefault(part, []).append(f"{name}[{number}]")
        elif role is None and values.dtype != object:
            roles["channels"].append(name)
        elif role:
            roles.setdefault(role, []).append(name)
    roles["depth"] = sorted(roles.get("depth", []), key=_rank)
    if not roles["depth"]:
        del roles["depth"]
        if "x" in roles and not {"y", "z"} & set(roles):
            # One axis only: it is the one that presses.
            roles["depth"] = roles.pop("x")
    if "time" not in roles and table.columns and not any(re.search(r"[A-Za-z]", name) for name in table.columns):
        _most_evenly_rising(table, roles)
    if not roles.get("time") and len(whole := [name for name in table.columns if name != "trial"]) == 1:
        _first_rising_inside(table, whole[0], roles)
    if not roles.get("time"):
        _evenly_rising(table, roles)
    if not ("number" in roles and "value" in roles):
        # Without a column that numbers channels a value is a channel, and the other way round.
        unnumbered = [name for name in roles.pop("number", []) if not NAMED.search(name.lower())]
        roles["channels"] += roles.pop("value", []) + unnumbered
    if idle := without_signal(table, roles["channels"], forced="force" in roles):
        roles["idle"] = list(idle)
        roles["channels"] = [name for name in roles["channels"] if name not in idle]
    if not {"depth", "z"} & set(roles):
        _drive(table, roles)
    _set_for_each_trial(table, roles)
    if not roles["channels"] and "force" not in roles:
        roles["channels"] = roles.pop("strain", []) + roles.pop("angle", [])
    if "time" in roles and f"{roles['time'][0]}'" in table.columns:
        # Blocks of several trials are placed next to each other: each name comes again.
        roles = {role: [name for name in names if not name.endswith("'")] for role, names in roles.items()}
    return roles


def _numbered(names: list[str]) -> dict[str, str]:
    """Return the roles of columns that are an array's, each with its number, as pos_1 to pos_3 or FT[0] to FT[5]."""
    arrays: dict[str, list[str]] = {}
    for name in names:
        if match := re.fullmatch(r"(.+?)[_.]?[\[(]?\d[\])]?", name):
            arrays.setdefault(bare_name(match[1]), []).append(name)
    roles: dict[str, str] = {}
    for array, parts in arrays.items():
        if len(parts) in PARTS and re.fullmatch(PLACE, array):
            roles |= dict(zip(parts, ("x", "y", "z", *["orientation"] * 4), strict=False))
        elif len(parts) == 6 and re.fullmatch(WRENCH, array):
            roles |= dict(zip(parts, (*["force"] * 3, *["torque"] * 3), strict=True))
    return roles


def later_blocks(table: SourceTable) -> frozenset[str]:
    """Return the columns of all blocks but the first, where each name, the clock's too, comes again with a number.

    So it is with trials side by side: t, depth, t.1, depth.1, or t_1, depth_1, t_2, depth_2, or A t, A depth, B t.
    """
    filled = [name for name, values in table.columns.items() if values.dtype.kind != "f" or not np.isnan(values).all()]
    for pattern in AGAIN:
        blocks: dict[str, list[str]] = {}
        for name in filled:
            match = pattern.fullmatch(name if pattern is AGAIN[0] else split_unit(name)[0])
            blocks.setdefault(match[1] if match else name, []).append(name)
        times_given = {len(names) for names in blocks.values()}
        words = {base: [bare_name(base), *bare_name(base).split("_")] for base in blocks}
        clocks = [base for base in blocks if any(re.fullmatch(GUESSES["time"], word) for word in words[base])]
        if clocks and len(blocks) > 1 and len(times_given) == 1 and times_given != {1}:
            return frozenset(name for names in blocks.values() for name in names[1:])
    return frozenset()


def _drive(table: SourceTable, roles: dict[str, list[str]]) -> None:
    """Find the position where no name states it: a set point, or the column whose shape is that of a drive."""
    if "set_point" in roles:
        roles["depth"] = roles["set_point"][:1]
    elif not {"strain", "angle", "force"} & set(roles) and (name := drive_by_shape(table, roles["channels"])):
        roles["depth"] = roles["by_shape"] = [name]
        roles["channels"].remove(name)


def is_whole(roles: dict[str, list[str]]) -> bool:
    """Return whether a file holds its own position and readings, so that it is a trial by itself."""
    return ("depth" in roles or "z" in roles) and bool(roles["channels"] or "force" in roles)


def bare_name(name: str) -> str:
    """Return a column's name without its unit and path, in small letters: "stage.posZ [mm]" is pos_z.

    An axis of what is no place has its name in front: force.z is force_z.
    """
    path = re.split(r"[./]" if name.startswith("/") else r"\.", name.rstrip("."))
    bare, _ = split_unit(path[-1])
    if len(path) > 1 and bare in "xyzw" and re.fullmatch(NO_PLACE, path[-2].lower()):
        bare = f"{path[-2]}_{bare}"
    if match := ROBOT.fullmatch(name.lower()):
        bare = f"joint_{match[1]}" if match[1] else "yaw"
    return re.sub(r"[\s-]+", "_", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", bare).lower()).strip("_")


def _role(table: SourceTable, name: str, values: np.ndarray) -> str | None:
    bare, inside = bare_name(name), split_unit(name.rsplit(".", 1)[-1])[1]
    if values.ndim == 2 and values.shape[1] in PARTS and re.fullmatch(PLACE, bare):
        return "place"
    if values.ndim == 2 and values.shape[1] == 6 and re.fullmatch(WRENCH, bare):
        return "wrench"
    role = next((role for role, pattern in GUESSES.items() if re.fullmatch(pattern, bare)), None)
    unit_text = plain(table.units.get(name) or inside)
    unit = quantity_of(unit_text)
    if unit_text.lower() in DEGREES:
        return "temperature"
    if TORQUE.fullmatch(unit_text):
        return "torque"
    # "t" or "d" with the unit of another quantity, as V, is no time and no depth.
    is_other = values.dtype != object and not unit and unit_text.lower() in OTHERS
    if is_other and role != "force" and (role == "time" or len(bare) == 1):
        role = None
    # R2 is a resistance next to R1, Tx a torque next to Fx, and X a count of rows where it rises by 1.
    if bare in ("r2", "r_2") and {"r1", "r_1", "r3", "r_3"} & set(map(bare_name, table.columns)):
        role = None
    if re.fullmatch("[tm][xyz]", bare) and f"f{bare[1]}" in map(bare_name, table.columns):
        role = "torque"
    if role == "x" and values.dtype != object and values.ndim == 1 and (np.diff(values) == 1).all():
        role = "counter"
    elif role == "counter" and values.dtype == object:
        role = None
    role = {"N": "force", "s": "time"}.get(unit or "", role)
    if role is None and len(bare) > 1 and quantity_of(bare) == "s":
        return "time"  # "ms", "seconds"
    if role is None and values.dtype == object and _are_times(table, name):
        return "time"
    if role == "error" and unit != "mm" and (unit or bare in ("error", "err")):
        role = "state"
    if role in ("angle", "joint") and unit == "mm":
        return "depth"
    return {"mm": "depth", "deg": "angle"}.get(unit or "") if role is None else role


def _rank(name: str) -> tuple[bool, bool, bool]:
    """Return a length's place: depths first, then other lengths, gauges, and commands last."""
    bare = re.sub(r"\s+", "_", split_unit(name)[0].lower())
    return (
        bool(re.search(COMMAND, name.lower())),
        bool(re.search(GAUGE, name.lower())),
        not re.fullmatch(GUESSES["depth"], bare),
    )


def _are_times(table: SourceTable, name: str) -> bool:
    """Return whether a column of text holds dates or times of day, in one way or in several."""
    first = SourceTable(table.path, {name: table.columns[name][:ROWS]}, table.units)
    try:
        times(first, SourceClock(column=name), "")
    except FormatError as error:
        return "can be read as" in error.given
    return True


def _most_evenly_rising(table: SourceTable, roles: dict[str, list[str]]) -> None:
    """Tell the time of a file without a header: on a way in, readings and depths rise as well, but less evenly."""
    rising = {}
    for name in roles["channels"]:
        steps = np.diff(table.columns[name])
        if len(steps) and (steps >= 0).all() and (steps > 0).mean() > 0.5:  # a row of places is constant over many rows
            usual = float(np.median(steps))
            rising[name] = float(np.median(np.abs(steps - usual))) / usual if usual > 0 else np.inf
    if rising:
        limit = max(EVEN, 2 * min(rising.values()))
        roles["time"] = [next(name for name, spread in rising.items() if spread <= limit)]
        roles["channels"].remove(roles["time"][0])


def _first_rising_inside(table: SourceTable, name: str, roles: dict[str, list[str]]) -> None:
    """Find the time of an array without names: its first column that only rises inside a trial."""
    columns = [f"{name}[{k}]" for k in range(table.inner(name))]
    trial = table.columns.get("trial", np.zeros(table.rows))
    inside = np.diff(trial) == 0
    steps = [np.diff(table.column(column))[inside] for column in columns]
    rising = next((k for k, step in enumerate(steps) if (step >= 0).all() and (step > 0).mean() > 0.5), None)
    if rising is not None:
        roles["time"] = [columns.pop(rising)]
        roles["channels"] = columns


def _evenly_rising(table: SourceTable, roles: dict[str, list[str]]) -> None:
    """Tell the time by its even steps, whatever it is called; no path rises throughout."""
    candidates: list[str] = []
    for name in roles["channels"]:
        values = table.columns.get(name)
        if values is None or values.ndim > 1 or len(values) < ROWS:
            continue
        steps = np.diff(values.astype(float))
        usual = float(np.median(steps))
        if usual > 0 and (np.abs(steps - usual) < 0.5 * usual).all():
            candidates.append(name)
    if candidates:
        roles["time"] = roles["by_values"] = candidates[:1]
        roles["channels"] = [name for name in roles["channels"] if name not in candidates]


def _set_for_each_trial(table: SourceTable, roles: dict[str, list[str]]) -> None:
    """Take columns that stand still in each trial, and differ between trials, from the channels: they are set."""
    if not roles.get("trial"):
        return
    _, trial = np.unique(table.column(roles["trial"][0]).astype(str), return_inverse=True)
    order = np.argsort(trial, kind="stable")
    same = np.diff(trial[order]) == 0
    for role in ("channels", "depth", "z"):
        for name in list(roles.get(role, [])):
            values = table.column(name)[order]
            steps = np.diff(values, axis=0)
            if values.ndim == 1 and same.any() and not steps[same].any() and steps[~same].any():
                roles[role].remove(name)
                roles.setdefault("setting", []).append(name)
        if role != "channels" and not roles.get(role):
            roles.pop(role, None)
