"""The blocker scene: a square emitter over a floor, a square blocker between them, and the floor's exact irradiance.

From a floor point p the blocker, seen on the emitter's plane, is a square again, moved and enlarged. What it leaves of
the emitter is the emitter less the intersection of the two, both convex, so E = pi L (F(emitter) - F(intersection)) with
Lambert's closed form for F (Baum, Rushmeier and Winget 1989). Nothing is sampled.
"""

import json
import struct

import numpy as np

RADIANCE = 100.0
EMITTER_HEIGHT = 1.0
FLOOR = 1.5  # metres, side
# Off the centre and askew, so that no mesh or texel lines up with the shadow by chance.
BLOCKER_CENTRE = np.array([0.083, -0.057])
BLOCKER_ANGLE = np.radians(17.0)
NEAR_SHADOW = 3.0  # side of the square in which points are compared, over the blocker's
EDGE = 0.1  # "edge" points lie no farther than this from the blocker's outline, seen from above, over its side
EMITTER = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])


def blocker_outline(side):
    half = side / 2
    c, s = np.cos(BLOCKER_ANGLE), np.sin(BLOCKER_ANGLE)
    square = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return square @ np.array([[c, s], [-s, c]]) + BLOCKER_CENTRE


def _at_height(outline, height):
    """Outline in a plane z = height, as glTF's y-up coordinates (x, z, -y)."""
    return np.column_stack([outline[:, 0], np.full(len(outline), height), -outline[:, 1]])


