"""Thirty labs, each with a sensor, a protocol and files of its own; its docstring names the hidden effect."""

from collections.abc import Callable
from dataclasses import dataclass

import days
import numpy as np
import path
from bench import BEGIN, Bench
from board import Board
from machine import Machine
from memory import Friction, Network, Relaxation, SmoothFriction, Softening, spectrum
from recordings import Files
from skin import Skin
from truth import Truth

SEED = 7700
"""Of the first lab; each has the next one."""
LABS = {}
"""Name -> `Lab`, in the order of their seeds."""
THREE = (0.8, 1.4, 2.0)
"""Depths [mm]."""


@dataclass(frozen=True)
class Lab:
    """One data set."""

    number: int
    """From 0."""
    make: Callable
    """Random numbers, `Files` -> none."""
    truth: Truth

    @property
    def hidden(self):
        """The hidden effect, in words."""
        return self.make.__doc__

    def write(self, folder, name, first=SEED):
        """Write raw/ and a mapping below a new folder; a data set's sensor is called by its first word."""
        folder.mkdir(parents=True)
        self.make(np.random.default_rng(first + self.number), Files(folder, name.partition("_")[0]))


def lab(*names, **known):
    """Enter a lab under its function's name, with its truth."""

    def entered(make):
        LABS[make.__name__] = Lab(len(LABS), make, Truth(names, **known))
        return make

    return entered


@lab("frame_compliance", best="named: a laser sees the tip")
def d01_compliance_laser(rng, files):
    """The frame gives way by 0.08 mm/N."""
    board = Board(rng, 6, "capacitive", 0.004)
    runs = path.presses(rng, 24, (0.8, 2.2), (0.5, 2, 6))
    Bench(laser=True).record(files, rng, Skin(compliance=0.08), board, runs)


@lab("frame_compliance", best="nothing: without a gauge a fitted response takes it up", shows=False)
def d02_compliance_blind(rng, files):
    """The frame gives way by 0.08 mm/N, and nothing sees it."""
    board = Board(rng, 6, "capacitive", 0.004)
    runs = path.presses(rng, 24, (0.8, 2.2), (0.5, 2, 6))
    Bench().record(files, rng, Skin(compliance=0.08), board, runs)


@lab("frame_compliance", best="named: a laser sees the tip")
def d03_compliance_long(rng, files):
    """The frame gives way by 0.03 mm/N."""
    board = Board(rng, 3, "magnetic", 1.0)
    moves = path.cycles((0.8, 1.4, 2.0), (0.5, 2.0), 4)
    Machine(laser=True, force=0.01).record(files, rng, Skin(stiffness=1.0, compliance=0.03), board, moves)


@lab("hysteresis", best="named: three rates and depths")
def d04_hysteresis_preisach(rng, files):
    """Friction of six elements, 24 % of the load."""
    board = Board(rng, 4, "barometric", 0.01, largest=5.0)
    moves = path.cycles((0.6, 1.2, 1.8), (0.3, 1.0, 4.0), 4)
    machine = Machine(force=0.01, separator=";", decimal=",")
    machine.record(files, rng, Skin(memory=Friction(0.12, 5.0)), board, moves)


@lab("hysteresis", best="named: three rates, with holds and without")
def d05_boucwen_small(rng, files):
    """Smooth friction of 0.1 N."""
    board = Board(rng, 8, "strain", 1.0, noise=0.001)
    runs = path.presses(rng, 30, (0.6, 2.0), (0.4, 1.5, 5), hold=(0.01, 1.0))
    Bench(together=True).record(files, rng, Skin(memory=SmoothFriction(0.10, 0.25, 1.5)), board, runs)


