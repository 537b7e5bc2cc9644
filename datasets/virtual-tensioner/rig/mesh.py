"""Nodes, elements, contact pairs and numbering of the rig; banded assembly."""
import numpy as np

from . import beam, interface


class Mesh:
    """Blade and three leaf springs. Unknowns in order of the station along the blade, so that all matrices are banded."""

    def __init__(self, rig, per_part=2):
        self.rig = rig
        n, h = rig.count * per_part, rig.part_length / per_part
        stations = np.arange(n + 1) * h
        points, turn = rig.curve(stations)
        tangent = np.pi / 2 - turn                        # angle of the tangent to x

        def at(parts):
            k = round(parts * per_part)
            assert abs(k - parts * per_part) < 1e-9, "a named place is not a node"
            return k

        f, g = at(rig.zone_start), at(rig.zone)
        spans = [(f, g), (g, n - g), (n - g, n - f)]      # leaf at F-G, along G-H, at H-L
        # nodes: blade 0..n, then the leaves
        xy = [points.T]
        first, station = [], [np.arange(n + 1)]
        count = n + 1
        for a, b in spans:
            k = np.arange(a, b + 1)
            normal = np.stack([-np.sin(tangent[k]), np.cos(tangent[k])], axis=1)
            xy.append(points.T[k] - rig.offset * normal)
            station.append(k)
            first.append(count)
            count += len(k)
        self.xy, self.station = np.concatenate(xy), np.concatenate(station)
        # elements: node pairs; 0 blade middle, 1 blade end zone, 2 leaf
        pairs = [np.stack([np.arange(n), np.arange(1, n + 1)], axis=1)]
        kind = [np.where((np.arange(n) >= g) & (np.arange(n) < n - g), 0, 1)]
        for (a, b), start in zip(spans, first):
            k = start + np.arange(b - a)
            pairs.append(np.stack([k, k + 1], axis=1))
            kind.append(np.full(b - a, 2))
        self.pairs, self.kind = np.concatenate(pairs), np.concatenate(kind)
        d = self.xy[self.pairs[:, 1]] - self.xy[self.pairs[:, 0]]
        self.length, self.angle = np.hypot(d[:, 0], d[:, 1]), np.arctan2(d[:, 1], d[:, 0])
        # contact pairs: blade node, leaf node, tributary length, shares of friction and film, tie
        rows = []
        patch, pad = rig.patch * rig.part_length, rig.pad * rig.part_length
        for leaf, ((a, b), start) in enumerate(zip(spans, first)):
            k = np.arange(a, b + 1)
            width = np.full(len(k), h)
            width[[0, -1]] = h / 2
            x = (k - a) * h
            back = x[-1] - x
            slides, film, tie = np.zeros(len(k)), np.zeros(len(k)), np.zeros(len(k))
            if leaf == 1:
                film = overlap(x, h, pad) / pad + overlap(back, h, pad) / pad
                # held at its middle: the free slip of the middle leaf has a place to be measured from
                middle = (rig.count / 2 - rig.zone) * rig.part_length
                tie[np.argmin(np.abs(x - middle))] = rig.tie
            elif leaf == 0:
                slides, tie[-1] = rig.ends[0] * overlap(x, h, patch) / patch, rig.tie
            else:
                slides, tie[0] = rig.ends[1] * overlap(back, h, patch) / patch, rig.tie
            rows.append(np.stack([k, start + np.arange(len(k)), width, slides, film, tie], axis=1))
        rows = np.concatenate(rows)
        self.contact = rows[:, :2].astype(int)
        self.width, self.slides, self.film, self.tie = rows[:, 2:].T
        self.contact_angle = tangent[self.contact[:, 0]]
        self.node = {"pin": 0, "tip": n, "P": at(rig.drive), "Q1": at(rig.transfer[0]), "Q2": at(rig.transfer[1])}
        self.number()

    def number(self, pinned=True):
        """Equation numbers by station; -1 where held."""
        self.dofs = 3 * len(self.xy)
        held = [0, 1] if pinned else []
        order = np.lexsort((np.arange(self.dofs), np.repeat(self.station, 3)))
        order = order[~np.isin(order, held)]
        self.equation = np.full(self.dofs, -1)
        self.equation[order] = np.arange(len(order))
        self.free, self.n = order, len(order)
        self.groups = [self.indices(self.pairs), self.indices(self.contact)]
        eqs = [self.equation[g] for g in self.groups]
        self.half = max(int((np.where(e >= 0, e, -1).max(1) - np.where(e >= 0, e, self.n).min(1)).max()) for e in eqs)
        # where each entry of the element matrices goes in band storage with room for pivoting (LAPACK gbsv)
        self.rows = 3 * self.half + 1
        self.place = []
        for e in eqs:
            i, j = e[:, :, None], e[:, None, :]
            place = (2 * self.half + i - j) * self.n + j
            keep = (i >= 0) & (j >= 0)
            self.place.append((np.broadcast_to(place, keep.shape)[keep], keep))

    @staticmethod
    def indices(nodes):
        return (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), 6)

    def dof(self, name, axis):
        """Equation of a named place along x or y."""
        return self.equation[3 * self.node[name] + "xy".index(axis)]

    def band(self, blocks):
        """Band matrix of the element matrices (beams, contacts); None leaves a group out."""
        total = 0.0
        for block, (place, keep) in zip(blocks, self.place):
            if block is not None:
                v = block[keep]
                size = self.rows * self.n
                part = np.bincount(place, v.real, size)
                total = total + (part + 1j * np.bincount(place, v.imag, size) if np.iscomplexobj(v) else part)
        return total.reshape(self.rows, self.n)

    def gather(self, q, group):
        """Element coordinates (n, 6) of the displacements of all nodes, on top of the positions."""
        full = np.zeros(self.dofs)
        full[self.free] = q
        full = full.reshape(-1, 3) + np.pad(self.xy, ((0, 0), (0, 1)))
        return full.ravel()[self.groups[group]]

    def scatter(self, forces):
        """Sum of the nodal forces of both groups."""
        total = sum(np.bincount(g.ravel(), f.ravel(), self.dofs) for g, f in zip(self.groups, forces))
        return total[self.free]


