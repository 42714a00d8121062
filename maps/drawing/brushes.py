"""Convex brushes on the integer grid, entities, and their text as VMF and Quake .map."""

NODRAW = "tools/toolsnodraw"
SKY = "tools/toolsskybox"


def sub(a, b): return (a[0] - b[0], a[1] - b[1], a[2] - b[2])
def dot(a, b): return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
def cross(a, b): return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


class Side:
    """A polygon of a brush, counter-clockwise seen from outside; three of its corners give the plane."""

    def __init__(self, corners, material, scale=0.25, lightmap=16, shift=(0, 0)):
        assert all(isinstance(c, int) for p in corners for c in p), corners
        self.corners, self.material = corners, material
        self.scale, self.lightmap, self.shift = scale, lightmap, shift
        self.displacement = None  # Displacement
        self.normal = cross(sub(corners[1], corners[0]), sub(corners[2], corners[0]))
        assert any(self.normal), corners
        assert all(dot(self.normal, sub(p, corners[0])) == 0 for p in corners), ("not flat", corners)

    def plane_points(self):  # clockwise seen from outside, as both formats want
        return self.corners[0], self.corners[2], self.corners[1]

    def axes(self):
        """Texture axes along the world axes that face the side most, as editors align them."""
        n = [abs(c) for c in self.normal]
        if n[2] >= n[0] and n[2] >= n[1]:
            return (1, 0, 0), (0, -1, 0)
        return ((0, 1, 0) if n[0] >= n[1] else (1, 0, 0)), (0, 0, -1)


class Displacement:
    """A grid of (2^power + 1)^2 vertices over a quad: move(p) gives the vector by which the point p of it is moved,
    blend(p) 0..255. Neighbours of a coarser grid have to be sewn by hand: move() has to be straight along such edges."""

    def __init__(self, power, move, blend=lambda p: 0):
        self.power, self.move, self.blend = power, move, blend

    def text(self, corners, key, out):
        n = 1 << self.power
        def at(r, c):  # rows run from corner 0 to corner 1, from there to corner 3
            u, v = c / n, r / n
            a = [p + (q - p) * v for p, q in zip(corners[0], corners[3])]
            b = [p + (q - p) * v for p, q in zip(corners[1], corners[2])]
            return [p + (q - p) * u for p, q in zip(a, b)]
        def short(x): return f"{x:.6g}" if abs(x) > 1e-9 else "0"
        grid = [[at(r, c) for c in range(n + 1)] for r in range(n + 1)]
        moves = [[self.move(p) for p in row] for row in grid]
        lengths = [[dot(m, m) ** 0.5 for m in row] for row in moves]
        out.extend(["\t\t\tdispinfo", "\t\t\t{"])
        key(4, "power", self.power)
        key(4, "startposition", f"[{vector(corners[0])}]")
        key(4, "elevation", 0)
        key(4, "subdiv", 0)
        for name, row_text in (("normals", lambda r: " ".join(" ".join(short(x / l if l else 0) for x in m) for m, l in zip(moves[r], lengths[r]))),
                               ("distances", lambda r: " ".join(short(l) for l in lengths[r])),
                               ("alphas", lambda r: " ".join(short(self.blend(p)) for p in grid[r]))):
            out.extend([f"\t\t\t\t{name}", "\t\t\t\t{"])
            for r in range(n + 1): key(5, f"row{r}", row_text(r))
            out.append("\t\t\t\t}")
        out.append("\t\t\t}")


class Brush:
    def __init__(self, sides):
        self.sides = sides
        points = [p for s in sides for p in s.corners]
        for s in sides:  # convex, and every side faces out
            assert all(dot(s.normal, sub(p, s.corners[0])) <= 0 for p in points), "not convex"


DIRECTIONS = ("x-", "x+", "y-", "y+", "z-", "z+")


def faces(material, **given):
    """Materials per direction: faces("a", zp="b") is "a" all round and "b" on top."""
    names = {d: material for d in DIRECTIONS}
    for key, value in given.items():
        names[key[0] + ("+" if key[1] == "p" else "-")] = value
    return names


