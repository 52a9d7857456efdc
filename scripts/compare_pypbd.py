#!/usr/bin/env python3
"""Measures sutura beside pypbd: the free thread of `sutura bench` and the direct solver for stiff rods (Deul et al. 2018); with --rods the
solver of the 2018 paper and the Cosserat rods of Kugelstadt and Schoemer 2016, whose constraints it has.

    python3 scripts/compare_pypbd.py [--sutura PATH] [--rounds N] [--frames N] [--elements N ...] [--json]
    python3 scripts/compare_pypbd.py --rods [--rounds N] [--frames N] [--elements N ...] [--json]

*Direct solver.* The job of both: 15 cm of thread, radius 0.1 mm, E = 1 GPa, Poisson's ratio 0.4, 1150 kg/m^3, straight and level, one end held, let go,
60 frames a second, four steps a frame. pypbd makes one iteration a step (its default); sutura runs at its default settings to its own
tolerance. Time is the CPU time of the stepping call on one core, the median over the frames of a round; rounds alternate between the
two programs and the table has the median of the rounds.

*Rods.* Both project shear and stretch of every element, then bend and twist of every joint, so many times a step; what is compared is the
time that one more iteration takes, over the number of elements: the slope between 20 and 40 iterations, so that what a step costs beside
them does not count. pypbd runs as it is installed, its own loop over its own constraints (TimeStepController, by color of its own finding:
two colors of elements, two of joints), on 15 m of thread, masses and inertias of 1, one end held, that falls, 60 steps a second. sutura is
`cargo bench -p sutura --bench paper`: figure 8 of the paper, in natural and in two-color order, without and with its direct distance
constraint, which pypbd has not. The cost of an iteration depends on neither scene. Medians over frames, then over rounds, in turn.

pypbd's function for such a thread takes quaternions, a type that pypbd itself does not give to Python. A module of a few lines that does so
is built for that (needs a C++ compiler and the headers of Python; pybind11 of the same kind as pypbd's, and Eigen, are installed beside it).

The first run makes a virtual environment with pypbd and numpy in the user's cache folder ($XDG_CACHE_HOME or ~/.cache).
"""

import argparse
import json
import os
import pathlib
import statistics
import subprocess
import sys
import sysconfig
import venv

PYPBD = "2.2.2"
PYBIND11, EIGEN = "3.0.1", "3.4.1"
LENGTH, RADIUS, YOUNG, POISSON, DENSITY = 0.15, 1e-4, 1e9, 0.4, 1150.0
FRAME = 1.0 / 60.0
STEPS = 4


def python_with_pypbd():
    """The Python of a virtual environment that has pypbd."""
    cache = pathlib.Path(os.environ.get("XDG_CACHE_HOME") or pathlib.Path.home() / ".cache")
    home = cache / "sutura-peers" / f"pypbd-{PYPBD}"
    python = home / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    if subprocess.run([str(python), "-c", "import pypbd, numpy"], capture_output=True).returncode if python.exists() else True:
        print(f"installing pypbd {PYPBD} in {home}", file=sys.stderr)
        venv.create(home, with_pip=True, clear=True)
        subprocess.run([str(python), "-m", "pip", "install", "--quiet", f"pypbd=={PYPBD}", "numpy"], check=True)
    return python


# The type of pypbd's quaternions, for its function `addLineModel`.
QUATERNION = """
#include <Eigen/Geometry>
#include <pybind11/pybind11.h>
using Quaternion = Eigen::Quaternion<double, Eigen::DontAlign>;
PYBIND11_MODULE(eigen_quaternion, module) {
    pybind11::class_<Quaternion>(module, "Quaternion").def(pybind11::init<double, double, double, double>());
}
"""


