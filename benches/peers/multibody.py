"""The chain of 22 rigid parts of src/core/engine/space_peers.rs in Exudyn: the numbers that test holds the engines to.

Natural frequencies at rest, static deflection under 80 and 138.3 N, a transient, and the time of an implicit step.
    /path/to/python benches/peers/multibody.py
"""
import json
import math
import sys
import time

import exudyn as exu
import numpy as np
from exudyn.utilities import *  # noqa: F403

from chain22 import ARCS, DENSITY, LOADED, N, THICKNESS, WIDTH, axes, curve, stiffness


def build(force, tau=0.0):
    """The chain on a pin and a closed shelf with a force [N] along x on part 11; damping is tau [s] times the rotational stiffness."""
    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    length = sum(r * q for r, q in ARCS)
    step = length / N
    mass = DENSITY * WIDTH * THICKNESS * step
    square = np.array([THICKNESS, step, WIDTH]) ** 2 * mass / 12
    principal = np.diag([square[1] + square[2], square[0] + square[2], square[0] + square[1]])
    ground = mbs.AddObject(ObjectGround())
    bodies, origins = [], []
    for k in range(N):
        centre, heading = curve((k + 0.5) * step)
        A = axes(heading)
        # The first part turns about the pin, the last one slides with its end: their origins are there.
        origin = curve(0.0)[0] if k == 0 else (curve(length)[0] if k == N - 1 else centre)
        inertia = RigidBodyInertia(mass=mass, inertiaTensor=A @ principal @ A.T).Translated(centre - origin)
        bodies.append(mbs.CreateRigidBody(inertia=inertia, referencePosition=origin, nodeType=exu.NodeType.RotationRxyz))
        origins.append(origin)
    def marker(body, at):
        return mbs.AddMarker(MarkerBodyRigid(bodyNumber=body, localPosition=at))
    for k in range(1, N):
        point, heading = curve(k * step)
        A = axes(heading)
        K = np.diag(stiffness(k))
        C = tau * np.diag([0, 0, 0, 1, 1, 1]) * K
        m = [marker(bodies[k - 1], point - origins[k - 1]), marker(bodies[k], point - origins[k])]
        mbs.AddObject(RigidBodySpringDamper(markerNumbers=m, stiffness=K, damping=C, rotationMarker0=A, rotationMarker1=A))
    # Coordinates are held one by one: a joint away from the origin would lose its geometric stiffness in the eigenvalues.
    fixed = mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=mbs.AddNode(NodePointGround()), coordinate=0))
    for body, held in ((0, (0, 1, 2, 3, 4)), (N - 1, (0, 2, 3, 4))):
        node = mbs.GetObjectParameter(bodies[body], "nodeNumber")
        for c in held:
            mbs.AddObject(CoordinateConstraint(markerNumbers=[fixed, mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=c))]))
    m = marker(bodies[LOADED - 1], [0, 0, 0])
    if callable(force):
        mbs.AddLoad(Force(markerNumber=m, loadVector=[1, 0, 0], loadVectorUserFunction=lambda mbs, t, v: [force(t), 0, 0]))
    else:
        mbs.AddLoad(Force(markerNumber=m, loadVector=[force, 0, 0]))
    sensor = lambda body, at: mbs.AddSensor(SensorBody(bodyNumber=body, localPosition=at, outputVariableType=exu.OutputVariableType.Displacement))
    sensors = [sensor(bodies[LOADED - 1], [0, 0, 0]), sensor(bodies[N - 1], [0, 0, 0])]
    mbs.Assemble()
    return mbs, sensors


def statics(mbs, steps):
    s = exu.SimulationSettings()
    s.staticSolver.numberOfLoadSteps = steps
    s.staticSolver.newton.relativeTolerance = 1e-7
    s.staticSolver.newton.absoluteTolerance = 1e-4
    s.staticSolver.verboseMode = 0
    mbs.SolveStatic(s)


def frequencies(mbs):
    values, _ = mbs.ComputeODE2Eigenvalues()
    values = np.sort(np.real(values))[:6]
    return list(np.sign(values) * np.sqrt(np.abs(values)) / (2 * math.pi))


def read(mbs, sensors):
    p, tip = (mbs.GetSensorValues(s) for s in sensors)
    return [p[0], p[1], tip[1]]


TAU = 2e-5
DURATION = 0.012
push = lambda t: 138.3 * math.sin(2 * math.pi * t / DURATION) ** 2 * (1 if t < 0.5 * DURATION else -1)


def main():
    out = {}
    mbs, sensors = build(0.0)
    out["frequencies_at_rest"] = frequencies(mbs)
    for force in (80.0, 138.3, -138.3):
        mbs, sensors = build(force)
        statics(mbs, 20)
        out[f"deflection_{force}"] = read(mbs, sensors)

    for steps in (600, 2400, 9600):
        mbs, sensors = build(push, TAU)
        s = exu.SimulationSettings()
        s.timeIntegration.numberOfSteps = steps
        s.timeIntegration.endTime = DURATION
        s.timeIntegration.generalizedAlpha.spectralRadius = 0.7
        s.timeIntegration.newton.useModifiedNewton = False
        s.timeIntegration.newton.relativeTolerance = 1e-7
        s.timeIntegration.newton.absoluteTolerance = 1e-4
        s.timeIntegration.verboseMode = 0
        s.solutionSettings.writeSolutionToFile = False
        s.solutionSettings.sensorsWritePeriod = DURATION / 600
        trace = []
        # Called before a step: what it reads is the end of the step before.
        mbs.SetPreStepUserFunction(lambda m, t: (trace.append((t - DURATION / steps, *read(m, sensors))), True)[1])
        mbs.SolveDynamic(s)
        trace.append((DURATION, *read(mbs, sensors)))
        out[f"transient_{steps}"] = [[round(t, 9), *v] for t, *v in trace if abs(t / DURATION * 12 - round(t / DURATION * 12)) < 1e-6][1:]

    # Time of an implicit step, without Python callbacks: a constant load.
    for modified in (False, True):
        mbs, sensors = build(60.0, TAU)
        s.timeIntegration.numberOfSteps = 1000
        s.timeIntegration.newton.useModifiedNewton = modified
        start = time.process_time()
        mbs.SolveDynamic(s)
        out[f"microseconds_per_step_{'modified' if modified else 'full'}_newton"] = (time.process_time() - start) * 1e3
    json.dump(out, sys.stdout, indent=1)


if __name__ == "__main__":
    main()