def write_scene(path, side, height):
    """Writes the scene as a GLB; everything else is black, so `--max-reflectance` does not matter."""
    floor = FLOOR / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    # Counter-clockwise from above faces up; the emitter's order is reversed and faces down.
    quads = [
        ("floor", _at_height(floor, 0.0), 0),
        ("blocker", _at_height(blocker_outline(side), height), 1),
        ("emitter", _at_height(EMITTER[::-1], EMITTER_HEIGHT), 2),
    ]
    black = {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0}
    gltf = {
        "asset": {"version": "2.0", "generator": "cobake tools/blocker.py"},
        "extensionsUsed": ["KHR_materials_emissive_strength"],
        "scene": 0,
        "scenes": [{"nodes": [0, 1, 2]}],
        "nodes": [],
        "meshes": [],
        "accessors": [],
        "bufferViews": [],
        "materials": [
            {"name": "floor", "pbrMetallicRoughness": black},
            {"name": "blocker", "doubleSided": True, "pbrMetallicRoughness": black},
            {
                "name": "emitter",
                "pbrMetallicRoughness": black,
                "emissiveFactor": [1, 1, 1],
                "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": RADIANCE}},
            },
        ],
    }
    data = b""
    for index, (name, corners, material) in enumerate(quads):
        corners = corners.astype("<f4")
        for bytes_, kind, component, count, target in (
            (corners.tobytes(), "VEC3", 5126, 4, 34962),
            (np.array([0, 1, 2, 0, 2, 3], "<u4").tobytes(), "SCALAR", 5125, 6, 34963),
        ):
            view = {"buffer": 0, "byteOffset": len(data), "byteLength": len(bytes_), "target": target}
            accessor = {"bufferView": len(gltf["bufferViews"]), "componentType": component, "count": count, "type": kind}
            if kind == "VEC3":
                accessor |= {"min": corners.min(0).tolist(), "max": corners.max(0).tolist()}
            gltf["bufferViews"].append(view)
            gltf["accessors"].append(accessor)
            data += bytes_
        primitive = {"attributes": {"POSITION": 2 * index}, "indices": 2 * index + 1, "material": material}
        gltf["meshes"].append({"name": name, "primitives": [primitive]})
        gltf["nodes"].append({"name": name, "mesh": index})
    gltf["buffers"] = [{"byteLength": len(data)}]
    text = json.dumps(gltf).encode()
    text += b" " * (-len(text) % 4)
    with open(path, "wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data)))
        file.write(struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data)


def _form_factor(polygon):
    """Lambert's sum for a receiver at the origin that looks up: `polygon` (n, 2) lies at the emitter's height."""
    if len(polygon) < 3:
        return 0.0
    v = np.column_stack([polygon, np.full(len(polygon), EMITTER_HEIGHT)])
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    w = np.roll(v, -1, axis=0)
    cross = np.cross(v, w)
    length = np.linalg.norm(cross, axis=1)
    angle = np.arctan2(length, (v * w).sum(1))
    return abs((angle * cross[:, 2] / np.maximum(length, 1e-300)).sum()) / (2 * np.pi)


def _clip(polygon, axis, sign, bound):
    """The part of a convex polygon with sign * x[axis] <= bound."""
    kept = []
    for here, there in zip(polygon, polygon[1:] + polygon[:1]):
        a, b = bound - sign * here[axis], bound - sign * there[axis]
        if a >= 0:
            kept.append(here)
        if (a > 0 > b) or (a < 0 < b):
            t = a / (a - b)
            kept.append((here[0] + t * (there[0] - here[0]), here[1] + t * (there[1] - here[1])))
    return kept


def exact_irradiance(points, side, height):
    """Irradiance at floor points (n, 2), lux."""
    outline = blocker_outline(side)
    result = np.empty(len(points))
    for i, p in enumerate(points):
        hidden = [tuple(corner) for corner in p + (outline - p) * (EMITTER_HEIGHT / height)]
        for axis, sign in ((0, 1), (0, -1), (1, 1), (1, -1)):
            hidden = _clip(hidden, axis, sign, 0.5)
        hidden = np.array(hidden).reshape(-1, 2) - p
        result[i] = np.pi * RADIANCE * (_form_factor(EMITTER - p) - _form_factor(hidden))
    return result


def sampled_irradiance(point, side, height, samples=400):
    """The same by brute force: the check on the closed form."""
    axis = (np.arange(samples) + 0.5) / samples - 0.5
    q = np.stack(np.meshgrid(axis, axis), -1).reshape(-1, 2)
    square_distance = ((q - point) ** 2).sum(1) + EMITTER_HEIGHT**2
    at_blocker = point + (q - point) * (height / EMITTER_HEIGHT) - BLOCKER_CENTRE
    c, s = np.cos(BLOCKER_ANGLE), np.sin(BLOCKER_ANGLE)
    local = at_blocker @ np.array([[c, -s], [s, c]])
    seen = (np.abs(local) > side / 2).any(1)
    return RADIANCE * (seen * EMITTER_HEIGHT**2 / square_distance**2).mean()


def check():
    """Stops where the closed form and brute force differ by more than the brute force's own error."""
    rng = np.random.default_rng(2)
    side = 0.2
    for height in (0.001, 0.03, 0.3, 0.9):
        points = BLOCKER_CENTRE + (rng.random((4, 2)) - 0.5) * 0.3
        for point, exact in zip(points, exact_irradiance(points, side, height)):
            sampled = sampled_irradiance(point, side, height)
            if abs(exact - sampled) > 0.002 * RADIANCE:
                raise SystemExit(f"closed form {exact} but sampled {sampled} at {point}, blocker at {height} m")


def reference_points(side, height):
    """Points with exact irradiance, in the arrays of a reference file.

    Set 0: even over a square about the blocker; set 1: near the blocker's outline, seen from above.
    """
    rng = np.random.default_rng(1)
    spread = BLOCKER_CENTRE + (rng.random((2000, 2)) - 0.5) * NEAR_SHADOW * side
    t = rng.random(2000) * 4
    outline = blocker_outline(side)
    edge, along = t.astype(int), (t % 1)[:, None]
    on_edge = outline[edge] * (1 - along) + outline[(edge + 1) % 4] * along
    points = np.concatenate([spread, on_edge + (rng.random((2000, 2)) - 0.5) * 2 * EDGE * side])
    irradiance = np.repeat(exact_irradiance(points, side, height)[:, None], 3, axis=1)
    return {
        "P": _at_height(points, 0.0),
        "N": np.tile([0.0, 1.0, 0.0], (len(points), 1)),
        "E": irradiance,
        "E_se": np.zeros_like(irradiance),
        "set": np.repeat(np.array([0, 1], np.int8), 2000),
        "buried": np.zeros(len(points), bool),
    }
