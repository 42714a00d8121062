"""The showpiece: a hall under skylights with a gallery, a red and a green room that lend it their colour, and a dim
corridor. Units are Hammer's (40 to the metre); the hall's air is x 0..1024, y 0..768, z 0..448, +y is north."""
import os

from . import textures
from .brushes import (NODRAW, SKY, Map, box, faces, hull, octagon, prism, slab_with_holes)

FLOOR, BORDER, BRICK, PLASTER = ("kiln/floor_polished", "kiln/floor_border", "kiln/brick", "kiln/plaster_white")
RED, GREEN, CARPET, WOOD, DARK_WOOD, METAL, STONE, TILES = ("kiln/plaster_red", "kiln/plaster_green", "kiln/carpet_red",
                                                           "kiln/wood", "kiln/wood_dark", "kiln/metal", "kiln/stone",
                                                           "kiln/tiles_green")
LAMP_WARM, LAMP_WHITE, LAMP_SMALL = "kiln/lamp_warm", "kiln/lamp_white", "kiln/lamp_small"

X, Y, Z = 1024, 768, 448  # the hall
WALL = 32
DADO = 208                # brick below, plaster above


def materials(folder):
    os.makedirs(folder, exist_ok=True)
    floor = textures.tiles(folder, "floor_polished", (0.55, 0.48, 0.40), (0.22, 0.19, 0.16), 4, checker=0.25)
    border = textures.tiles(folder, "floor_border", (0.10, 0.095, 0.09), (0.05, 0.05, 0.05), 8)
    metal = textures.metal(folder, "metal", (0.30, 0.31, 0.33))
    brick = textures.brick(folder, "brick", (0.50, 0.25, 0.16), (0.50, 0.46, 0.41))
    white = textures.plaster(folder, "plaster", (0.74, 0.71, 0.66))
    wood = textures.wood(folder, "wood", (0.36, 0.22, 0.13))
    tiles = textures.tiles(folder, "tiles", (0.55, 0.62, 0.58), (0.30, 0.32, 0.31), 8, stagger=True)

    def tinted(base, reflectance):  # the same relief in another colour: no albedo map, the number is the colour
        return {k: v for k, v in {**base, "reflectance": reflectance}.items() if k != "albedo_map"}

    def lamp(r, g, b): return {"reflectance": [0.3, 0.3, 0.3], "emission": [r, g, b], "size": [64, 64]}
    return {
        FLOOR: {**floor, "env_map": 0.4, "roughness": 0.12},
        BORDER: {**border, "env_map": 0.3, "roughness": 0.15},
        BRICK: brick,
        PLASTER: white,
        RED: tinted(white, [0.62, 0.055, 0.04]),
        GREEN: tinted(white, [0.13, 0.38, 0.14]),
        CARPET: textures.cloth(folder, "carpet_red", (0.42, 0.04, 0.035)),
        WOOD: wood,
        DARK_WOOD: tinted(wood, [0.13, 0.075, 0.04]),
        METAL: {**metal, "env_map": 0.5, "roughness": 0.25},
        STONE: textures.tiles(folder, "stone", (0.56, 0.53, 0.47), (0.38, 0.36, 0.32), 2, stagger=True, down=4),
        TILES: {**tiles, "env_map": 0.12, "roughness": 0.3},
        LAMP_WARM: lamp(14, 8, 3.5),
        LAMP_WHITE: lamp(5, 5, 4.5),
        LAMP_SMALL: lamp(5, 3.6, 2),
    }