@lab("hysteresis", best="named, or a set of both: it flows with the ninth power of load", also=("relaxation",))
def d06_bergstrom_boyce(rng, files):
    """A second network that flows, nearly without regard to rate."""
    board = Board(rng, 4, "barometric", 0.02, largest=5.0)
    turns = [(depth, speed) for depth in THREE for speed in (0.3, 1.5, 6.0) for _ in range(2)]
    runs = [(path.cycles((depth,), (speed,), 3), path.ONLY) for depth, speed in turns]
    Bench(force=0.01).record(files, rng, Skin(memory=Network(1.4, 0.175, 0.5, 9)), board, runs)


@lab("softening", best="named: new places, deeper and deeper")
def d07_mullins_specimens(rng, files):
    """A skin softens by the deepest press so far, at eight places."""
    board = Board(rng, 9, "magnetic", 1.0, pitch=5.0)
    places = [(x, y) for x in (-6, 0, 6) for y in (-6, 0, 6)][:8]
    runs = [(path.cycles((depth,), (1.5,), 2, first=1.0), place) for place in places for depth in THREE]
    Bench().record(files, rng, Skin(memory=Softening(2.5, 0.6, 0.1)), board, runs)


@lab("softening", best="named: deeper and deeper, four cycles each")
def d08_mullins_long(rng, files):
    """A skin softens by the deepest press so far."""
    board = Board(rng, 2, "resistive", 1.0)
    moves = [("hold", 2.0)]
    for depth in (0.5, 0.9, 1.3, 1.7, 2.1):
        moves += [("to", depth, 1.0), ("to", -0.5, 1.0)] * 4
    Machine().record(files, rng, Skin(memory=Softening(3.0, 0.6, 0.1)), board, moves)


@lab("relaxation", best="named: holds of 15 s")
def d09_relax_prony(rng, files):
    """Relaxation in three terms, 14 % of the load."""
    skin = Skin(memory=Relaxation(((0.05, 0.3), (0.04, 3.0), (0.05, 15.0))))
    board = Board(rng, 16, "capacitive", 0.004)
    runs = path.presses(rng, 18, THREE, (0.5, 2, 8), hold=15.0, idle=3.0, drawn=False)
    Bench(rate=25, stage_rate=25, pause=60.0).record(files, rng, skin, board, runs)


@lab("relaxation", best="named: holds of 12 s, two rates")
def d10_relax_power_small(rng, files):
    """Relaxation spread evenly from 0.02 to 500 s, 5 % of the load."""
    board = Board(rng, 5, "barometric", 0.01)
    moves = [("hold", 3.0)]
    for k in range(14):
        depth, speed = (0.7, 1.3, 1.9)[k % 3], (0.5, 4.0)[k % 2]
        moves += [("to", depth, speed), ("hold", 12.0), ("to", -0.5, 4.0), ("hold", 6.0)]
    Machine(rate=30).record(files, rng, Skin(memory=Relaxation(spectrum(0.05, 0.02, 500, 14))), board, moves)


@lab("latency", best="named: three rates")
def d11_latency80(rng, files):
    """Readings are 80 ms late, and the stage's clock is 3 s ahead."""
    board = Board(rng, 12, "resistive", 1.0)
    runs = path.presses(rng, 24, (0.8, 2.0), (0.5, 2, 8))
    Bench(latency=0.080, ahead=3.0, jitter=0.15, lost=0.02).record(files, rng, Skin(), board, runs)


@lab("latency", best="named: three rates")
def d12_latency35_long(rng, files):
    """Readings are 35 ms late."""
    board = Board(rng, 1, "strain", 1.0)
    moves = path.cycles((1.0, 2.0), (0.5, 2.0, 8.0), 5)
    Machine(latency=0.035).record(files, rng, Skin(), board, moves)


@lab("latency", best="a set with it is right: one rate, no hold")
def d13_latency_one_rate(rng, files):
    """Readings are 60 ms late."""
    board = Board(rng, 4, "magnetic", 1.0)
    runs = path.presses(rng, 20, (0.8, 2.0), (2.0,), hold=0.0)
    Bench(latency=0.060).record(files, rng, Skin(), board, runs)


