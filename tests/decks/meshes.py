"""Meshes for tests: spheres of triangles, bodies of a formula, irregular grains, and their files."""
import struct

import numpy as np


def icosphere(level):
    """Points on the unit sphere and triangles, 20 * 4^level of them."""
    t = (1 + 5**0.5) / 2
    points = [(-1, t, 0), (1, t, 0), (-1, -t, 0), (1, -t, 0), (0, -1, t), (0, 1, t), (0, -1, -t), (0, 1, -t),
              (t, 0, -1), (t, 0, 1), (-t, 0, -1), (-t, 0, 1)]
    faces = np.array([(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2),
                      (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5),
                      (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)])
    points = np.array(points, dtype=float)
    points /= np.linalg.norm(points, axis=1)[:, None]
    for _ in range(level):
        edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        unique, index = np.unique(edges, axis=0, return_inverse=True)
        middle = points[unique].sum(axis=1)
        middle /= np.linalg.norm(middle, axis=1)[:, None]
        a, b, c = len(points) + index.reshape(3, -1)
        points = np.vstack([points, middle])
        i, j, k = faces.T
        faces = np.concatenate([np.stack(x, axis=1) for x in ((i, a, c), (a, j, b), (c, b, k), (a, b, c))])
    return points, faces


def grain(seed, level, rough=0.35, axes=(1.4, 1.0, 0.7)):
    """A star-shaped irregular grain: exp of a sum of plane waves of falling amplitude, stretched."""
    random = np.random.default_rng(seed)
    points, faces = icosphere(level)
    height = np.zeros(len(points))
    for _ in range(60):
        direction = random.normal(size=3)
        direction /= np.linalg.norm(direction)
        wave = 1 + 9 * random.random()
        height += rough / wave**1.5 * random.normal() * np.cos(wave * points @ direction + 2 * np.pi * random.random())
    return np.exp(height)[:, None] * points * np.array(axes), faces


def prism(sides, radius=1.0, half_height=1.0):
    """Right prism over a regular polygon: a cylinder's mesh where there are many sides."""
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    points = np.vstack([np.c_[ring, np.full(sides, -half_height)], np.c_[ring, np.full(sides, half_height)],
                        [[0, 0, -half_height], [0, 0, half_height]]])
    faces = []
    for k in range(sides):
        n = (k + 1) % sides
        faces += [(k, n, sides + n), (k, sides + n, sides + k), (n, k, 2 * sides), (sides + k, sides + n, 2 * sides + 1)]
    return points, np.array(faces)


def cone(sides, radius=1.0, height=2.0):
    angle = 2 * np.pi * np.arange(sides) / sides
    points = np.vstack([np.c_[radius * np.cos(angle), radius * np.sin(angle), np.zeros(sides)], [[0, 0, 0], [0, 0, height]]])
    following = (np.arange(sides) + 1) % sides
    own = np.arange(sides)
    return points, np.concatenate([np.c_[following, own, np.full(sides, sides)], np.c_[own, following, np.full(sides, sides + 1)]])


def halves(quadrilaterals):
    """Two triangles of each."""
    return [face for a, b, c, d in quadrilaterals for face in ((a, b, c), (a, c, d))]


def turned(points, seed):
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q *= np.sign(np.linalg.det(q))
    return points @ q.T


def volume(points, faces):
    a, b, c = (points[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def binary_stl(points, faces):
    """Bytes of a binary STL file."""
    record = np.zeros(len(faces), dtype=[("numbers", "<f4", (12,)), ("attribute", "<u2")])
    record["numbers"][:, 3:] = points[faces].reshape(len(faces), 9)
    return b"binary".ljust(80) + struct.pack("<I", len(faces)) + record.tobytes()


def ascii_stl(points, faces):
    lines = ["solid test"]
    for face in faces:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += ["vertex {!r} {!r} {!r}".format(*map(float, points[k])) for k in face]
        lines += ["endloop", "endfacet"]
    return "\n".join(lines + ["endsolid test"]) + "\n"


def obj(points, faces):
    return "".join("v {!r} {!r} {!r}\n".format(*map(float, p)) for p in points) + "".join(
        "f {} {} {}\n".format(*(face + 1)) for face in faces)


def ply(points, faces, order=None):
    """ASCII, or binary with order '<' or '>'."""
    kind = {None: "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[order]
    header = (f"ply\nformat {kind} 1.0\nelement vertex {len(points)}\nproperty double x\nproperty double y\n"
              f"property double z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n")
    if order is None:
        return header + "".join("{!r} {!r} {!r}\n".format(*map(float, p)) for p in points) + "".join(
            "3 {} {} {}\n".format(*face) for face in faces)
    rows = np.zeros(len(faces), dtype=[("count", "u1"), ("corners", order + "i4", (3,))])
    rows["count"], rows["corners"] = 3, faces
    return header.encode() + points.astype(order + "f8").tobytes() + rows.tobytes()