def shell(m):
    """What seals: floor, ceiling with skylights, walls with their openings, sky behind each opening to the sky."""
    # Floor: polished tiles with a dark border.
    b = 48
    m.add(box((b, b, -16), (X - b, Y - b, 0), faces(NODRAW, zp=FLOOR), lightmap=4))
    for lo, hi in (((0, 0), (X, b)), ((0, Y - b), (X, Y)), ((0, b), (b, Y - b)), ((X - b, b), (X, Y - b))):
        m.add(box((*lo, -16), (*hi, 0), faces(NODRAW, zp=BORDER), lightmap=8))
    for lo, hi in (((-WALL, -WALL), (X + WALL, 0)), ((-WALL, Y), (X + WALL, Y + WALL)), ((-WALL, 0), (0, Y)),
                   ((X, 0), (X + WALL, Y))):  # under the walls; seen as thresholds
        m.add(box((*lo, -16), (*hi, 0), faces(NODRAW, zp=STONE), lightmap=8))

    # Ceiling: three skylights in their wells.
    lights = [((x, 240), (x + 192, 464)) for x in (160, 416, 672)]
    m.add(slab_with_holes(2, (-WALL, -WALL, Z), (X + WALL, Y + WALL, Z + 32), lights, faces(PLASTER, zp=NODRAW)))
    for (x0, y0), (x1, y1) in lights:
        m.add(box((x0 - 16, y0 - 16, Z + 32), (x1 + 16, y1 + 16, Z + 48), SKY))

    # South wall: four clerestory windows.
    windows = [((x, 272), (x + 144, 416)) for x in (112, 336, 544, 768)]
    for z0, z1, material in ((0, DADO, BRICK), (DADO, Z, PLASTER)):
        m.add(slab_with_holes(1, (-WALL, -WALL, z0), (X + WALL, 0, z1), windows,
                              {**faces(PLASTER), "y+": material, "y-": NODRAW}, lightmap=16))
    for (x0, z0), (x1, z1) in windows:
        m.add(box((x0 - 16, -WALL - 16, z0 - 16), (x1 + 16, -WALL, z1 + 16), SKY))

    # North wall: the corridor's mouth. West and east walls: the doorways of the side rooms.
    for z0, z1, material in ((0, DADO, BRICK), (DADO, Z, PLASTER)):
        m.add(slab_with_holes(1, (-WALL, Y, z0), (X + WALL, Y + WALL, z1), [((448, 0), (576, 136))],
                              {**faces(STONE), "y-": material, "y+": NODRAW}, lightmap=8))
        m.add(slab_with_holes(0, (-WALL, 0, z0), (0, Y, z1), [((304, 0), (464, 152))],
                              {**faces(STONE), "x+": material, "x-": RED if z0 == 0 else NODRAW}, lightmap=8))
        m.add(slab_with_holes(0, (X, 0, z0), (X + WALL, Y, z1), [((304, 0), (464, 152))],
                              {**faces(STONE), "x-": material, "x+": GREEN if z0 == 0 else NODRAW}, lightmap=8))


def side_room(m, x0, x1, wall, floor, skylight):
    """A room of z 0..192 beside the hall, which gives it the wall in between."""
    y0, y1, top, t = 256, 512, 192, 16
    west, east = (t, 0) if x0 < 0 else (0, t)
    m.add(box((x0 - west, y0 - t, -16), (x1 + east, y1 + t, 0), faces(NODRAW, zp=floor), lightmap=8))
    hole = [((x0 + 40, y0 + 24), (x0 + 152, y0 + 120))] if skylight else []
    m.add(slab_with_holes(2, (x0 - west, y0 - t, top), (x1 + east, y1 + t, top + t), hole, faces(PLASTER, zp=NODRAW),
                          lightmap=16))
    for (hx0, hy0), (hx1, hy1) in hole:
        m.add(box((hx0 - 16, hy0 - 16, top + t), (hx1 + 16, hy1 + 16, top + 2 * t), SKY))
    m.add(box((x0 - west, y0 - t, 0), (x1 + east, y0, top), faces(NODRAW, yp=wall), lightmap=8),
          box((x0 - west, y1, 0), (x1 + east, y1 + t, top), faces(NODRAW, ym=wall), lightmap=8))
    if west:
        m.add(box((x0 - t, y0, 0), (x0, y1, top), faces(NODRAW, xp=wall), lightmap=8))
    else:
        m.add(box((x1, y0, 0), (x1 + t, y1, top), faces(NODRAW, xm=wall), lightmap=8))


def corridor(m):
    """North of the hall, x 448..576, y 800..1152, z 0..144, with a metal door in a niche at its end."""
    x0, x1, y0, y1, top, t = 448, 576, Y + WALL, 1152, 144, 16
    m.add(box((x0 - t, y0, -16), (x1 + t, y1 + 2 * t, 0), faces(NODRAW, zp=TILES), lightmap=8),
          box((x0 - t, y0, top), (x1 + t, y1 + 2 * t, top + t), faces(NODRAW, zm=PLASTER)),
          box((x0 - t, y0, 0), (x0, y1 + 2 * t, top), faces(NODRAW, xp=BRICK), lightmap=8),
          box((x1, y0, 0), (x1 + t, y1 + 2 * t, top), faces(NODRAW, xm=BRICK), lightmap=8),
          box((x0, y1 + t, 0), (x1, y1 + 2 * t, top), faces(NODRAW, ym=BRICK)))
    m.add(slab_with_holes(1, (x0, y1, 0), (x1, y1 + t, top), [((464, 0), (560, 112))], {**faces(STONE), "y-": BRICK},
                          lightmap=8))
    m.entity("func_door", box((464, y1 + 4, 0), (560, y1 + 12, 112), METAL, lightmap=8), targetname="corridor_door",
             origin=(512, y1 + 8, 56), movedir="-90 0 0", speed="80")
    for number, y in enumerate((896, 1064)):
        m.entity("func_detail", box((504, y - 8, top - 6), (520, y + 8, top), METAL))
        m.entity("light_spot", origin=(512, y, top - 8), angles="-90 0 0", pitch="-90", _inner_cone="35", _cone="55",
                 _exponent="1", _quadratic_attn="1", _light="255 226 184 150" if number == 0 else "255 214 160 190")
    m.entity("func_detail", box((x0, y0 + 40, 0), (x0 + 3, y1, 10), DARK_WOOD), box((x1 - 3, y0 + 40, 0), (x1, y1, 10), DARK_WOOD))


