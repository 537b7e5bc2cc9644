# Every connector measures b - a along the axes of its first part, and the rotation between the two; its stiffness and damping are held
# as six numbers each (x, y, z, theta, phi, psi). "more" holds what is not a spring or damper: ("force", function of x and v),
# ("slider", stiffness, limit), ("branch", stiffness, relaxation time [s]), ("mass", kg). What is attached when the loads have come on
# carries none of them.
AXES = ["x", "y", "z", "theta", "phi", "psi"]


class Slider:
    """A spring in series with a slider: the force of the last accepted step is the state."""

    def __init__(self, k, limit):
        self.k, self.limit, self.x0, self.f0, self.now = k, limit, 0.0, 0.0, (0.0, 0.0)

    def force(self, x):
        self.now = (x, min(max(self.f0 + self.k * (x - self.x0), -self.limit), self.limit))
        return self.now[1]

    def accept(self):
        self.x0, self.f0 = self.now


def branches(more, axis):
    """Those of an axis."""
    return tuple(law[1:] for k, law in more if k == axis and law[0] == "branch")


def groups():
    """Different sets of branches that act somewhere."""
    return sorted({branches(c[7], axis) for c in CONNECTORS for axis in range(6)} - {()})


def build(loaded, small=False, unit=None):
    """The mechanism; for small motion friction sticks. Branches carry nothing at rest; with unit = (branches, stiffness) a spring stands
    where these are."""
    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    ground = mbs.AddObject(ObjectGround())
    fixed = mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=mbs.AddNode(NodePointGround()), coordinate=0))
    bodies, sliders = [], []
    for name, mass, origin, centre, inertia, held in PARTS:
        if len(held) == 6:
            bodies.append(None)
            continue
        body = RigidBodyInertia(mass=mass, inertiaTensor=np.array(inertia)).Translated(np.array(centre))
        bodies.append(mbs.CreateRigidBody(inertia=body, referencePosition=origin, nodeType=exu.NodeType.RotationRxyz))

    def node(part):
        return mbs.GetObjectParameter(bodies[part], "nodeNumber")

    def coordinate(part, k):
        return mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=node(part), coordinate=k))

    def marker(part, at):
        if bodies[part] is None:
            return mbs.AddMarker(MarkerBodyRigid(bodyNumber=ground, localPosition=at))
        return mbs.AddMarker(MarkerBodyRigid(bodyNumber=bodies[part], localPosition=np.array(at) - np.array(PARTS[part][2])))

    # Coordinates are held one by one: a joint away from the origin would lose its geometric stiffness in the linearisation.
    for part, (*_, held) in enumerate(PARTS):
        for k in held if bodies[part] is not None else []:
            mbs.AddObject(CoordinateConstraint(markerNumbers=[fixed, coordinate(part, k)]))
    for name, first, second, point, axes, stiffness, damping, more, attached in CONNECTORS:
        if loaded and attached:
            continue
        stiffness, damping, laws = list(stiffness), list(damping), []
        for axis, law in more:
            if law[0] == "force":
                laws.append((axis, law[1]))
            elif law[0] == "slider":
                if not small:
                    sliders.append(Slider(*law[1:]))
                    laws.append((axis, lambda x, v, s=sliders[-1]: s.force(x)))
                else:
                    stiffness[axis] += law[1]
            elif law[0] == "mass":
                own = mbs.AddNode(Node1D(referenceCoordinates=[0.0]))
                mbs.AddObject(Mass1D(physicsMass=law[1], nodeNumber=own))
                its = mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=own, coordinate=0))
                mbs.AddObject(CoordinateConstraint(markerNumbers=[its, coordinate(second, axis)]))
        for axis in range(6):
            if unit and branches(more, axis) == unit[0]:
                stiffness[axis] += unit[1]
        A = np.array(axes)
        markers = [marker(first, point), marker(second, point)]
        function = 0
        if laws:
            K, C = np.array(stiffness), np.array(damping)

            def function(mbs, t, item, u, turn, v, spin, *_, K=K, C=C, laws=laws):
                x, w = np.concatenate([u, turn]), np.concatenate([v, spin])
                f = K * x + C * w
                for axis, law in laws:
                    f[axis] += law(x[axis], w[axis])
                return list(f)

        mbs.AddObject(RigidBodySpringDamper(markerNumbers=markers, stiffness=np.diag(stiffness), damping=np.diag(damping), rotationMarker0=A,
                                            rotationMarker1=A, springForceTorqueUserFunction=function))
    if loaded:
        for part, axis, path in LOADS:
            along = [float(k == axis % 3) for k in range(3)]
            values = [0.0] + path

            def vector(mbs, t, load, values=values, along=along):
                k = min(int(t), len(values) - 2)
                size = values[k] + (values[k + 1] - values[k]) * min(t - k, 1.0)
                return [size * a for a in along]

            if axis < 3:
                mbs.AddLoad(Force(markerNumber=marker(part, PARTS[part][2]), loadVector=along, loadVectorUserFunction=vector))
            else:
                mbs.AddLoad(Torque(markerNumber=marker(part, PARTS[part][2]), loadVector=along, loadVectorUserFunction=vector))
    sensor = lambda body: mbs.AddSensor(SensorBody(bodyNumber=body, localPosition=[0, 0, 0], outputVariableType=exu.OutputVariableType.Displacement))
    sensors = [None if body is None else sensor(body) for body in bodies]
    if sliders:
        mbs.SetPreStepUserFunction(lambda mbs, t: [s.accept() for s in sliders] and True)
    mbs.Assemble()
    return mbs, sensors


def displacements(mbs, sensors):
    """Of every part's origin along fixed axes [m], by degree of freedom."""
    out = {}
    for (name, *_, held), sensor in zip(PARTS, sensors):
        if sensor is not None:
            u = mbs.GetSensorValues(sensor)
            out.update({f"{name}.{AXES[k]}": float(u[k]) for k in range(3) if k not in held})
    return out
