"""Recordings in the files in which labs keep them: each function writes one set below a folder.

Their contents are drawn from a seed. Nothing here imports tacdata.
"""

from dataclasses import dataclass, field
from datetime import datetime, timedelta

import laws
import numpy as np

MEMORY, FRICTION, DELAY = "memory of the skin", "friction and play", "delay and filtering"
CONTACT, DRIFT = "contact", "gain and offset in time"
TAXELS = np.array([(x, y) for y in (-4.0, 0.0, 4.0) for x in (-4.0, 0.0, 4.0)])


@dataclass(frozen=True)
class Kept:
    """A set as a lab keeps it on disk."""

    source: str
    """File or folder that is imported."""
    mechanisms: tuple = ()
    """True of it; empty: nothing is hidden."""
    families: tuple = ()
    answers: dict = field(default_factory=dict)
    """Answers to the proposal's questions by a person who knows the lab: parts of the mapping."""


def written(path, lines, encoding="utf-8"):
    """Write lines of text."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n", encoding=encoding)


def german(*values, digits=3):
    """Return numbers with decimal commas, between semicolons."""
    return ";".join(f"{value:.{digits}f}".replace(".", ",") for value in values)


def pattern(places, x, y, width):
    """Return how much each taxel feels of a press."""
    return np.exp(-((places - (x, y)) ** 2).sum(axis=1) / 2 / width**2)


def strips(folder, rng):
    """Strips of rubber, stretched: semicolons, decimal commas, Latin-1, a folder a specimen, one file copied."""
    share, alpha, number = rng.uniform(0.25, 0.45), rng.uniform(0.15, 0.3), 0
    for name, stiff in (("Probe_A", 1.0), ("Probe_B", rng.uniform(1.05, 1.15))):
        for stretch in (1.5, 2.0, 3.0):
            for rate in (0.05, 0.5, 2.0):
                for again in (1, 2)[: 2 if name == "Probe_A" else 1]:
                    time, way = laws.stroke(12, 40 * (stretch - 1), 40 * rate, 25.0, rest=6.0)
                    time = np.maximum.accumulate(time + 0.012 * rng.standard_normal(len(time)))
                    long = 1 + way / 40
                    load = stiff * 0.9 * (long - long**-2 + 0.06 * (long**3 - long**-3))
                    force = laws.relaxed(time, load, laws.power_law(share, alpha))
                    force += 0.02 * np.sin((70 * number + time) / 300) + 0.004 * rng.standard_normal(len(time))
                    force, number = np.round(force / 0.002) * 0.002, number + 1
                    head = ["Zugversuch Z2.5", "Prüfer: KM", "", "Prüfzeit;Traversenweg;Standardkraft", "s;mm;N"]
                    lines = head + [german(*row, digits=4) for row in zip(time, way, force, strict=True)]
                    path = folder / "strips" / name / f"lambda_{stretch}".replace(".", "_") / f"rate{rate}_V{again}.csv"
                    written(path, lines, "latin-1")
    written(path.with_name(f"{path.stem} - Kopie.csv"), lines, "latin-1")
    return Kept("strips", ("relaxation",), (MEMORY,))


def foam(folder, rng):
    """A foam capacitor on a staircase: a workbook, a sheet a run, two rows of header."""
    import openpyxl

    book, width = openpyxl.Workbook(), rng.uniform(0.12, 0.25)
    book.active.title = "Info"
    book.active.append(["LCR meter, 1 kHz"])
    for run, (top, steps, dwell) in enumerate([(1.8, 6, 4), (1.2, 6, 4), (0.6, 4, 4), (1.8, 9, 3), (1.2, 4, 6)] * 2):
        stairs = np.r_[np.arange(steps + 1), np.arange(steps)[::-1]] * top / steps
        way = np.repeat(stairs, 8 * dwell)
        way = np.convolve(np.pad(way, 1, mode="edge"), np.ones(3) / 3, "valid")
        lag = laws.preisach(way / 2, width) * 2 / 3
        strain = 0.75 * way / 3 + 0.25 * lag
        gap = 1.18 * (1 + 2.2 * (1 - 0.72 * (1 - strain) ** 1.6)) / (1 - strain) * (1 + 0.003 * rng.standard_normal())
        squeeze = np.maximum(way / 3 - 0.27 * (strain - 0.75 * way / 3), 0)
        force = 60 * (squeeze / (1 - squeeze)) ** 1.3 + 0.05 * rng.standard_normal(len(way))
        time = np.arange(len(way)) / 8 + 0.01 * rng.standard_normal(len(way))
        sheet = book.create_sheet(f"Run {run + 1:02d}")
        for row in (["Foam"], ["Time", "Displacement", "Capacitance", "Load"], ["(s)", "(mm)", "(pF)", "(N)"]):
            sheet.append(row)
        noisy = np.round(gap + 0.0015 * rng.standard_normal(len(way)), 3)
        for row in zip(time, way, noisy, force, strict=True):
            sheet.append([round(float(value), 4) for value in row])
    book.save(folder / "foam.xlsx")
    return Kept("foam.xlsx", ("hysteresis",), (FRICTION,))


def capacitance(folder, rng):
    """Eight capacitances and a force: one array without names, pauses between presses, rows that were lost."""
    places = np.array([(x, y) for y in (-3.0, 3.0) for x in (-9.0, -3.0, 3.0, 9.0)])
    kernel = laws.stretched(rng.uniform(0.18, 0.3), rng.uniform(0.8, 3.0), rng.uniform(0.4, 0.6))
    gain, begin, rows = 1 + 0.1 * rng.standard_normal(8), 0.0, []
    for x, y in [(-6, 0), (0, 0), (6, 0), (-3, 2), (3, -2), (0, 3)]:
        for depth, speed in [(1.2, 0.5), (0.8, 2.0), (1.2, 8.0), (0.5, 2.0)]:
            time, way = laws.stroke(25, depth, speed, 5.0, begin=1.0, rest=3.0)
            force = laws.relaxed(time, 3.2 * way**1.5, kernel)
            read = gain * (12 + 0.9 * force[:, None] * pattern(places, x, y, 4.5))
            read += 0.05 * np.sin((begin + time) / 380)[:, None] + 0.008 * rng.standard_normal(read.shape)
            above = np.maximum(2 * (1 - time), 0) + np.clip(2 * (time - time[-1] + 1), 0, 2)
            columns = [
                begin + time,
                x + 0 * time,
                y + 0 * time,
                12.4 - way + above,
                force + 0.02 * rng.standard_normal(len(time)),
            ]
            rows.append(np.column_stack([*columns, np.round(read / 0.005) * 0.005])[rng.random(len(time)) > 0.02])
            begin += time[-1] + rng.uniform(12, 16)
    np.save(folder / "log_all.npy", np.vstack(rows))
    axes = {axis: {"column": f"array[{k}]", "unit": "mm"} for k, axis in enumerate("xyz", 1)}
    answers = {
        "taxels": {"file": "log_all", "columns": ["array[5-12]"], "unit": "pF"},
        "position": {"file": "log_all", **axes},
        "contact": {"x": 0, "y": 0, "z": 12.4},
        "trials": {"gap": 5.0},
        "measured": {"force": {"file": "log_all", "columns": ["array[4]"], "unit": "N"}},
    }
    return Kept("log_all.npy", ("relaxation",), (MEMORY,), answers)


def fluidic(folder, rng):
    """Eight tubes: a MATLAB structure with trials along the third axis; one lead is broken."""
    from scipy.io import savemat

    going_in, coming_out, share = rng.uniform(0.12, 0.25), rng.uniform(0.35, 0.55), rng.uniform(0.12, 0.22)
    count, time = 20, np.arange(480) / 20
    read, ways, gain = np.zeros((480, 8, count)), np.zeros((480, count)), rng.uniform(0.2, 0.5, 8)
    for k in range(count):
        depth, speed = (2.0, 3.0, 4.0)[k % 3], (2.0, 5.0, 20.0)[k // 3 % 3]
        at, way = laws.stroke(20, depth, speed, 8.0, begin=1.0, rest=12.0)
        ways[:, k] = np.interp(time, at, way)
        delayed = laws.late(time, ways[:, k], going_in, coming_out)
        load = laws.creeping(time, 0.5 * delayed + 0.12 * delayed**2, share, 3.0, 6.0)
        scatter = 1 + 0.01 * rng.standard_normal(8)
        read[:, :, k] = 1.1 + gain * scatter * load[:, None] + 0.004 * rng.standard_normal((480, 8)) + 0.003 * k / count
    read[:, 5] = 1.1 + 0.4 * rng.standard_normal((480, count)) * (rng.random((480, count)) > 0.5)
    inside = {"t": time[:, None], "V": np.round(read * 204.8) / 204.8, "disp": ways, "speed": np.ones(count)}
    savemat(folder / "fingertip.mat", {"S": {**inside, "info": {"units": "s, V, mm"}}})
    return Kept("fingertip.mat", ("latency", "creep"), (DELAY, MEMORY))


def barometric(folder, rng):
    """Four chambers that leak: the log of a serial monitor, with a broken line here and there."""
    tau, size, begin = rng.uniform(4, 9, 4), rng.uniform(700, 1400, 4), 0.0
    start, head = datetime(2023, 11, 4, 13, 58, 3), "z_mm,p1_Pa,p2_Pa,p3_Pa,p4_Pa,T_degC"
    lines = ["Booting", "13:58:01.551 -> sensor #1 ok", f"13:58:01.560 -> {head}"]
    for k in range(24):
        time, way = laws.stroke(
            16, (0.4, 0.8, 1.2, 0.8)[k % 4], (0.4, 1.6, 6.4)[k % 3], (5.0, 10.0)[k // 2 % 2], 1.0, rest=7.0
        )
        warm = 24 + 1.2 * (1 - np.exp(-(begin + time) / 300))
        read = 101_310 + 14 * np.sin((begin + time) / 260)[:, None] + 6 * (warm - 24)[:, None]
        read = read + np.column_stack(
            [s * laws.leaking(time, way + 0.35 * way**2, t) for s, t in zip(size, tau, strict=True)]
        )
        read += 1.5 * rng.standard_normal(read.shape)
        for at, z, row, degrees in zip(time, way, read, warm, strict=True):
            if rng.random() > 0.004:
                clock = (start + timedelta(seconds=float(begin + at))).strftime("%H:%M:%S.%f")[:-3]
                line = f"{clock} -> {z:.3f},{','.join(f'{value:.1f}' for value in row)},{degrees:.2f}"
                lines.append(line if rng.random() > 0.0006 else line[:27])
        begin += time[-1] + 0.5
    written(folder / "monitor.txt", lines)
    return Kept("monitor.txt", ("baseline_tracking", "relaxation"), (MEMORY, DELAY))


def magnetic(folder, rng):
    """Magnets over Hall sensors that warm up: dates with AM and PM, sensors that saturate, one lead turned half way."""
    sensors, less, tau, begin = TAXELS[[0, 2, 6, 8]], rng.uniform(0.06, 0.12), rng.uniform(400, 900), 0.0
    names = ",".join(f"B{axis}{k} (mT)" for k in range(1, 5) for axis in "xyz")
    lines, start = [f"Timestamp,Run,X (mm),Y (mm),Z (mm),{names}"], datetime(2023, 11, 4, 11, 12, 10)
    for k in range(36):
        x, y = [(-4, -4), (0, 0), (4, 4), (4, -4), (2, 1)][k % 5]
        time, way = laws.stroke(25, (1.0, 2.0, 1.5)[k % 3], (1.0, 3.0)[k // 3 % 2], 2.0)
        fields = []
        for sensor, much in zip(sensors, pattern(sensors, x, y, 3.5), strict=True):
            side = 0.06 * much * way[:, None] * (sensor - (x, y))
            fields.append(laws.dipole(np.column_stack([side, 5 - much * way]), 200.0))
        read = np.hstack(fields) * (1 - less * (1 - np.exp(-(begin + time) / tau)))[:, None]
        read[:, 7] *= -1 if k >= 18 else 1
        read = np.round(np.clip(read + 0.012 * rng.standard_normal(read.shape), -4.5, 4.5) / 0.005) * 0.005
        for at, z, row in zip(time, way, read, strict=True):
            clock = start + timedelta(seconds=float(begin + at))
            stamp = (
                f"{clock.month}/{clock.day}/{clock.year} {clock.strftime('%I:%M:%S.%f')[:-3]} {clock.strftime('%p')}"
            )
            lines.append(f"{stamp},{k + 1},{x},{y},{-z:.3f},{','.join(f'{value:.3f}' for value in row)}")
        begin += time[-1] + 50
    written(folder / "magnets.csv", lines)
    return Kept("magnets.csv", ("gain_drift", "drift", "warm_up_drift"), (DRIFT,))


def piston(folder, rng):
    """A piston in its seal: a file a speed, German dates with commas, tabs, pauses between runs."""
    dry, start = rng.uniform(1.5, 3.0), datetime(2023, 11, 4, 9, 12)
    for speed in (1.0, 4.0, 16.0):
        lines, begin = ["Datum Uhrzeit\tWeg [mm]\tKraft [N]\tDruck [bar]"], 0.0
        for top in (12.0, 20.0, 8.0) * 2:
            corners = np.array([0, 0, top, top, 0.4 * top, 0.4 * top, 0.8 * top, 0.8 * top, 0, 0])
            waits = np.where(np.diff(corners) == 0, 3.0, np.abs(np.diff(corners)) / speed)
            time = np.arange(0, waits.sum(), 0.04)
            way = np.interp(time, np.r_[0, np.cumsum(waits)], corners)
            rub = laws.lugre(time, np.gradient(way, time), dry, 1.3 * dry, 14.0)
            bar = 0.02 + (60 / (60 - way) - 1) * (1 + 0.004 * rng.standard_normal())
            force = 12 * bar + rub + 0.03 * rng.standard_normal(len(time))
            for at, *row in zip(time, way, force, bar, strict=True):
                stamp = (start + timedelta(seconds=float(begin + at))).strftime("%d.%m.%Y %H:%M:%S,%f")[:-3]
                lines.append("\t".join([stamp, *(german(value) for value in row)]))
            begin += time[-1] + 20
        written(folder / "Kolben" / f"Kolben_{speed:g}mms.txt", lines)
        start += timedelta(minutes=20)
    answers = {"taxels": {"file": "kolben__mms", "columns": ["Kraft [N]"], "unit": "N"}, "measured": {}}
    return Kept("Kolben", ("dry_friction",), (FRICTION,), answers)


def gel(folder, rng):
    """A gel that sticks: a file a press, its place in the name, times in ms, heights in um."""
    work, gain, number = rng.uniform(0.0015, 0.004), 1 + 0.08 * rng.standard_normal(9), 0
    for x, y in [(0, 0), (2, -1.5), (-2, 1.5), (2, 2)]:
        for depth in (0.6, 1.0):
            for speed in (0.5, 1.0, 2.0):
                number += 1
                corners, waits = [0, 0, depth, depth, -0.6, -0.6], [0.4, depth / speed, 2, (depth + 0.6) / 0.5, 1]
                time = np.arange(0, sum(waits), 0.02)
                way = np.interp(time, np.r_[0, np.cumsum(waits)], corners)
                back = laws.peeling(way, depth, 0.537, 5.0, work)
                force = np.where(time < sum(waits[:3]), laws.hertz(way, 0.537, 5.0), back)
                read = 310 + gain * 900 * force[:, None] * pattern(TAXELS, x, y, 3.2)
                read = np.round(read + 3 * rng.standard_normal(read.shape))
                rows = [
                    f"{1000 * t:.0f},{-1000 * z:.0f},{','.join(f'{v:.0f}' for v in row)}"
                    for t, z, row in zip(time, way, read, strict=True)
                ]
                name = f"gel_x{x:+.1f}_y{y:+.1f}_d{depth}_v{speed}_n{number:02d}.csv"
                written(folder / "gel" / name, ["ms,z_um," + ",".join(f"s{k}" for k in range(9)), *rows])
    return Kept("gel", ("adhesion",), (CONTACT,))


def frame(folder, rng):
    """Three materials on a load frame that gives way: a folder a material, quoted numbers, no gauge."""
    soft = rng.uniform(0.02, 0.05)
    for name, modulus, skin in (("Ecoflex 00-30", 0.12, 3.1), ("Dragon Skin 10", 0.47, 2.6), ("PDMS 10-1", 3.2, 2.9)):
        for run, depth in enumerate((1.0, 1.4, 0.7) * 2):
            touch, speed = skin + 0.03 * rng.standard_normal(), (0.1, 0.5)[run % 2]
            time, way = laws.stroke(10 if speed < 0.2 else 25, depth + 0.3, speed, 1.0, begin=0.0, rest=0.0)
            force = laws.behind_a_frame(way - 0.3, lambda d, e=modulus: laws.hertz(d, e, 4.0), soft)
            force = force * (1 + 0.01 * rng.standard_normal()) + 0.004 * rng.standard_normal(len(time))
            rows = [f'"{t:.3f}","{z:.4f}","{f:.4f}"' for t, z, f in zip(time, touch - 0.3 + way, force, strict=True)]
            head = '"Time (s)","Extension (mm)","Load (N)"'
            written(folder / "indentation" / name / f"Specimen_RawData_{run + 1}.csv", [head, *rows])
    return Kept("indentation", ("frame_compliance",), ("kinematics",))


def clean(folder, rng):
    """Twelve capacitances that answer depth, and nothing else: an archive of arrays, rows lost, times uneven."""
    places, begin, kept = np.array([(x, y) for y in (-6, 0, 6) for x in (-9, -3, 3, 9)]), 0.0, []
    gain = 2.4 * (1 + 0.1 * rng.standard_normal(12))
    for k in range(24):
        x, y = [(-6, -3), (0, 0), (6, 3), (3, -3)][k % 4]
        time, way = laws.stroke(30, (0.5, 1.0, 1.5)[k % 3], (0.5, 2.0, 6.0)[k // 3 % 3], 3.0)
        load = gain * pattern(places, x, y, 5.0) * (way + 0.4 * way**2)[:, None] * (1 + 0.006 * rng.standard_normal())
        read = np.round((20 + load + 0.012 * rng.standard_normal(load.shape)) / 0.01) * 0.01
        time = np.maximum.accumulate(time + 0.008 * rng.standard_normal(len(time)))
        rows = np.column_stack([begin + time, k + 0 * time, x + 0 * time, y + 0 * time, -way, read])
        kept.append(rows[rng.random(len(time)) > 0.03])
        begin += time[-1] + 3
    table = np.vstack(kept)
    np.savez(folder / "skin.npz", time=table[:, 0], trial=table[:, 1], tip=table[:, 2:5], cap=table[:, 5:])
    return Kept("skin.npz")


SETS = {
    made.__name__: made
    for made in (strips, foam, capacitance, fluidic, barometric, magnetic, piston, gel, frame, clean)
}