def build_quaternion(python):
    """Builds the module `eigen_quaternion` in the virtual environment, if it is not there."""
    home = python.parent.parent
    if subprocess.run([str(python), "-c", "import eigen_quaternion"], capture_output=True).returncode == 0:
        return
    print(f"building eigen_quaternion in {home}", file=sys.stderr)
    subprocess.run([str(python), "-m", "pip", "install", "--quiet", f"pybind11=={PYBIND11}", f"cmeel-eigen=={EIGEN}"], check=True)
    ask = "import json, pybind11, sysconfig; print(json.dumps([pybind11.get_include(), *map(sysconfig.get_path, ('include', 'purelib'))]))"
    *headers, site = json.loads(subprocess.run([str(python), "-c", ask], check=True, capture_output=True, text=True).stdout)
    source = home / "eigen_quaternion.cpp"
    source.write_text(QUATERNION)
    module = pathlib.Path(site) / ("eigen_quaternion" + sysconfig.get_config_var("EXT_SUFFIX"))
    headers.append(str(pathlib.Path(site) / "cmeel.prefix" / "include" / "eigen3"))
    flags = ["-O2", "-std=c++17", "-shared", "-fPIC", "-fvisibility=hidden", *(f"-I{h}" for h in headers)]
    subprocess.run([os.environ.get("CXX", "c++"), *flags, str(source), "-o", str(module)], check=True)


def rods_in_pypbd(elements, frames):
    """One round of its Cosserat rods: ns an element and iteration, ms a frame at 20 iterations, and the longest element at the end over its rest."""
    import math
    import time

    import numpy as np
    import pypbd as pbd
    from eigen_quaternion import Quaternion

    sim = pbd.Simulation.getCurrent()
    sim.initDefault()
    model = sim.getModel()
    length = 15.0 / elements
    points = [np.array([i * length, 0.0, 0.0]) for i in range(elements + 1)]
    # A frame's third axis lies along the thread. Orientations have inertias of 1 by themselves.
    along = Quaternion(math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0)
    edges = [i for e in range(elements) for i in (e, e + 1)]
    model.addLineModel(elements + 1, elements, points, [along] * elements, edges, list(range(elements)))
    particles = model.getParticles()
    for i in range(elements + 1):
        particles.setMass(i, 1.0 if i else 0.0)
    for e in range(elements):
        model.addStretchShearConstraint(e, e + 1, e, 1.0, 1.0, 1.0)
    for e in range(elements - 1):
        model.addBendTwistConstraint(e, e + 1, 0.5, 0.5, 0.5)
    if len(model.getConstraints()) != 2 * elements - 1:
        raise RuntimeError("pypbd refused the thread")
    step = sim.getTimeStep()
    controller = pbd.TimeStepController
    step.setValueUInt(controller.NUM_SUB_STEPS, 1)
    pbd.TimeManager.getCurrent().setTimeStepSize(FRAME)
    ms = {20: [], 40: []}
    for k in range(2 * frames):
        iterations = 20 if k % 2 else 40
        step.setValueUInt(controller.MAX_ITERATIONS, iterations)
        start = time.thread_time()
        step.step(model)
        ms[iterations].append(1e3 * (time.thread_time() - start))
    places = np.array([particles.getPosition(i) for i in range(elements + 1)])
    few, many = (statistics.median(ms[n]) for n in (20, 40))
    stretch = float(np.linalg.norm(np.diff(places, axis=0), axis=1).max()) / length - 1.0
    return {"ns": (many - few) * 1e6 / (20 * elements), "ms": few, "stretch": stretch, "end": [float(v) for v in places[-1]]}


def rods_in_sutura(elements, root):
    """One round of the benchmark `paper`: ns an element and iteration, and ms a frame at 20 iterations, by order and whether with DDC."""
    args = ["cargo", "bench", "--quiet", "-p", "sutura", "--bench", "paper", "--", str(elements)]
    out = subprocess.run(args, check=True, capture_output=True, text=True, cwd=root).stdout
    found = {}
    for line in out.splitlines():
        cells = line.split()
        if cells and cells[0] == str(elements):
            found[f"{cells[2]}{' with DDC' if cells[3] == 'true' else ''}"] = {"ms": float(cells[4]), "ns": float(cells[5])}
    return found


