"""Force that draws an overhand knot, by a routine that shares nothing with the engine: the reference of section 10 of docs/validation.md.

A polyline with the bending energy of second differences and the stretching energy of its edges, self-contact as a penalty between
particles and edges, Coulomb friction at the centerline, regularized over a small slip, with normal forces of the iteration before. The
ends are moved apart in steps (and back again), each solved by Newton's method. No shear, no twist, no inertia, no arms of friction.
Lengths are over the radius h of the thread, forces over EI / h^2; EA h^2 / EI = 4 as of a solid round rod.

    python3 scripts/knot_reference.py --mu 0.3            about three minutes; needs numpy and scipy
    python3 scripts/knot_reference.py --mu 0.1 --loosen   and back again
"""

import argparse

import numpy as np
from scipy.sparse import coo_matrix, diags, identity, kron
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

STRETCH = 4.0
CONTACT = 1.0  # penalty per length of thread: overlaps stay below 0.5 % of a diameter up to eps = 0.3
SLIP = 0.02  # slip over which friction grows, 2 % of what a step moves
SKIP = 8.0  # arc length below which two places of the thread are neighbors
DRAG = 3e-9  # per particle and displacement in a step: settles what has no stiffness
SIGMA = 0.492  # of the limit for small eps (Audoly, Clauvelin and Neukirch 2007)


def loose_knot(eps: float, tail: float, spacing: float) -> np.ndarray:
    """Two strands once around each other, closed by a flat loop of two half circles and a straight piece; tails along x."""
    radius = 1.0 / eps**2
    length = 2.0 * np.pi * np.sqrt(np.sqrt(12.0) * radius)
    x = np.linspace(-0.5, 0.5, 400) * length
    turn = 2.0 * np.pi * (x / length + 0.5)
    helix = np.column_stack((x, 1.5 * np.cos(turn), 1.5 * np.sin(turn)))
    t = np.linspace(0.0, np.pi, 200)[1:-1]
    right = np.column_stack((0.5 * length + radius * np.sin(t), 0 * t, radius * (1.0 - np.cos(t))))
    left = np.column_stack((-0.5 * length - radius * np.sin(t), 0 * t, radius * (1.0 + np.cos(t))))
    loop = np.vstack((right, left))
    u = np.linspace(0.0, 1.0, len(loop))
    loop[:, 1] = 1.5 * (1.0 - 2.0 * u * u * (3.0 - 2.0 * u))
    line = np.linspace(tail, 0.0, 300)[:-1, None] * np.array([1.0, 0.0, 0.0])
    p = np.vstack((helix[0] - line, helix, loop, helix * [1.0, -1.0, -1.0], helix[-1] * [1.0, -1.0, -1.0] + line[::-1]))
    arc = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))))
    fine = np.linspace(0.0, arc[-1], 4 * round(arc[-1] / spacing) + 1)
    q = np.column_stack([np.interp(fine, arc, p[:, k]) for k in range(3)])
    window = np.hanning(33) / np.hanning(33).sum()
    padded = np.pad(q, ((16, 16), (0, 0)), mode="reflect", reflect_type="odd")
    return np.column_stack([np.convolve(padded[:, k], window, "valid") for k in range(3)])[::4]


