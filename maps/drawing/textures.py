"""Procedural textures as PNG: albedo in sRGB, normals in tangent space (red along u, green along v, which runs down the
image, blue out of the surface). Everything wraps round. Only the standard library is used."""
import math
import os
import random
import struct
import zlib

SIZE = 256


def png(path, rows):
    """rows: lists of (r, g, b) or (r, g, b, a) bytes. Filtered by the row above or the texel before, whichever packs better."""
    h, w, n = len(rows), len(rows[0]), len(rows[0][0])
    raw, above = bytearray(), bytes(n * w)
    for row in rows:
        line = bytes(c for texel in row for c in texel)
        up = bytes((a - b) & 255 for a, b in zip(line, above))
        left = bytes((line[i] - (line[i - n] if i >= n else 0)) & 255 for i in range(n * w))
        cost = [sum(min(c, 256 - c) for c in f) for f in (up, left)]
        raw += (b"\2" + up) if cost[0] <= cost[1] else (b"\1" + left)
        above = line

    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))
    with open(path, "wb") as f:
        f.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", w, h, 8, 2 if n == 3 else 6, 0, 0, 0)) +
                chunk(b"IDAT", zlib.compress(bytes(raw), 9)) + chunk(b"IEND", b""))


def srgb(v):
    v = min(max(v, 0.0), 1.0)
    return 12.92 * v if v <= 0.0031308 else 1.055 * v ** (1 / 2.4) - 0.055


def linear(byte):
    v = byte / 255
    return v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4


class Noise:
    """Smooth noise of a given number of cells across the texture, in [-1, 1]."""

    def __init__(self, seed, cells_u, cells_v=None):
        self.nu, self.nv = cells_u, cells_v or cells_u
        r = random.Random(seed)
        self.grid = [[r.uniform(-1, 1) for _ in range(self.nu)] for _ in range(self.nv)]

    def at(self, x, y):
        u, v = x * self.nu / SIZE, y * self.nv / SIZE
        i, j = int(u) % self.nu, int(v) % self.nv
        a, b = u - int(u), v - int(v)
        a, b = a * a * (3 - 2 * a), b * b * (3 - 2 * b)
        g, k, l = self.grid, (i + 1) % self.nu, (j + 1) % self.nv
        return (g[j][i] * (1 - a) + g[j][k] * a) * (1 - b) + (g[l][i] * (1 - a) + g[l][k] * a) * b


def smooth(edge0, edge1, x):
    t = min(max((x - edge0) / (edge1 - edge0), 0.0), 1.0)
    return t * t * (3 - 2 * t)


