"""What may be true of a hidden world. Written apart from the library it is to test: time-stepped, other forms.

Every effect is a function of (world, size) that changes the world at its stage. Size 1 is what a lab would not be
surprised by.
"""

import numpy as np
import skin

DT = 1.0 / 240


def step_memory(u, gap, tau):
    """First-order follower, implicit Euler; ``gap`` is the time to the row before."""
    y = np.zeros_like(u)
    a = gap / (tau + gap)
    last = np.zeros(u.shape[1:])
    for i in range(len(u)):
        last = last + a[i] * (u[i] - last)
        y[i] = last
    return y


# kinematics ------------------------------------------------------------------------------------------------------
def z_offset(w, s):
    """Touch-off was wrong."""
    w.pose[:, 2] += 0.05 * s


def xy_offset(w, s):
    """The sensor lies aside."""
    a = w.rng.uniform(0, 2 * np.pi)
    w.pose[:, :2] += 0.15 * s * np.array([np.cos(a), np.sin(a)])


def tilt(w, s):
    """The face is a slope."""
    a = w.rng.uniform(0, 2 * np.pi)
    w.pose[:, 2] += 0.012 * s * (w.pose[:, 0] * np.cos(a) + w.pose[:, 1] * np.sin(a))


def backlash(w, s):
    """A nut with clearance and a slightly elastic flank."""
    b, out, at = 0.04 * s, w.pose[:, 2].copy(), w.pose[0, 2]
    for i, z in enumerate(w.pose[:, 2]):
        if z - at > 0:
            at += (z - at) if z - at < 1e-4 else min(z - at, 1.0)
        elif at - z > b:
            at = z + b
        out[i] = at
    w.pose[:, 2] = out


def frame_compliance(w, s):
    """Series spring, solved by bisection."""
    c = 0.15 * s  # mm/N
    r = w.radius
    low, high = w.pose[:, 2] - 1.5, w.pose[:, 2].copy()
    for _ in range(40):
        middle = 0.5 * (low + high)
        over = middle + c * skin.force(middle, r, w.layer) > w.pose[:, 2]
        high, low = np.where(over, middle, high), np.where(over, low, middle)
    w.pose[:, 2] = 0.5 * (low + high)


def lost_steps(w, s):
    """From 45 % of the session on."""
    w.pose[w.episode > 0.45 * w.episode.max(), 2] -= 0.05 * s


def thermal_growth(w, s):
    """Hyperbolic in time."""
    w.pose[:, 2] += 0.05 * s * (w.clock / (w.clock + 250.0))


def servo_lag(w, s):
    """Second-order follower, damping 0.9."""
    omega, at, speed = 2 / (0.06 * s), w.pose[0, 2], 0.0
    for i, z in enumerate(w.pose[:, 2].copy()):
        if w.fresh[i]:
            at, speed = z, 0.0
        for _ in range(4):
            speed += DT / 4 * (omega**2 * (z - at) - 1.8 * omega * speed)
            at += DT / 4 * speed
        w.pose[i, 2] = at


# skin ------------------------------------------------------------------------------------------------------------
def relaxation(w, s):
    """Two Maxwell branches a factor 3 apart."""
    tau = 10 ** w.rng.uniform(-0.3, 1.0)
    f = 0.10 * s
    slow = 0.6 * step_memory(w.load, w.gap, tau) + 0.4 * step_memory(w.load, w.gap, 3 * tau)
    w.load = w.load - f * slow


def softening(w, s):
    """Damage that grows with the largest depth at a place, healed nowhere."""
    most = {}
    for i in range(len(w.load)):
        key = w.site[i]
        d = max(w.pose[i, 2], 0.0)
        most[key] = max(most.get(key, 0.0), d)
        if d < most[key]:
            w.load[i] *= 1 - 0.10 * s * (1 - np.exp(-((most[key] ** 2 - d**2) / 0.15)))


def hysteresis(w, s):
    """Bouc-Wen: z' = F' (1 - |z|^1 (b sgn(F' z) + 1 - b)) / width."""
    f = skin.force(w.pose[:, 2], w.radius, w.layer)
    z, width, out = 0.0, 0.12 * f.max(), np.zeros_like(f)
    for i in range(1, len(f)):
        df = (f[i] - f[i - 1]) / width
        z += df * (1 - abs(z) * (0.5 * np.sign(df * z) + 0.5))
        z = float(np.clip(z, -1, 1))
        out[i] = z
        if f[i] <= 0:
            z = 0.0
    share = np.minimum(f, width) / width
    w.load = w.load * (1 + 0.08 * s * (out - 1) * share)[:, None]


def modulus(w, s):
    """Stiffer throughout."""
    w.load = w.load * (1 + 0.12 * s)


def thickness(w, s):
    """A thinner layer, loads anew."""
    w.layer = w.layer * (1 - 0.06 * s)


def adhesion(w, s):
    """Pull-off patch that lets go at a depth below zero."""
    touched, w_ = False, 0.12
    pattern = skin.loads(w.pose[:, 0], w.pose[:, 1], np.full(len(w.load), 0.1), w.radius, w.layer)
    for i in range(1, len(w.load)):
        d = w.pose[i, 2]
        if w.fresh[i]:
            touched = False
        touched |= d > 0.05
        if touched and d < w.pose[i - 1, 2] and d > -w_ and d < 2 * w_:
            shape = 1 - ((d - 0.04) / (0.04 + w_)) ** 2 if d < 0.04 else np.exp(-(d - 0.04) / 0.08)
            w.load[i] -= 0.5 * s * pattern[i] * shape


# taxel and readout -----------------------------------------------------------------------------------------------
def gain(w, s):
    """All channels."""
    w.rise = w.rise * (1 + 0.12 * s)