@lab("hysteresis", best="a set with it is right: one rate")
def d14_cap_stairs(rng, files):
    """Friction of six elements, 20 % of the load, under stairs."""
    board = Board(rng, 10, "capacitive", 0.008)
    runs = [(path.stairs(top, 0.2, 0.8, 2.0), path.ONLY) for top in (1.2, 1.6, 2.0) * 4]
    Bench(rate=30, stage_rate=30).record(files, rng, Skin(memory=Friction(0.10, 5.0)), board, runs)


@lab("hysteresis", best="a set with it is right: one rate")
def d15_cap_stairs_small(rng, files):
    """Friction of six elements, 6 % of the load, under stairs."""
    board = Board(rng, 1, "capacitive", 0.008)
    runs = [(path.stairs(2.0, 0.25, 1.0, 1.0), path.ONLY)] * 8
    Bench(rate=20, together=True).record(files, rng, Skin(memory=Friction(0.03, 5.0)), board, runs)


@lab("relaxation", best="a set with it is right: one rate, no hold")
def d16_decoy_visco_one_rate(rng, files):
    """Relaxation in two terms, 16 % of the load, where it looks like friction."""
    board = Board(rng, 6, "barometric", 0.01)
    runs = path.presses(rng, 20, (0.8, 2.0), (1.0,), hold=0.0)
    Bench(together=True).record(files, rng, Skin(memory=Relaxation(((0.10, 0.8), (0.06, 6.0)))), board, runs)


@lab("low_pass_filter", best="a set with it is right: one rate, no hold")
def d17_decoy_lag_one_rate(rng, files):
    """A low pass of 60 ms, where it looks like friction."""
    board = Board(rng, 4, "strain", 1.0)
    moves = path.cycles(THREE, (1.5,), 6)
    Machine(lag=0.06).record(files, rng, Skin(), board, moves)


@lab("backlash", best="named: four rates, with holds and without")
def d18_backlash60(rng, files):
    """The guide has a play of 0.06 mm."""
    board = Board(rng, 6, "capacitive", 0.004)
    runs = path.presses(rng, 24, (0.8, 2.0), (0.25, 1.0, 3.0, 9.0), hold=(0.01, 1.5))
    Bench().record(files, rng, Skin(play=0.06), board, runs)


@lab("low_pass_filter", best="named: three rates and holds")
def d19_lowpass150(rng, files):
    """A low pass of 150 ms."""
    board = Board(rng, 3, "barometric", 0.01)
    runs = path.presses(rng, 24, (0.8, 2.0), (0.5, 2.0, 8.0), hold=1.5)
    Bench(lag=0.15, together=True).record(files, rng, Skin(), board, runs)


@lab("low_pass_filter", best="named: three rates and holds")
def d20_lowpass40_long(rng, files):
    """A low pass of 40 ms."""
    board = Board(rng, 2, "magnetic", 1.0)
    moves = path.cycles((1.0, 1.8), (0.5, 3.0, 10.0), 5, hold=0.8)
    Machine(rate=100, lag=0.04).record(files, rng, Skin(), board, moves)


@lab("gain_drift", best="named, or a set with it: presses spaced evenly at one place wear a skin in alike")
def d21_gain_drift(rng, files):
    """Gains fall by 7 %, with a time constant of 20 min."""
    board = Board(rng, 8, "resistive", 1.0)
    runs = path.presses(rng, 36, (0.8, 2.0), (0.5, 3.0))
    bench = Bench(together=True, pause=45.0, gains=lambda clock: 1 - 0.07 * (1 - np.exp(-(clock - BEGIN) / 1200)))
    bench.record(files, rng, Skin(), board, runs)


@lab("saturation", best="nothing: a fitted response takes it up", shows=False)
def d22_saturating(rng, files):
    """Readings end at 20000 counts."""
    board = Board(rng, 6, "strain", 1.0)
    runs = path.presses(rng, 24, (0.8, 2.2), (0.5, 3.0))
    Bench(together=True, spoilt=lambda said, _: np.minimum(said, 20000)).record(files, rng, Skin(), board, runs)