def compare_rods(args, python, one_core, root):
    """The table of --rods."""
    build_quaternion(python)
    rows = []
    for n in args.elements:
        ours, theirs = [], []
        for _ in range(args.rounds):
            child = [str(python), __file__, "--child", "rods", "--elements", str(n), "--frames", str(args.frames)]
            out = subprocess.run(child, check=True, capture_output=True, text=True, env=one_core, cwd=root).stdout
            theirs.append(json.loads(out.strip().splitlines()[-1]))
            ours.append(rods_in_sutura(n, root))
        median = lambda runs, key: statistics.median(r[key] for r in runs)
        row = {"elements": n, "pypbd": {key: median(theirs, key) for key in ("ns", "ms", "stretch")}, "pypbd_end": theirs[0]["end"]}
        for kind in ours[0]:
            runs = [o[kind] for o in ours]
            times = statistics.median(t["ns"] / r["ns"] for t, r in zip(theirs, runs))
            row[kind] = {"ns": median(runs, "ns"), "ms": median(runs, "ms"), "times": times}
        rows.append(row)
    if args.json:
        print(json.dumps({"pypbd": PYPBD, "rods": rows}, indent=2))
        return
    print(f"ns an element and iteration (times faster than pypbd {PYPBD}), one core, medians of {args.rounds} alternating rounds")
    kinds = ["natural", "natural with DDC", "two-color", "two-color with DDC"]
    print(f"{'elements':>8} {'pypbd':>7} " + " ".join(f"{kind:>18}" for kind in kinds))
    for r in rows:
        cells = [f"{r[kind]['ns']:.1f} ({r[kind]['times']:.1f})" for kind in kinds]
        print(f"{r['elements']:>8} {r['pypbd']['ns']:>7.1f} " + " ".join(f"{cell:>18}" for cell in cells))


def drop_in_pypbd(elements, frames):
    """One round in pypbd: median ms a frame, largest gap at a joint over the length of an element, and where the free end is."""
    import math
    import time

    import numpy as np
    import pypbd as pbd

    # Gravity is along -y by default. A segment's own axis is y; level is along x.
    sim = pbd.Simulation.getCurrent()
    sim.initDefault()
    model = sim.getModel()
    length = LENGTH / elements
    turn = np.array([0.0, 0.0, -math.sqrt(0.5), math.sqrt(0.5)])
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    faces = [0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1, 2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3]
    box = pbd.VertexData()
    box.resize(8)
    for i, corner in enumerate(corners):
        box.setPosition(i, corner)
    mesh = pbd.IndexedFaceMesh()
    mesh.initMesh(8, 36, 12)
    for i in range(12):
        mesh.addFace(faces[3 * i : 3 * i + 3])
    mesh.buildNeighbors()

    mass = DENSITY * math.pi * RADIUS**2 * length
    across = mass * (length**2 / 12 + RADIUS**2 / 4)
    # A held segment before the thread: its joint with the first one is the held end.
    for k in range(elements + 1):
        center, sides = np.array([(k - 0.5) * length, 0.0, 0.0]), np.array([2 * RADIUS, length, 2 * RADIUS])
        body = model.addRigidBody(DENSITY, box, mesh, center, np.eye(3), sides, generateCollisionObject=False)
        # Again with given axes: by itself it takes the principal ones in an order of its own, and the solver twists about y.
        body.initBody(mass if k else 0.0, center, np.array([across, 0.5 * mass * RADIUS**2, across]), turn, box, mesh, sides)
    joints = [(k, k + 1) for k in range(elements)]
    places = [np.array([k * length, 0.0, 0.0]) for k in range(elements)]
    shear = YOUNG / (2 * (1 + POISSON))
    same = lambda v: [v] * elements
    if not model.addDirectPositionBasedSolverForStiffRodsConstraint(joints, places, same(RADIUS), same(length), same(YOUNG), same(shear)):
        raise RuntimeError("pypbd refused the thread")

    step = sim.getTimeStep()
    controller = pbd.TimeStepController
    step.setValueUInt(controller.NUM_SUB_STEPS, STEPS)
    step.setValueUInt(controller.MAX_ITERATIONS, 1)
    pbd.TimeManager.getCurrent().setTimeStepSize(FRAME)
    bodies = model.getRigidBodies()
    half = np.array([0.0, 0.5 * length, 0.0])
    ms, gap = [], 0.0
    for _ in range(frames):
        start = time.thread_time()
        step.step(model)
        ms.append(1e3 * (time.thread_time() - start))
        ends = []
        for k in range(elements + 1):
            arm = np.array(bodies[k].getRotationMatrix()) @ half
            center = np.array(bodies[k].getPosition())
            ends.append((center - arm, center + arm))
        gap = max(gap, *(float(np.linalg.norm(ends[k][1] - ends[k + 1][0])) / length for k in range(elements)))
    if not all(math.isfinite(v) for v in ends[-1][1]):
        gap = math.nan
    return {"ms": statistics.median(ms), "error": gap, "end": [float(v) for v in ends[-1][1]]}