def channel_gain(w, s):
    """Half to whole of 20 % up or down."""
    w.rise = w.rise * (1 + 0.2 * s * w.rng.choice([-1, 1], w.rise.shape[1]) * w.rng.uniform(0.5, 1, w.rise.shape[1]))


def saturation(w, s):
    """Hyperbolic tangent."""
    top = w.rise.max() / (0.35 * np.sqrt(s))
    w.rise = top * np.tanh(w.rise / top)


def gap_curvature(w, s):
    """A gap that closes."""
    w.rise = w.rise / (1 - 0.10 * s * w.rise / w.rise.max() / (1 + 0.1 * s))


def low_pass_filter(w, s):
    """A single-pole IIR at a fixed rate, as firmware has it."""
    w.rise = step_memory(w.rise, np.minimum(w.gap, DT), 0.05 * s)


def crosstalk(w, s):
    """Next in number."""
    k = 0.025 * s
    side = np.zeros_like(w.rise)
    side[:, 1:] += w.rise[:, :-1]
    side[:, :-1] += w.rise[:, 1:]
    w.rise = (w.rise + k * side) / (1 + 0.0 * k)


def drift(w, s):
    """Nearly linear, each channel its own."""
    rate = w.rng.normal(0, 1, w.rise.shape[1])
    t = w.clock / w.clock[-1]
    w.rise = w.rise + 20.0 * s * (t + 0.15 * np.sin(3 * t))[:, None] * rate


def gain_drift(w, s):
    """As the root of time."""
    w.rise = w.rise * (1 - 0.08 * s * np.sqrt(w.clock / w.clock[-1]))[:, None]


def baseline_tracking(w, s):
    """Steps at 10 Hz towards the reading, as a touch chip does."""
    base, every = np.zeros(w.rise.shape[1]), 24
    for i in range(len(w.rise)):
        raw = w.rise[i].copy()
        n = max(round(w.gap[i] / (DT * every)), 1) if w.fresh[i] else int(i % every == 0)
        if n:
            base += (1 - (1 - 0.02 * s * DT * every) ** n) * (raw - base)
        w.rise[i] = raw - base


def latency(w, s):
    """Constant."""
    w.delay = w.delay + 0.04 * s


def clock_skew(w, s):
    """Grows through the session."""
    w.delay = w.delay + 0.12 * s * (w.clock / w.clock[-1] - 0.5)


def scan_skew(w, s):
    """Linear in the channel."""
    w.scan = w.scan + 0.05 * s


# what no library holds -------------------------------------------------------------------------------------------
def viscous_gain(w, s):
    """Loads rise with the rate of pressing, as its square root."""
    v = np.gradient(w.pose[:, 2]) / DT
    v[w.fresh] = 0
    w.load = w.load * (1 + 0.06 * s * np.sign(v) * np.sqrt(np.abs(v)))[:, None]


def telegraph(w, s):
    """Channels jump between two levels at random."""
    for c in range(w.rise.shape[1]):
        level, flip = 0, np.flatnonzero(w.rng.random(len(w.rise)) < DT / 6.0)
        edges = np.split(np.arange(len(w.rise)), flip)
        for rows in edges:
            w.rise[rows, c] += 12.0 * s * level
            level = 1 - level


def cable_pull(w, s):
    """The cable's loop moves the offsets with the height of the carriage, each channel its own way, late."""
    slow = step_memory(w.pose[:, 2:3], w.gap, 0.5)
    w.rise = w.rise + 25 * s * (w.pose[:, 2:3] - slow) * w.rng.normal(0, 1, w.rise.shape[1])


def stick_slip(w, s):
    """Friction lets go in jumps: a saw tooth on loading that differs from press to press."""
    f = skin.force(w.pose[:, 2], w.radius, w.layer)
    phase = np.cumsum(np.where(w.fresh, w.rng.random(len(f)) * 3, np.abs(np.gradient(w.pose[:, 2])) / 0.13))
    w.load = w.load * (1 + 0.05 * s * ((phase % 1.0) - 0.5) * (f > 0))[:, None]


def ageing_creep(w, s):
    """Relaxation that speeds up through the session."""
    tau = 6.0 * np.exp(-2.5 * w.clock / w.clock[-1])
    y, last = np.zeros_like(w.load), np.zeros(w.load.shape[1])
    for i in range(len(w.load)):
        last = last + w.gap[i] / (tau[i] + w.gap[i]) * (w.load[i] - last)
        y[i] = last
    w.load = w.load - 0.12 * s * (w.clock / w.clock[-1])[:, None] * y


def lost_and_found(w, s):
    """Steps are lost in one stretch and come back by homing."""
    share = w.clock / w.clock[-1]
    w.pose[(share > 0.35) & (share < 0.6), 2] -= 0.05 * s


KINEMATICS = (
    z_offset, xy_offset, tilt, backlash, lost_steps, thermal_growth, servo_lag, lost_and_found, frame_compliance,
)  # fmt: skip
LAYER = (thickness,)
MATERIAL = (relaxation, softening, hysteresis, modulus, adhesion, viscous_gain, stick_slip, ageing_creep)
READOUT = (gain, channel_gain, saturation, gap_curvature, low_pass_filter, crosstalk, drift, gain_drift,
           baseline_tracking, telegraph, cable_pull)
TIMING = (latency, clock_skew, scan_skew)
OUTSIDE = ("viscous_gain", "telegraph", "cable_pull", "stick_slip", "ageing_creep", "lost_and_found")
KNOWN = {f.__name__: f for f in (*KINEMATICS, *LAYER, *MATERIAL, *READOUT, *TIMING)}
