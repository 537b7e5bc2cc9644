# Bodies that move along lines: every degree of freedom is a coordinate with its mass, every place of a connector a spring, damper and
# law between two of them (x = q_to - q_from). "more" as ("force", function of x and v), ("slider", stiffness, limit), ("branch", stiffness,
# relaxation time [s]), ("mass", kg).


class Slider:
    """A spring in series with a slider: the force of the last accepted step is the state."""

    def __init__(self, k, limit):
        self.k, self.limit, self.x0, self.f0, self.now = k, limit, 0.0, 0.0, (0.0, 0.0)

    def force(self, x):
        self.now = (x, min(max(self.f0 + self.k * (x - self.x0), -self.limit), self.limit))
        return self.now[1]

    def accept(self):
        self.x0, self.f0 = self.now


def branches(more):
    return tuple(law[1:] for law in more if law[0] == "branch")


def groups():
    """Different sets of branches that act somewhere."""
    return sorted({branches(c[5]) for c in CONNECTORS} - {()})


def build(loaded, small=False, unit=None):
    """The mechanism; for small motion friction sticks. Branches carry nothing at rest; with unit = (branches, stiffness) a spring stands
    where these are."""
    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    fixed = mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=mbs.AddNode(NodePointGround()), coordinate=0))
    own = {dof: mass for dof, mass in DOFS}
    for name, first, second, stiffness, damping, more in CONNECTORS:
        for law in (l for l in more if l[0] == "mass"):
            if first is not None and second is not None:
                raise SystemExit(f"{name}: a mass between two bodies that both move")
            own[first or second] += law[1]
    nodes = {}
    for dof, mass in own.items():
        nodes[dof] = mbs.AddNode(Node1D(referenceCoordinates=[0.0]))
        mbs.AddObject(Mass1D(physicsMass=mass, nodeNumber=nodes[dof]))
    markers = {dof: mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=n, coordinate=0)) for dof, n in nodes.items()}
    markers[None] = fixed
    sliders = []
    for name, first, second, stiffness, damping, more in CONNECTORS:
        laws = []
        for law in more:
            if law[0] == "force":
                laws.append(law[1])
            elif law[0] == "slider":
                if not small:
                    sliders.append(Slider(*law[1:]))
                    laws.append(lambda x, v, s=sliders[-1]: s.force(x))
                else:
                    stiffness += law[1]
        if unit and branches(more) == unit[0]:
            stiffness += unit[1]
        function = 0
        if laws:

            def function(mbs, t, item, u, v, k, d, offset, K=stiffness, C=damping, laws=laws):
                return K * u + C * v + sum(law(u, v) for law in laws)

        mbs.AddObject(CoordinateSpringDamper(markerNumbers=[markers[first], markers[second]], stiffness=stiffness, damping=damping,
                                             springForceUserFunction=function))
    if loaded:
        for dof, path in LOADS:
            values = [0.0] + path

            def size(mbs, t, load, values=values):
                k = min(int(t), len(values) - 2)
                return values[k] + (values[k + 1] - values[k]) * min(t - k, 1.0)

            mbs.AddLoad(LoadCoordinate(markerNumber=markers[dof], load=1.0, loadUserFunction=size))
    sensor = lambda n: mbs.AddSensor(SensorNode(nodeNumber=n, outputVariableType=exu.OutputVariableType.Coordinates))
    sensors = {dof: sensor(n) for dof, n in nodes.items()}
    if sliders:
        mbs.SetPreStepUserFunction(lambda mbs, t: [s.accept() for s in sliders] and True)
    mbs.Assemble()
    return mbs, sensors


def displacements(mbs, sensors):
    """Of every degree of freedom [m, rad]."""
    return {dof: float(np.atleast_1d(mbs.GetSensorValues(s))[0]) for dof, s in sensors.items()}