def column(m, x, y, z1, lightmap=4):
    m.entity("func_detail",
             box((x - 32, y - 32, 0), (x + 32, y + 32, 12), STONE, lightmap=lightmap),
             prism(octagon(x, y, 28), 12, 20, STONE, lightmap=lightmap),
             prism(octagon(x, y, 22), 20, z1 - 24, STONE, lightmap=lightmap),
             hull([(a, b, z1 - 24) for a, b in octagon(x, y, 22)], [(a, b, z1 - 12) for a, b in octagon(x, y, 29)], STONE,
                  lightmap=lightmap),
             box((x - 32, y - 32, z1 - 12), (x + 32, y + 32, z1), STONE, lightmap=lightmap))


def furniture(m):
    """Detail: nothing here seals or splits."""
    for x in (304, 512, 720):
        column(m, x, 152, Z - 24)  # they carry the girder below
    # Girder on the south columns, beams across the hall between the skylights.
    m.entity("func_detail", box((0, 136, Z - 24), (X, 168, Z), DARK_WOOD, lightmap=8))
    for x in (96, 376, 632, 912):
        m.entity("func_detail", box((x, 168, Z - 20), (x + 16, Y, Z), DARK_WOOD, lightmap=8),
                 box((x, 0, Z - 20), (x + 16, 136, Z), DARK_WOOD, lightmap=8))
    for x in (160, 416, 672):  # glazing bars
        m.entity("func_detail", box((x + 92, 240, Z + 22), (x + 100, 464, Z + 30), METAL),
                 *(box((x + a, y, Z + 22), (x + b, y + 8, Z + 30), METAL) for y in (312, 384) for a, b in ((0, 92), (100, 192))))
    for x in (112, 336, 544, 768):
        m.entity("func_detail", box((x + 68, -24, 272), (x + 76, -16, 416), METAL),
                 box((x, -24, 340), (x + 68, -16, 348), METAL), box((x + 76, -24, 340), (x + 144, -16, 348), METAL))

    # The gallery along the north wall, its columns, its railing and the stairs up to it.
    g0, top = 320, 192
    m.entity("func_detail", box((g0, 640, top - 16), (X, Y, top), faces(PLASTER, zp=WOOD, ym=DARK_WOOD, xm=DARK_WOOD), lightmap=8))
    for x in (352, 672, 864):
        column(m, x, 672, top - 16, lightmap=8)
    for x in range(328, X, 96):
        m.entity("func_detail", box((x, 644, top), (x + 8, 652, top + 40), METAL))
    m.entity("func_detail", box((g0, 642, top + 40), (X, 654, top + 46), DARK_WOOD))
    steps = [box((32 + 24 * i, 664, 0), (56 + 24 * i, Y, 16 * (i + 1)), faces(PLASTER, zp=WOOD), lightmap=8) for i in range(12)]
    m.entity("func_detail", steps)

    # Trims: a skirting at the foot of the walls, a cornice where brick ends.
    def trim(z0, z1, depth, material, gaps):
        pieces = [((0, 0), (X, depth)), ((0, depth), (depth, 304)), ((0, 464), (depth, 664)),
                  ((X - depth, depth), (X, 304)), ((X - depth, 464), (X, Y - depth)),
                  ((g0, Y - depth), (448, Y)), ((576, Y - depth), (X, Y))]
        whole = [((0, 0), (X, depth)), ((0, depth), (depth, Y - depth)), ((X - depth, depth), (X, Y - depth)),
                 ((0, Y - depth), (X, Y))]
        for lo, hi in pieces if gaps else whole:
            m.entity("func_detail", box((*lo, z0), (*hi, z1), material))
    trim(0, 14, 4, DARK_WOOD, True)
    trim(DADO - 4, DADO + 8, 8, STONE, False)

    # A plinth with a metal obelisk under the middle skylight.
    x, y = 512, 376
    m.entity("func_detail", prism(octagon(x, y, 72), 0, 10, STONE, lightmap=4),
             prism(octagon(x, y, 44), 10, 40, faces(STONE, zp=TILES), lightmap=4),
             hull([(x - 16, y - 16, 40), (x + 16, y - 16, 40), (x + 16, y + 16, 40), (x - 16, y + 16, 40)],
                  [(x - 6, y - 6, 160), (x + 6, y - 6, 160), (x + 6, y + 6, 160), (x - 6, y + 6, 160)], METAL, lightmap=4),
             hull([(x - 6, y - 6, 160), (x + 6, y - 6, 160), (x + 6, y + 6, 160), (x - 6, y + 6, 160)],
                  [(x - 1, y - 1, 172), (x + 1, y - 1, 172), (x + 1, y + 1, 172), (x - 1, y + 1, 172)], METAL, lightmap=4))

    # Crates in the east, one of them turned; a bench in each side of the sun.
    m.entity("func_detail", box((912, 528, 0), (968, 584, 56), WOOD, lightmap=8), box((920, 536, 56), (960, 576, 96), WOOD, lightmap=8),
             prism([(868, 584), (904, 599), (889, 635), (853, 620)], 0, 40, WOOD, lightmap=8))
    for bx in (176, 720):
        m.entity("func_detail", box((bx, 480, 18), (bx + 128, 516, 24), WOOD, lightmap=8), box((bx + 8, 484, 0), (bx + 20, 512, 18), METAL),
                 box((bx + 108, 484, 0), (bx + 120, 512, 18), METAL))

    # Wall lamps: glowing boxes on the gallery's wall, under the gallery and at the doorways.
    for lx in (448, 640, 832):
        m.entity("func_detail", box((lx - 10, Y - 10, 276), (lx + 10, Y, 308), faces(LAMP_WARM, zp=METAL, zm=METAL)))
    for lx in (400, 768):
        m.entity("func_detail", box((lx - 16, 712, top - 20), (lx + 16, 744, top - 16), faces(METAL, zm=LAMP_SMALL)))