def hull(bottom, top, materials, scale=0.25, lightmap=16):
    """Between two polygons of the same number of corners, counter-clockwise seen from the top one; all sides flat.
    A side takes the material of the direction it faces most, or materials["side"] where given and it is no end."""
    if isinstance(materials, str): materials = faces(materials)
    n = len(bottom)
    polygons = [list(reversed(bottom)), list(top)]
    polygons += [[bottom[i], bottom[(i + 1) % n], top[(i + 1) % n], top[i]] for i in range(n)]
    sides = []
    for number, corners in enumerate(polygons):
        normal = cross(sub(corners[1], corners[0]), sub(corners[2], corners[0]))
        axis = max((2, 0, 1), key=lambda k: abs(normal[k]))
        name = "xyz"[axis] + ("+" if normal[axis] > 0 else "-")
        material = materials["side"] if "side" in materials and number >= 2 else materials[name]
        sides.append(Side(corners, material, scale, lightmap))
    return Brush(sides)


def wedge(points, y0, y1, materials, scale=0.25, lightmap=16):
    """An outline (x, z), counter-clockwise seen from +y, drawn out along y."""
    return hull([(x, y0, z) for x, z in points], [(x, y1, z) for x, z in points], materials, scale, lightmap)


def prism(points, z0, z1, materials, scale=0.25, lightmap=16):
    return hull([(x, y, z0) for x, y in points], [(x, y, z1) for x, y in points], materials, scale, lightmap)


def box(lo, hi, materials, scale=0.25, lightmap=16):
    (x0, y0, z0), (x1, y1, z1) = lo, hi
    assert x0 < x1 and y0 < y1 and z0 < z1, (lo, hi)
    return prism([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], z0, z1, materials, scale, lightmap)


def octagon(x, y, r):
    """Corners of a nearly regular octagon of inner radius r on the integer grid."""
    k = round(r * 0.41421356)
    return [(x + r, y - k), (x + r, y + k), (x + k, y + r), (x - k, y + r),
            (x - r, y + k), (x - r, y - k), (x - k, y - r), (x + k, y - r)]


def slab_with_holes(axis, lo, hi, holes, materials, scale=0.25, lightmap=16):
    """A box cut by box-shaped holes through its thin axis: 0 x, 1 y, 2 z. Holes: ((u0, v0), (u1, v1)) in the other two
    axes, in their order. Gives few boxes: strips along u between the holes' edges in v."""
    u, v = [k for k in range(3) if k != axis]
    cuts = sorted({lo[v], hi[v], *(min(max(h[k][1], lo[v]), hi[v]) for h in holes for k in range(2))})
    brushes = []
    for v0, v1 in zip(cuts, cuts[1:]):
        gaps = sorted((max(a[0], lo[u]), min(b[0], hi[u])) for a, b in holes if a[1] < v1 and b[1] > v0)
        start = lo[u]
        for g0, g1 in gaps + [(hi[u], hi[u])]:
            if g0 > start:
                a, b = list(lo), list(hi)
                a[u], b[u], a[v], b[v] = start, g0, v0, v1
                brushes.append(box(tuple(a), tuple(b), materials, scale, lightmap))
            start = max(start, g1)
    return brushes


def room(lo, hi, materials, thick=16, scale=0.25, lightmap=16):
    """Six walls round the air lo..hi. Materials name what is seen inside, by the way the wall lies: x- is the wall
    at lo.x. Outsides are not drawn."""
    if isinstance(materials, str): materials = faces(materials)
    (x0, y0, z0), (x1, y1, z1), t = lo, hi, thick
    def wall(a, b, where, inner):
        return box(a, b, faces(NODRAW, **{inner: materials[where]}), scale, lightmap)
    return [wall((x0 - t, y0 - t, z0 - t), (x1 + t, y1 + t, z0), "z-", "zp"),
            wall((x0 - t, y0 - t, z1), (x1 + t, y1 + t, z1 + t), "z+", "zm"),
            wall((x0 - t, y0 - t, z0), (x0, y1 + t, z1), "x-", "xp"),
            wall((x1, y0 - t, z0), (x1 + t, y1 + t, z1), "x+", "xm"),
            wall((x0, y0 - t, z0), (x1, y0, z1), "y-", "yp"),
            wall((x0, y1, z0), (x1, y1 + t, z1), "y+", "ym")]


