"""Effects of the skin's material. ``w.load`` holds the loads of the protrusions and, last, the force [N]."""

import numpy as np

from worlds import skin
from worlds.follow import late
from worlds.hidden import hidden


@hidden("layer", "amplitude", most=4, both=True)
def thickness(w, s):
    """A thinner layer: loads are computed again."""
    w.layer *= 1 - 0.06 * s


@hidden("skin", "hold time", fitted=True, most=6)
def relaxation(w, s):
    """Two Maxwell branches a factor 3 apart."""
    tau = 10 ** w.rng.uniform(-0.3, 1.0)
    w.load = w.load - 0.10 * s * (0.6 * late(w.load, w, tau) + 0.4 * late(w.load, w, 3 * tau))


@hidden("skin", "hold time", called=("relaxation",), fitted=True, most=6)
def nonlinear_relaxation(w, s):
    """The deeper the press, the larger the share that relaxes."""
    tau = 10 ** w.rng.uniform(-0.2, 0.9)
    share = np.clip(w.pose[:, 2:3], 0, None) / 1.0
    w.load = w.load - 0.12 * s * late(w.load * share, w, tau)


@hidden("skin", "hold time", called=("creep", "relaxation"), fitted=True, most=6)
def creep(w, s):
    """A share follows late, by two Kelvin elements."""
    tau = 10 ** w.rng.uniform(0.0, 0.9)
    follow = 0.7 * late(w.load, w, tau) + 0.3 * late(w.load, w, 4 * tau)
    w.load = w.load - 0.12 * s * (w.load - follow)


@hidden("skin", "loading and unloading", called=("viscosity",), fitted=True, most=6)
def viscous_gain(w, s):
    """Loads rise with the rate of pressing, as its square root."""
    v = np.gradient(w.pose[:, 2]) / w.step
    v[w.fresh] = 0
    w.load = w.load * (1 + 0.06 * s * np.sign(v) * np.sqrt(np.abs(np.clip(v, -4, 4))))[:, None]


@hidden("skin", "hold time", fitted=True, most=6)
def poroelasticity(w, s):
    """Fluid leaves the contact: the time goes with the area under the tip, two modes of diffusion."""
    out = w.load.copy()
    for radius in np.unique(w.radius):
        own = w.load * (w.radius == radius)[:, None]
        tau = 2.0 * (radius / 3.0) ** 2 * 2.0
        out -= 0.12 * s * (0.8 * late(own, w, tau) + 0.2 * late(own, w, tau / 9))
    w.load = out


@hidden("skin", "loading and unloading", fitted=True, most=6)
def softening(w, s):
    """Damage grows with the largest depth at a place and heals nowhere."""
    most, depth = np.zeros(w.site.max() + 1), np.maximum(w.pose[:, 2], 0.0)
    reached = np.empty(len(depth))
    for rows in w.presses:
        place = w.site[rows[0]]
        reached[rows] = np.maximum(np.maximum.accumulate(depth[rows]), most[place])
        most[place] = reached[rows[-1]]
    w.load = w.load * (1 - 0.10 * s * -np.expm1(-(reached**2 - depth**2) / 0.15))[:, None]


@hidden("skin", "loading and unloading", called=("softening",), fitted=True, most=6)
def wear_in(w, s):
    """Every press at a place takes a hyperbolic share."""
    seen, factor = np.zeros(w.site.max() + 1), np.empty(len(w.load))
    for rows in w.presses:
        k = seen[w.site[rows[0]]]
        factor[rows] = 1 - 0.08 * s * k / (k + 3.0)
        seen[w.site[rows[0]]] += 1
    w.load = w.load * factor[:, None]


@hidden("skin", "loading and unloading", fitted=True, most=5)
def hysteresis(w, s):
    """Bouc-Wen: z' = F' (1 - |z| (sgn(F' z) + 1) / 2) / width."""
    f = w.load[:, -1]
    width, out = 0.12 * f.max(), np.zeros(len(f))
    for rows in w.presses:
        z, before = 0.0, 0.0
        for i, now in zip(rows, f[rows].tolist(), strict=True):
            df = (now - before) / width
            z += df * (1 - abs(z) * 0.5 * (np.sign(df * z) + 1))
            z = min(max(z, -1.0), 1.0) if now > 0 else 0.0
            out[i], before = z, now
    share = np.minimum(f, width) / width
    w.load = w.load * (1 + 0.08 * s * (out - 1) * share)[:, None]


@hidden("skin", "amplitude", most=6, both=True)
def modulus(w, s):
    """Stiffer throughout."""
    w.load = w.load * (1 + 0.12 * s)
    w.tell("modulus", e=0.12 * s)


@hidden("skin", "depth curvature", most=6, both=True)
def stiffening(w, s):
    """Chains reach their length: an exponential of depth over radius (Fung)."""
    w.load = w.load * np.exp(0.5 * s * np.maximum(w.pose[:, 2], 0.0) / (w.radius + 4.0))[:, None]


@hidden("skin", "lateral spread", most=5, both=True)
def bulge(w, s):
    """The skin does not give way in volume: it lifts around the contact."""
    c = skin.centers()
    r = np.hypot(w.pose[:, :1] - c[:, 0], w.pose[:, 1:2] - c[:, 1])
    lifted = np.exp(-(((r - 3.8) / 1.1) ** 2)) * w.load[:, -1:] * 0.02
    w.load = np.column_stack([w.load[:, :-1] - s * lifted, w.load[:, -1]])


@hidden("skin", "loading and unloading", fitted=True, most=6)
def adhesion(w, s):
    """A patch that pulls while the tip leaves, and lets go below the face."""
    reach = 0.12
    pattern = skin.both(np.column_stack([w.pose[:, :2], np.full(len(w.pose), 0.1)]), w.radius, w.layer)
    for rows in w.presses:
        d = w.pose[rows, 2]
        top = int(np.argmax(d))
        leaving = (np.arange(len(d)) > top) & (d[top] > 0.05) & (np.diff(d, prepend=d[0]) < 0)
        held = leaving & (d > -reach)
        shape = np.where(d < 0.04, 1 - ((d - 0.04) / (0.04 + reach)) ** 2, np.exp(-(d - 0.04) / 0.08))
        w.load[rows] -= 0.5 * s * pattern[rows] * (shape * held * (d < 2 * reach))[:, None]


@hidden("skin", "depth offset", fitted=True, most=6)
def permanent_set(w, s):
    """Each press leaves a dent that grows with the depth it had, ever less."""
    dent = np.zeros(w.site.max() + 1)
    gone = np.empty(len(w.load))
    for rows in w.presses:
        place = w.site[rows[0]]
        gone[rows] = dent[place]
        deepest = max(w.pose[rows, 2].max(), 0.0)
        dent[place] += 0.35 * (0.05 * s * deepest - dent[place])
    lower = w.pose - np.column_stack([np.zeros((len(gone), 2)), gone])
    ratio = skin.both(lower, w.radius, w.layer) / np.maximum(skin.both(w.pose, w.radius, w.layer), 1e-12)
    w.load = w.load * ratio


@hidden("skin", "temperature", fitted=True, most=6, needs={"streams": ("temperature",)}, both=True)
def temperature_stiffness(w, s):
    """Nearly entropic: more load where it is warm, slightly bent."""
    t = (w.warm - w.warm.mean()) / 10.0
    w.load = w.load * (1 + 0.05 * s * (t + 0.1 * t**2))[:, None]