def overlap(x, h, reach):
    """Length of the tributary interval of each node (h/2 to each side, cut at 0) that lies within `reach` of the end."""
    return np.clip(np.minimum(x + h / 2, reach) - np.maximum(x - h / 2, 0.0), 0.0, None)


class Properties:
    """Numbers of the elements at one interference and, where the rig knows it, one contact area of the housings."""

    def __init__(self, mesh, interference, area=None):
        rig = mesh.rig
        k, d = rig.stiffness_factor(interference), rig.damping_factor(interference)
        middle, leaf = mesh.kind == 0, mesh.kind == 2
        blade = np.where(middle, rig.ei_middle, rig.ei_end)
        self.ei = k * np.where(leaf, rig.leaf_ei, blade)
        self.loss = d * np.where(leaf, 0.0, rig.loss * blade)
        self.ea = np.where(leaf, rig.leaf_ea, rig.ea)
        self.ga = np.where(leaf, rig.leaf_ga, rig.ga)
        self.line_mass = np.where(leaf, rig.leaf_mass, rig.line_mass)
        self.line_inertia = np.where(leaf, rig.leaf_inertia, rig.line_inertia)
        self.film = d * rig.film_force * mesh.film
        limit, self.slip = rig.housing(interference, area)
        self.limit = limit * mesh.slides
        self.seat = rig.seat_stiffness * mesh.width
        self.shear = beam.corrected_shear(self.ga, self.ei, mesh.length)

    def mass(self, mesh, device):
        """Band mass matrix; the device's mass at P along x."""
        m = mesh.band([beam.mass(mesh.length, self.line_mass, self.line_inertia), None])
        if device:
            m[2 * mesh.half, mesh.dof("P", "x")] += mesh.rig.device_mass
        return m


def contact_state(mesh, q):
    rho, b, second = interface.kinematics(mesh.gather(q, 1), mesh.contact_angle)
    return rho[0], rho[1] + mesh.rig.offset, b, second