class Knot:
    def __init__(self, x: np.ndarray):
        self.x, self.n = x, len(x)
        self.l = np.linalg.norm(np.diff(x, axis=0), axis=1).mean()
        second = diags([1, -2, 1], [0, 1, 2], shape=(self.n - 2, self.n))
        self.bend = kron(second.T @ second / self.l**3, identity(3)).tocsc()
        self.free = np.arange(3, 3 * self.n - 3)
        self.friction = None

    def pairs(self, x):
        """Particles and edges that may touch."""
        n, near = self.n, cKDTree(x).query_pairs(2.5 + 1.2 * self.l, output_type="ndarray")
        near = near[(near[:, 1] - near[:, 0]) * self.l > SKIP]
        i, j = np.concatenate((near, near[:, ::-1])).T
        i, j = np.concatenate((i, i)), np.concatenate((j, j - 1))
        key = np.unique((i * n + j)[(j >= 0) & (j < n - 1)])
        return key // n, key % n

    def contacts(self, x, i, j):
        """Of each particle's edges those nearest among their neighbors, if they overlap: (i, j, place, normal, overlap)."""
        w = x[j + 1] - x[j]
        t = np.clip(((x[i] - x[j]) * w).sum(1) / (w * w).sum(1), 0.0, 1.0)
        d = x[i] - x[j] - t[:, None] * w
        r = np.linalg.norm(d, axis=1)
        key = i * self.n + j

        def at(k):
            p = np.minimum(np.searchsorted(key, k), len(key) - 1)
            return np.where(key[p] == k, r[p], np.inf)

        on = (r < 2.0) & (r <= at(key - 1)) & (r < at(key + 1))
        return i[on], j[on], t[on], d[on] / r[on][:, None], 2.0 - r[on]

    def assemble(self, x, start, near, mu, drag, hessian=True):
        n, l = self.n, self.l
        grad = (self.bend @ x.ravel()).reshape(n, 3)
        energy = 0.5 * (x * grad).sum()
        blocks = []
        edge = np.diff(x, axis=0)
        length = np.linalg.norm(edge, axis=1)
        t, strain, e = edge / length[:, None], length / l - 1.0, np.arange(n - 1)
        energy += 0.5 * STRETCH * l * (strain**2).sum()
        grad[:-1] -= STRETCH * strain[:, None] * t
        grad[1:] += STRETCH * strain[:, None] * t
        if hessian:
            tt = t[:, :, None] * t[:, None, :]
            k = STRETCH / l * tt + (STRETCH * np.maximum(strain, 0.0) / length)[:, None, None] * (np.eye(3) - tt)
            blocks += [(e, e, k), (e + 1, e + 1, k), (e, e + 1, -k), (e + 1, e, -k)]

        def spread(i, j, s, force, matrix):
            sides = ((i, np.ones_like(s)), (j, s - 1.0), (j + 1, -s))
            for a, wa in sides:
                np.add.at(grad, a, wa[:, None] * force)
                if hessian:
                    blocks.extend((a, b, (wa * wb)[:, None, None] * matrix) for b, wb in sides)

        k = CONTACT * l
        i, j, s, normal, overlap = self.contacts(x, *near)
        energy += 0.5 * k * (overlap**2).sum()
        spread(i, j, s, -(k * overlap)[:, None] * normal, k * normal[:, :, None] * normal[:, None, :])
        if mu > 0.0 and self.friction is not None:
            i, j, s, normal, overlap = self.friction
            limit, moved = mu * k * overlap, x - start
            slip = moved[i] - (1.0 - s)[:, None] * moved[j] - s[:, None] * moved[j + 1]
            slip -= (slip * normal).sum(1)[:, None] * normal
            size = np.sqrt((slip**2).sum(1) + SLIP**2)
            energy += (limit * size).sum()
            across = np.eye(3) - normal[:, :, None] * normal[:, None, :] - slip[:, :, None] * slip[:, None, :] / (size**2)[:, None, None]
            spread(i, j, s, (limit / size)[:, None] * slip, (limit / size)[:, None, None] * across)
        energy += 0.5 * drag * ((x - start) ** 2).sum()
        grad = (grad + drag * (x - start)).ravel()
        if not hessian:
            return energy, grad, None
        entry = np.arange(3)
        rows = np.concatenate([(3 * a[:, None, None] + entry[:, None] + 0 * entry).ravel() for a, _, _ in blocks])
        columns = np.concatenate([(3 * b[:, None, None] + entry + 0 * entry[:, None]).ravel() for _, b, _ in blocks])
        values = np.concatenate([m.ravel() for _, _, m in blocks])
        matrix = coo_matrix((values, (rows, columns)), shape=(3 * n, 3 * n)).tocsc() + self.bend + drag * identity(3 * n)
        return energy, grad, matrix.tocsc()

    def settle(self, start, mu, drag):
        """Newton's method with a line search, from the present positions."""
        near, moved = self.pairs(self.x), 0.0
        for _ in range(40):
            energy, grad, matrix = self.assemble(self.x, start, near, mu, drag)
            step = np.zeros(3 * self.n)
            step[self.free] = -splu(matrix[self.free][:, self.free].tocsc()).solve(grad[self.free])
            largest, slope = np.abs(step).max(), grad @ step
            scale = min(1.0, 0.5 / largest)
            while scale > 1e-3:
                ahead = self.x + scale * step.reshape(-1, 3)
                if self.assemble(ahead, start, near, mu, drag, False)[0] <= energy + 1e-4 * scale * slope + 1e-13:
                    break
                scale *= 0.5
            self.x = self.x + scale * step.reshape(-1, 3)
            moved += largest * scale
            if largest * scale < 1e-5:
                break
            if moved > 0.25:
                near, moved = self.pairs(self.x), 0.0
        return near

    def move(self, by, mu, drag=None):
        """Moves each end by half of `by` along x; (eps, force, sum of normal forces)."""
        start = self.x.copy()
        self.x[0, 0] -= 0.5 * by
        self.x[-1, 0] += 0.5 * by
        drag = DRAG * self.l if drag is None else drag
        for _ in range(2 if mu > 0.0 else 1):
            self.friction = self.contacts(self.x if _ else start, *self.pairs(self.x if _ else start))
            near = self.settle(start, mu, drag)
        _, grad, _ = self.assemble(self.x, start, near, mu, 0.0, False)
        t = np.diff(self.x, axis=0)
        t /= np.linalg.norm(t, axis=1)[:, None]
        curvature = np.linalg.norm(np.diff(t, axis=0), axis=1)[4:-4].max() / self.l
        press = CONTACT * self.l * self.contacts(self.x, *near)[4].sum()
        return np.sqrt(curvature), 0.5 * (grad[-3] - grad[0]), press


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--mu", type=float, default=0.0)
    parser.add_argument("--eps", type=float, nargs=2, default=(0.115, 0.32), help="loosest and tightest")
    parser.add_argument("--spacing", type=float, default=1.4)
    parser.add_argument("--loosen", action="store_true")
    args = parser.parse_args()
    knot = Knot(loose_knot(args.eps[0], 150.0, args.spacing))
    for _ in range(60):
        knot.move(0.0, 0.0, 1e-4 * knot.l)
    runs = {"tighten": []}
    while not runs["tighten"] or runs["tighten"][-1][0] < args.eps[1]:
        runs["tighten"].append(knot.move(min(2.0, 0.3 / runs["tighten"][-1][0] if runs["tighten"] else 2.0), args.mu))
    if args.loosen:
        runs["loosen"] = []
        while (not runs["loosen"] or runs["loosen"][-1][0] > 1.05 * args.eps[0]) and len(runs["loosen"]) < 400:
            runs["loosen"].append(knot.move(-2.0, args.mu))
    print("law     eps    F h^2/EI     over limit   sum N h^2 / (EI eps^3)")
    for name, rows in runs.items():
        eps, force, press = np.array(rows).T
        use = (force > 0.0) & (np.arange(len(eps)) > 20)
        # Corners of polylines that slide over each other make the force uneven: a cubic through its logarithm.
        fit = np.polyfit(np.log(eps[use]), np.log(force[use]), 3)
        normal = np.polyfit(np.log(eps[use]), np.log(press[use]), 2)
        for e in (0.125, 0.15, 0.2, 0.25, 0.3):
            f = np.exp(np.polyval(fit, np.log(e)))
            limit = 0.5 * e**4 + (1.0 if name == "tighten" else -1.0) * args.mu * SIGMA * e**3
            print(f"{name}  {e:.3f}  {f:.4e}  {f / limit:8.3f}  {np.exp(np.polyval(normal, np.log(e))) / e**3:8.3f}")
        spread = np.std(np.log(force[use]) - np.polyval(fit, np.log(eps[use])))
        print(f"{name}: {use.sum()} steps, {100 * spread:.1f} % about the fit", flush=True)


if __name__ == "__main__":
    main()
