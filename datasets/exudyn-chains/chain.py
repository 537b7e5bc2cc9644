"""A chain of rigid parts in the plane, built and integrated by Exudyn.

Every part is an ObjectRigidBody2D with the coordinates x, y of a reference point and psi. Interfaces are RigidBodySpringDampers along
x and y of the connector; bending is a CoordinateSpringDamper between the angles psi. The first part has its reference point at the
pin (held by Lagrange multipliers), the last one at the tip; the shelf, the device and the load act on single coordinates.
Units are SI throughout. Axes: x across the blade, positive the way the load presses; y from the pin to the tip; psi about z.
"""
import math

import exudyn as exu
import numpy as np
from exudyn.itemInterface import (CoordinateConstraint, CoordinateSpringDamper, LoadCoordinate, Mass1D, MarkerBodyRigid, MarkerNodeCoordinate,
                                  Node1D, NodePointGround, NodeRigidBody2D, ObjectRigidBody2D, RigidBodySpringDamper, SensorNode)

# Axis of a place among the coordinates of a node.
COORDINATE = {"x": 0, "y": 1, "psi": 2}


class Geometry:
    """Arcs of one common tangent, `n` parts of equal length; pin at the origin, tip at x = 0."""

    def __init__(self, n, arcs):
        self.n, self.arcs = n, arcs
        self.length = sum(r * abs(a) for r, a in arcs)
        self.heading = 0.0
        end, _ = self.at(self.length)
        self.heading = math.pi / 2 - math.atan2(end[1], end[0])
        self.step = self.length / n
        self.centres = [self.at((k + 0.5) * self.step)[0] for k in range(n)]
        self.interfaces = [self.at(k * self.step) for k in range(1, n)]
        self.tip = self.at(self.length)[0]

    def at(self, s):
        """Point and heading at the distance s along the arcs; a positive angle turns left."""
        x = y = 0.0
        heading = self.heading
        for k, (radius, angle) in enumerate(self.arcs):
            part = min(s, radius * abs(angle)) if k + 1 < len(self.arcs) else s
            side = math.copysign(radius, angle)
            turned = heading + part / side
            x += side * (math.sin(turned) - math.sin(heading))
            y -= side * (math.cos(turned) - math.cos(heading))
            heading, s = turned, s - part
            if s <= 0:
                break
        return np.array([x, y]), heading