def side_rooms(m):
    side_room(m, -288, -WALL, RED, CARPET, skylight=True)
    side_room(m, X + WALL, 1312, GREEN, TILES, skylight=False)
    # The green room's light: a panel in a shallow frame; a counter below it.
    m.entity("func_detail", box((1136, 336, 186), (1232, 432, 192), faces(METAL, zm=LAMP_WHITE)))
    m.entity("func_detail", box((1216, 336, 0), (1248, 432, 40), faces(WOOD, zp=STONE), lightmap=8))
    # The red room: a bench and a pedestal with a metal block.
    m.entity("func_detail", box((-272, 432, 0), (-232, 496, 40), STONE, lightmap=8),
             prism([(-252, 446), (-238, 464), (-252, 482), (-266, 464)], 40, 80, METAL, lightmap=8))
    for x0, x1 in ((-288, -WALL), (X + WALL, 1312)):
        for y0, y1 in ((256, 259), (509, 512)):
            m.entity("func_detail", box((x0, y0, 0), (x1, y1, 12), DARK_WOOD))


def entities(m):
    m.entity("light_environment", origin=(512, 384, 400), angles="-46 68 0", pitch="-46", SunSpreadAngle="1",
             _light="255 238 205 2600", _ambient="200 220 255 420")
    for origin, size in (((512, 280, 96), 7), ((144, 384, 80), 6), ((880, 384, 80), 6), ((512, 704, 96), 6), ((672, 700, 256), 6), ((-160, 384, 80), 6), ((1184, 384, 80), 6),
                         ((512, 976, 72), 6)):
        m.entity("env_cubemap", origin=origin, cubemapsize=size)
    m.entity("info_player_start", origin=(512, 64, 8), angles="0 90 0")
    # Where pictures are taken from: angles are pitch (down is positive) and yaw; fov is the horizontal angle in degrees.
    m.entity("info_camera_view", origin=(40, 240, 168), angles="6 24 0", fov="84", targetname="hall")
    m.entity("info_camera_view", origin=(960, 668, 264), angles="15 212 0", fov="84", targetname="gallery")
    m.entity("info_camera_view", origin=(476, 1112, 72), angles="2 277 0", fov="80", targetname="corridor")
    m.entity("info_camera_view", origin=(330, 520, 72), angles="-2 200 0", fov="75", targetname="red_room")


def draw(texture_folder):
    m = Map("A hall under skylights with a gallery, coloured side rooms and a dim corridor. Drawn by maps/draw.py.",
            skyname="sky_day")
    shell(m)
    side_rooms(m)
    corridor(m)
    furniture(m)
    entities(m)
    return m, materials(texture_folder)