def save(folder, name, surface, relief):
    """surface(x, y) -> (height in texels, linear rgb). Gives the mean linear reflectance and the two file names."""
    texels = [[surface(x, y) for x in range(SIZE)] for y in range(SIZE)]
    albedo = [[tuple(round(srgb(c) * 63.75) * 4 if c < 0.999 else 255 for c in t[1]) for t in row] for row in texels]
    albedo = [[tuple(min(c, 255) for c in t) for t in row] for row in albedo]  # steps of 4: small files, no visible bands
    normals = []
    for y in range(SIZE):
        row = []
        for x in range(SIZE):
            dx = (texels[y][(x + 1) % SIZE][0] - texels[y][x - 1][0]) / 2 * relief
            dy = (texels[(y + 1) % SIZE][x][0] - texels[y - 1][x][0]) / 2 * relief
            s = 1 / math.sqrt(dx * dx + dy * dy + 1)
            row.append(tuple(round((c * s + 1) * 127.5) for c in (-dx, -dy, 1)))
        normals.append(row)
    png(os.path.join(folder, name + ".png"), albedo)
    png(os.path.join(folder, name + "_normal.png"), normals)
    count = SIZE * SIZE
    mean = [round(sum(linear(t[c]) for row in albedo for t in row) / count, 4) for c in range(3)]
    tilts = sorted(t[2] for row in normals for t in row)
    cone = math.degrees(math.acos(min(1, tilts[count // 20] / 127.5 - 1)))
    return {"reflectance": mean, "albedo_map": f"textures/{name}.png", "normal_map": f"textures/{name}_normal.png",
            "normal_cone": round(cone, 1), "size": [SIZE, SIZE]}


def shade(color, k): return tuple(c * k for c in color)


def blocks(seed, across, down, gap, bevel, stagger):
    """A pattern of blocks: (x, y) -> (0 in the joint .. 1 on the block, a random number of the block)."""
    w, h = SIZE // across, SIZE // down
    r = random.Random(seed)
    tones = [[r.random() for _ in range(across)] for _ in range(down)]

    def at(x, y, wobble=0.0):
        j = int(y) // h
        x = (x + (w // 2 if stagger and j % 2 else 0)) % SIZE
        i = int(x) // w
        edge = min(x - i * w, (i + 1) * w - 1 - x, y - j * h, (j + 1) * h - 1 - y) + wobble
        return smooth(gap / 2, gap / 2 + bevel, edge), tones[j][i]
    return at


def brick(folder, name, color, mortar):
    pattern, fine, wide = blocks(name, 4, 8, 3, 2.5, True), Noise(name + "f", 64), Noise(name + "w", 16)

    def surface(x, y):
        body, tone = pattern(x, y, 0.8 * wide.at(x, y))
        f = fine.at(x, y)
        clay = shade(color, 0.78 + 0.44 * tone + 0.08 * f + 0.08 * wide.at(x, y))
        rgb = tuple(m + (c - m) * body for c, m in zip(clay, shade(mortar, 1 + 0.08 * f)))
        return 4.0 * body + 0.5 * f + 0.8 * wide.at(x, y) * body + 0.8 * tone * body, rgb
    return save(folder, name, surface, 0.3)


def tiles(folder, name, color, joint, across, checker=0.0, stagger=False, down=None):
    pattern = blocks(name, across, down or across, 1, 2.5, stagger)
    cloud, vein = Noise(name + "c", 8), Noise(name + "v", 24)
    size = SIZE // across

    def surface(x, y):
        body, tone = pattern(x, y)
        dark = checker if (x // size + y // size) % 2 else 0.0
        streak = max(0.0, 1 - 6 * abs(cloud.at(x, y) + 0.35 * vein.at(x, y)))
        stone = shade(color, (1 - dark) * (0.9 + 0.14 * tone + 0.06 * cloud.at(x, y) + 0.10 * streak))
        return 2.5 * body, tuple(j + (c - j) * body for c, j in zip(stone, joint))
    return save(folder, name, surface, 0.35)


def plaster(folder, name, color, roughness=1.0):
    a, b, c = Noise(name + "a", 10), Noise(name + "b", 32), Noise(name + "c", 80)

    def surface(x, y):
        h = 3.0 * a.at(x, y) + 1.5 * b.at(x, y) + 0.55 * c.at(x, y)
        return h * roughness, shade(color, 1 + 0.035 * a.at(x, y) + 0.03 * b.at(x, y))
    return save(folder, name, surface, 0.2)


def wood(folder, name, color, planks=4):
    """Planks that run along u."""
    h = SIZE // planks
    r = random.Random(name)
    tones = [r.uniform(0.8, 1.15) for _ in range(planks)]
    grain, long, warp = Noise(name + "g", 6, 128), Noise(name + "l", 3, 48), Noise(name + "w", 4, 8)

    def surface(x, y):
        j = y // h
        edge = min(y - j * h, (j + 1) * h - 1 - y)
        body = smooth(0.5, 3.0, edge)
        g = grain.at((x + 61 * j) % SIZE, (y + 6 * warp.at(x, y)) % SIZE)
        l = long.at((x + 97 * j) % SIZE, (y + 10 * warp.at(x, y)) % SIZE)
        return 2.2 * body + 0.5 * g + 0.5 * l, shade(color, body * tones[j] * (1 + 0.16 * g + 0.2 * l) + 0.15 * (1 - body))
    return save(folder, name, surface, 0.5)


def metal(folder, name, color, panels=2):
    pattern, scratch = blocks(name, panels, panels, 3, 4, False), Noise(name + "s", 96, 8)
    size = SIZE // panels

    def surface(x, y):
        body, tone = pattern(x, y)
        rx, ry = min(x % size, size - 1 - x % size) - 14, min(y % size, size - 1 - y % size) - 14
        rivet = 1 - smooth(3.0, 6.0, math.hypot(rx, ry))
        s = scratch.at(x, y)
        return 3 * body + 3.5 * rivet + 0.15 * s, shade(color, (0.55 + 0.45 * body) * (1 + 0.08 * s + 0.06 * tone))
    return save(folder, name, surface, 0.5)


def cloth(folder, name, color):
    """A carpet: a fine weave."""
    fluff = Noise(name, 64)

    def surface(x, y):
        weave = math.sin(x * math.pi / 4) * math.sin(y * math.pi / 4)
        return 1.2 * weave + 0.8 * fluff.at(x, y), shade(color, 1 + 0.12 * weave + 0.08 * fluff.at(x, y))
    return save(folder, name, surface, 0.45)