class Rig:
    """The mechanism of one test. `base`: parameters by name; `hidden`: pairs (law, places), places as ("GF", j), ("shelf", "y") ..."""

    def __init__(self, geometry, fixed, base, hidden, load):
        self.g, self.fixed, self.base = geometry, fixed, base
        self.container = exu.SystemContainer()
        self.mbs = self.container.AddSystem()
        self.elements, self.mode = [], "dynamic"
        self.load = load
        self._bodies()
        self._connectors()
        for law, places in hidden:
            for place in places:
                self._hidden(law, place)
        f = LoadCoordinate(markerNumber=self._marker(fixed["P"], 0), load=1.0, loadUserFunction=lambda mbs, t, load: self.load(t))
        self.mbs.AddLoad(f)
        self.sensors = [
            self.mbs.AddSensor(SensorNode(nodeNumber=self.nodes[b], storeInternal=True, outputVariableType=exu.OutputVariableType.Coordinates))
            for b in (fixed["P"], fixed["Q1"], self.g.n - 1)
        ]
        self.mbs.SetPreStepUserFunction(self._accept)
        self.mbs.Assemble()
        self.index = [self.mbs.GetNodeODE2Index(n) for n in self.nodes]

    def _bodies(self):
        g, mbs = self.g, self.mbs
        self.ground = mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=mbs.AddNode(NodePointGround()), coordinate=0))
        self.nodes, self.bodies, self.origins = [], [], []
        for k, centre in enumerate(g.centres):
            origin = {0: np.zeros(2), g.n - 1: g.tip}.get(k, centre)
            node = mbs.AddNode(NodeRigidBody2D(referenceCoordinates=[*origin, 0.0]))
            arm = centre - origin
            # Exudyn counts the inertia about the reference point.
            inertia = self.fixed["inertia"] + self.fixed["mass"] * float(arm @ arm)
            body = ObjectRigidBody2D(mass=self.fixed["mass"], inertia=inertia, centerOfMass=list(arm), nodeNumber=node)
            self.bodies.append(mbs.AddObject(body))
            self.nodes.append(node)
            self.origins.append(origin)
        for axis in (0, 1):
            mbs.AddObject(CoordinateConstraint(markerNumbers=[self.ground, self._marker(0, axis)]))

    def _marker(self, body, coordinate):
        return self.mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=self.nodes[body], coordinate=coordinate))

    def _connectors(self):
        g, mbs, fixed, base = self.g, self.mbs, self.fixed, self.base
        for j, (point, heading) in enumerate(g.interfaces):
            s, c = math.sin(heading), math.cos(heading)
            axes = np.array([[s, c, 0.0], [-c, s, 0.0], [0.0, 0.0, 1.0]])
            ends = [mbs.AddMarker(MarkerBodyRigid(bodyNumber=self.bodies[b], localPosition=[*(point - self.origins[b]), 0.0])) for b in (j, j + 1)]
            stiffness = np.diag([fixed["k_x"], fixed["k_y"], 0.0, 0.0, 0.0, 0.0])
            mbs.AddObject(RigidBodySpringDamper(markerNumbers=ends, stiffness=stiffness, damping=np.zeros((6, 6)), rotationMarker0=axes, rotationMarker1=axes))
            group = "ends" if j + 1 in fixed["ends"] else "middle"
            self._spring(("GF", j + 1), base["k_" + group], base["c_" + group])
        self._spring(("shelf", "x"), fixed["k_shelf"], 0.0)
        self._spring(("shelf", "y"), 0.0, base["c_shelf"])
        self._spring(("device", "x"), base["k_device"], base["c_device"])

    def ends(self, place):
        """Bodies and coordinate between which a place acts; None is the ground."""
        if place[0] == "GF":
            return place[1] - 1, place[1], 2
        body = self.g.n - 1 if place[0] == "shelf" else self.fixed["P"]
        return None, body, COORDINATE[place[1]]

    def _markers(self, place):
        a, b, axis = self.ends(place)
        return [self.ground if a is None else self._marker(a, axis), self._marker(b, axis)]

    def _spring(self, place, k, c):
        self.mbs.AddObject(CoordinateSpringDamper(markerNumbers=self._markers(place), stiffness=k, damping=c))

    def _hidden(self, law, place):
        law = type(law)(law.name, law.strength, **law.shape)
        self.elements.append((law, place))
        if law.name == "added_mass":
            node = self.mbs.AddNode(Node1D(referenceCoordinates=[0.0]))
            self.mbs.AddObject(Mass1D(physicsMass=law.strength, nodeNumber=node))
            own = self.mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=0))
            self.mbs.AddObject(CoordinateConstraint(markerNumbers=[own, self._markers(place)[1]]))
            return

        def force(mbs, t, item, x, v, k, c, offset):
            return {"dynamic": lambda: law.force(x, v), "static": lambda: law.static(x), "held": lambda: law.held}[self.mode]()

        self.mbs.AddObject(CoordinateSpringDamper(markerNumbers=self._markers(place), stiffness=0.0, damping=0.0, springForceUserFunction=force))

    def _across(self, place, q):
        a, b, axis = self.ends(place)
        return float(q[self.index[b] + axis] - (0.0 if a is None else q[self.index[a] + axis]))

    def _accept(self, mbs, t):
        q = mbs.systemData.GetODE2Coordinates()
        for law, place in self.elements:
            law.accept(self._across(place, q))
        return True

    def cycles(self, frequency, cycles, steps, keep=100):
        """Integrates `cycles` cycles from the unloaded chain; time, displacement of P.x, Q1.x, tip.y at `keep` points of each."""
        h = 1.0 / (frequency * steps)
        for law, _ in self.elements:
            law.reset(h)
        s = exu.SimulationSettings()
        s.timeIntegration.numberOfSteps = cycles * steps
        s.timeIntegration.endTime = cycles / frequency
        s.timeIntegration.adaptiveStep = False
        s.timeIntegration.generalizedAlpha.spectralRadius = 0.5
        s.timeIntegration.newton.useModifiedNewton = True
        s.timeIntegration.newton.relativeTolerance = 1e-7
        s.timeIntegration.newton.absoluteTolerance = 1e-7
        s.solutionSettings.writeSolutionToFile = False
        s.solutionSettings.sensorsWritePeriod = 1.0 / (frequency * keep)
        s.linearSolverType = exu.LinearSolverType.EigenSparse
        s.timeIntegration.verboseMode = 0
        self.mbs.SolveDynamic(s)
        stored = [self.mbs.GetSensorStoredData(k) for k in self.sensors]
        if len(stored[0]) < cycles * keep + 1:
            raise RuntimeError(f"Exudyn stored {len(stored[0])} samples of {cycles * keep + 1}")
        columns = (1, 1, 2)
        return stored[0][:, 0], np.array([d[:, c] for d, c in zip(stored, columns)])

    def equilibrium(self):
        """Loads from zero in steps; friction moves as it is loaded, what relaxes carries nothing."""
        self.mode = "static"
        for law, _ in self.elements:
            law.reset(1.0)
        s = exu.SimulationSettings()
        s.staticSolver.numberOfLoadSteps = 40
        s.staticSolver.newton.relativeTolerance = 1e-7
        s.staticSolver.newton.absoluteTolerance = 1e-7
        s.staticSolver.verboseMode = 0
        s.solutionSettings.writeSolutionToFile = False
        s.linearSolverType = exu.LinearSolverType.EigenDense
        self.mbs.SolveStatic(s, updateInitialValues=True)
        return self.mbs.systemData.GetODE2Coordinates()

    def linear(self):
        """M, K, C about the equilibrium on free coordinates, the dynamic stiffnesses of the hidden laws apart, and the coordinates' numbers."""
        q = self.equilibrium()
        self.x0 = [self._across(place, q) for _, place in self.elements]
        for (law, _), x in zip(self.elements, self.x0):
            law.held = law.static(x)
        self.mode = "held"
        M, K, C, _, N = self.mbs.ComputeLinearizedSystem(projectIntoConstraintNullspace=True, returnConstraintNullspace=True)
        return np.array(M), np.array(K), np.array(C), np.array(N).T

    def receptance(self, frequencies, at, respond):
        """x of the part `respond` per force along x on the part `at` [m/N], e^{+i w t}."""
        M, K, C, N = self.linear()
        n = N.shape[0]
        unit = lambda body, axis: np.eye(n)[self.index[body] + axis]
        rows = []
        for _, place in self.elements:
            a, b, axis = self.ends(place)
            rows.append(N.T @ (unit(b, axis) - (0.0 if a is None else unit(a, axis))))
        f, out = N.T @ unit(at, 0), N.T @ unit(respond, 0)
        H = []
        for w in 2 * np.pi * np.asarray(frequencies):
            Z = K + 1j * w * C - w * w * M
            for (law, _), row, x in zip(self.elements, rows, self.x0):
                Z = Z + law.dynamic(w, x) * np.outer(row, row)
            H.append(out @ np.linalg.solve(Z, f))
        return np.array(H)