class Entity:
    def __init__(self, classname, brushes=(), **keys):
        self.keys = [("classname", classname)] + [(k, str(v)) for k, v in keys.items()]
        self.brushes = list(brushes)


def vector(p): return " ".join(str(c) for c in p)


class Map:
    def __init__(self, comment, **keys):
        self.world = Entity("worldspawn", comment=comment, **keys)
        self.entities = []

    def add(self, *brushes):
        for b in brushes:
            self.world.brushes += b if isinstance(b, list) else [b]

    def entity(self, classname, *brushes, **keys):
        flat = [x for b in brushes for x in (b if isinstance(b, list) else [b])]
        if "origin" in keys and not isinstance(keys["origin"], str): keys["origin"] = vector(keys["origin"])
        self.entities.append(Entity(classname, flat, **keys))

    def vmf(self):
        out, ids = [], {"solid": 1, "side": 0, "entity": 1}

        def key(depth, k, v):
            assert '"' not in str(v)
            out.append("\t" * depth + f'"{k}" "{v}"')

        def solid(brush):
            ids["solid"] += 1
            out.extend(["\tsolid", "\t{"])
            key(2, "id", ids["solid"])
            for s in brush.sides:
                ids["side"] += 1
                out.extend(["\t\tside", "\t\t{"])
                key(3, "id", ids["side"])
                key(3, "plane", " ".join(f"({vector(p)})" for p in s.plane_points()))
                key(3, "material", s.material)
                u, v = s.axes()
                key(3, "uaxis", f"[{vector(u)} {s.shift[0]}] {s.scale:g}")
                key(3, "vaxis", f"[{vector(v)} {s.shift[1]}] {s.scale:g}")
                key(3, "rotation", 0)
                key(3, "lightmapscale", s.lightmap)
                key(3, "smoothing_groups", 0)
                if s.displacement: s.displacement.text(s.corners, key, out)
                out.append("\t\t}")
            out.append("\t}")

        def block(name, entity, ident):
            out.extend([name, "{"])
            key(1, "id", ident)
            if name == "world": key(1, "mapversion", 1)
            for k, v in entity.keys: key(1, k, v)
            for b in entity.brushes: solid(b)
            out.append("}")

        out.extend(["versioninfo", "{", '\t"editorversion" "400"', '\t"mapversion" "1"', '\t"formatversion" "100"',
                    '\t"prefab" "0"', "}"])
        block("world", self.world, 1)
        for e in self.entities:
            ids["entity"] += 1
            block("entity", e, ids["entity"])
        return "\n".join(out) + "\n"

    def quake(self, valve220=False):
        out = ["// Game: Quake", "// Format: " + ("Valve" if valve220 else "Standard")]
        for number, e in enumerate([self.world] + self.entities):
            out.extend([f"// entity {number}", "{"])
            if valve220 and number == 0: out.append('"mapversion" "220"')
            out.extend(f'"{k}" "{v}"' for k, v in e.keys)
            for count, b in enumerate(e.brushes):
                out.extend([f"// brush {count}", "{"])
                for s in b.sides:
                    points = " ".join(f"( {vector(p)} )" for p in s.plane_points())
                    u, v = s.axes()
                    if valve220:
                        out.append(f"{points} {s.material} [ {vector(u)} {s.shift[0]} ] [ {vector(v)} {s.shift[1]} ] "
                                   f"0 {s.scale:g} {s.scale:g}")
                    else:
                        out.append(f"{points} {s.material} {s.shift[0]} {s.shift[1]} 0 {s.scale:g} {s.scale:g}")
                out.append("}")
            out.append("}")
        return "\n".join(out) + "\n"