@lab(best="nothing; remarks tell of both channels")
def d23_dead_stuck(rng, files):
    """Channel 2 is dead, and channel 6 stands still in every press from the eleventh on."""

    def spoilt(said, number):
        said = said.copy()
        said[:, 2] = 11.9
        if number >= 10:
            said[:, 6] = said[0, 6]
        return said

    board = Board(rng, 9, "capacitive", 0.004)
    runs = path.presses(rng, 24, (0.8, 2.0), (0.5, 2.0, 6.0))
    Bench(spoilt=spoilt).record(files, rng, Skin(), board, runs)


@lab()
def d24_null_presses(rng, files):
    """Nothing; gains and depth zeros scatter more, and noise has a longer memory."""
    board = Board(rng, 12, "capacitive", 0.004, memory=0.85, noise=0.003, gain=0.015)
    runs = path.presses(rng, 30, (0.6, 2.0), (0.5, 2.0, 8.0), hold=(0.01, 1.0))
    Bench(touch=0.02).record(files, rng, Skin(), board, runs)


@lab()
def d25_null_long(rng, files):
    """Nothing; offsets wander more."""
    board = Board(rng, 3, "magnetic", 1.0, noise=0.0008, wander=0.02)
    moves = path.cycles((0.7, 1.3, 1.9), (0.5, 2.0, 8.0), 3)
    Machine().record(files, rng, Skin(), board, moves)


@lab(best="nothing, or the depth zero of each day", also=("session_zero",))
def d26_null_sessions(rng, files):
    """Nothing but three days with touch-offs up to 0.08 mm wrong, and gains and offsets of their own."""
    board = Board(rng, 6, "resistive", 1.0, wander=0.01)
    days.record(files, rng, Skin(), board)


@lab("relaxation", "latency", best="both named: three rates, holds of 6 s")
def d27_relax_latency(rng, files):
    """Relaxation in two terms, 12 % of the load, and readings 60 ms late."""
    skin = Skin(memory=Relaxation(((0.06, 0.6), (0.06, 8.0))))
    board = Board(rng, 8, "barometric", 0.01)
    runs = path.presses(rng, 30, (0.8, 2.0), (0.5, 3, 10), hold=6.0, idle=2.0)
    Bench(latency=0.060).record(files, rng, skin, board, runs)


@lab("relaxation", "backlash", best="both named: three rates, with holds and without")
def d28_backlash_small_relax(rng, files):
    """Relaxation in two terms, 8 % of the load, and a play of 0.04 mm."""
    skin = Skin(memory=Relaxation(((0.05, 1.0), (0.03, 10.0))), play=0.04)
    board = Board(rng, 6, "capacitive", 0.004)
    runs = path.presses(rng, 30, (0.8, 2.0), (0.25, 2, 8), hold=(0.01, 4.0), idle=2.0)
    Bench().record(files, rng, skin, board, runs)


@lab()
def d29_null_stairs(rng, files):
    """Nothing, under stairs."""
    board = Board(rng, 1, "capacitive", 0.008)
    runs = [(path.stairs(2.0, 0.25, 1.0, 1.0), path.ONLY)] * 10
    Bench(rate=20, together=True).record(files, rng, Skin(), board, runs)


@lab("relaxation", best="named: two rates, holds of 3 s")
def d30_relax_small_short(rng, files):
    """Relaxation in two terms, 3 % of the load."""
    board = Board(rng, 4, "strain", 1.0)
    runs = path.presses(rng, 20, (0.8, 2.0), (0.5, 5.0), hold=3.0)
    Bench(together=True).record(files, rng, Skin(memory=Relaxation(((0.015, 0.4), (0.015, 4.0)))), board, runs)