def drop_in_sutura(program, elements, frames):
    """One round of `sutura bench`."""
    args = [program, "bench", "--free", "--shape", "straight", "--elements", str(elements), "--frames", str(frames), "--json"]
    found = json.loads(subprocess.run(args, check=True, capture_output=True, text=True).stdout)
    thread = found["free_thread"][0]
    return {"ms": thread["ms_median"], "error": thread["max_elongation"], "cpu": found["machine"]["cpu"], "build": found["machine"]["build"]}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    here = pathlib.Path(__file__).resolve().parent.parent
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR") or here / "target")
    parser.add_argument("--sutura", default=str(target / "release" / "sutura"), help="the program to measure [default: the release build]")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--frames", type=int, default=120)
    parser.add_argument("--elements", type=int, nargs="+", help="[default: 40, 120, 500, and with the direct solver 2000]")
    parser.add_argument("--rods", action="store_true", help="the solver of the 2018 paper beside pypbd's Cosserat rods")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--child", choices=["drop", "rods"], help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.child:
        print(json.dumps({"drop": drop_in_pypbd, "rods": rods_in_pypbd}[args.child](args.elements[0], args.frames)))
        return
    args.elements = args.elements or [40, 120, 500] + ([] if args.rods else [2000])
    python = python_with_pypbd()
    # More than one thread costs pypbd 40 times as much CPU.
    one_core = {**os.environ, "OMP_NUM_THREADS": "1"}
    if args.rods:
        compare_rods(args, python, one_core, here)
        return
    rows, machine = [], ""
    for n in args.elements:
        ours, theirs = [], []
        for _ in range(args.rounds):
            child = [str(python), __file__, "--child", "drop", "--elements", str(n), "--frames", str(args.frames)]
            out = subprocess.run(child, check=True, capture_output=True, text=True, env=one_core, cwd=here).stdout
            theirs.append(json.loads(out.strip().splitlines()[-1]))
            ours.append(drop_in_sutura(args.sutura, n, args.frames))
        machine = f"{ours[0]['cpu']}, {ours[0]['build']} build"
        median = lambda runs: statistics.median(r["ms"] for r in runs)
        rows.append(
            {
                "elements": n,
                "pypbd_ms": median(theirs),
                "sutura_ms": median(ours),
                "times": statistics.median(t["ms"] / o["ms"] for t, o in zip(theirs, ours)),
                "pypbd_error": max(r["error"] for r in theirs),
                "sutura_error": max(r["error"] for r in ours),
                "pypbd_end": theirs[0]["end"],
            }
        )
    if args.json:
        print(json.dumps({"machine": machine, "pypbd": PYPBD, "rows": rows}, indent=2))
        return
    print(f"{machine}; pypbd {PYPBD}, one core; ms a frame, medians of {args.rounds} alternating rounds of {args.frames} frames")
    print(f"{'elements':>8} {'pypbd':>9} {'sutura':>9} {'times faster':>13} {'gap / length':>13} {'elongation':>11}")
    for r in rows:
        print(f"{r['elements']:>8} {r['pypbd_ms']:>9.3f} {r['sutura_ms']:>9.3f} {r['times']:>13.1f} {r['pypbd_error']:>13.1e} {r['sutura_error']:>11.1e}")


if __name__ == "__main__":
    main()
