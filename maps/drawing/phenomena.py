"""Small levels, one per phenomenon. Each function gives (map, materials)."""
import os

from . import textures
from .brushes import NODRAW, SKY, Displacement, Map, box, faces, prism, room, slab_with_holes, wedge

WHITE, GREY, RED, GREEN, LAMP, BLACK = ("kiln/white", "kiln/grey", "kiln/red", "kiln/green", "kiln/lamp", "kiln/black")
PLAIN = {
    WHITE: {"reflectance": [0.75, 0.75, 0.75]},
    GREY: {"reflectance": [0.5, 0.5, 0.5]},
    RED: {"reflectance": [0.63, 0.06, 0.05]},
    GREEN: {"reflectance": [0.12, 0.45, 0.1]},
    BLACK: {"reflectance": [0, 0, 0]},
    LAMP: {"reflectance": [0, 0, 0], "emission": [16, 14, 11]},
}


def plain(*names): return {n: PLAIN[n] for n in names}


def start(m, x, y, z=8): m.entity("info_player_start", origin=(x, y, z), angles="0 0 0")


def furnace():
    m = Map("Every surface gives e + rho = 1, so radiance is 1 everywhere, whatever stands in the room.")
    a, b, c = "kiln/furnace_dark", "kiln/furnace_mid", "kiln/furnace_bright"
    m.add(room((0, 0, 0), (192, 160, 128), faces(b, xm=a, xp=c, zm=c, zp=a), lightmap=8))
    m.add(box((32, 32, 0), (80, 80, 96), faces(a, zp=c), lightmap=8))  # touches the floor
    m.entity("func_detail", prism([(112, 80), (144, 88), (136, 120), (104, 112)], 0, 48, b, lightmap=8))
    m.entity("func_detail", box((80, 40, 88), (128, 72, 96), c, lightmap=8))  # a shelf against the pillar
    start(m, 160, 40)
    return m, {a: {"reflectance": [0.2, 0.3, 0.1], "emission": [0.8, 0.7, 0.9]},
               b: {"reflectance": [0.5, 0.4, 0.6], "emission": [0.5, 0.6, 0.4]},
               c: {"reflectance": [0.8, 0.7, 0.9], "emission": [0.2, 0.3, 0.1]}}


def cornell():
    m = Map("A closed box with a red and a green wall, a lamp in the ceiling and two blocks turned out of the axes.")
    m.add(room((0, 0, 0), (220, 220, 220), faces(WHITE, xm=RED, xp=GREEN), lightmap=8))
    m.add(box((80, 85, 218), (140, 135, 220), faces(BLACK, zm=LAMP), lightmap=8))
    m.add(prism([(52, 43), (111, 61), (93, 120), (34, 102)], 0, 66, WHITE, lightmap=8))
    m.add(prism([(116, 121), (173, 99), (195, 156), (138, 178)], 0, 132, WHITE, lightmap=8))
    start(m, 180, 30)
    return m, plain(WHITE, RED, GREEN, LAMP, BLACK)


def two_rooms():
    m = Map("Light from one room reaches the other by a door only. 40 units are a metre; luxels of a quarter metre.")
    floor, ceiling, sides, south, north = (f"kiln/grey{p}" for p in (50, 70, 60, 40, 70))
    m.add(room((0, 0, 0), (320, 320, 160), {"z-": floor, "z+": ceiling, "x-": sides, "x+": sides, "y-": south, "y+": north},
               lightmap=10))
    m.add(slab_with_holes(0, (180, 0, 0), (190, 320, 160), [((120, 0), (180, 100))], sides, lightmap=10))
    m.add(box((60, 200, 0), (120, 260, 60), floor, lightmap=10))
    m.add(box((60, 60, 159), (100, 100, 160), faces(BLACK, zm=LAMP), lightmap=10))
    start(m, 40, 40)
    return m, {**{f"kiln/grey{p}": {"reflectance": [p / 100] * 3} for p in (40, 50, 60, 70)},
               BLACK: PLAIN[BLACK], LAMP: {"reflectance": [0, 0, 0], "emission": [20, 20, 20]}}


def corridor():
    m = Map("A corridor with two right angles: its ends do not see each other, light arrives by bouncing only.")
    w = GREY
    m.add(box((-16, -16, -16), (400, 400, 0), faces(NODRAW, zp=w)))        # floor
    m.add(box((-16, -16, 96), (400, 400, 112), faces(NODRAW, zm=WHITE)))   # ceiling
    m.add(box((-16, -16, 0), (400, 0, 96), faces(NODRAW, yp=w)),
          box((-16, 0, 0), (0, 400, 96), faces(NODRAW, xp=w)),
          box((384, 0, 0), (400, 400, 96), faces(NODRAW, xm=w)),
          box((0, 384, 0), (384, 400, 96), faces(NODRAW, ym=w)),
          box((0, 96, 0), (288, 240, 96), w),       # the first leg runs along y = 0..96, the second along x = 288..384
          box((0, 240, 0), (96, 384, 96), w),       # the third along y = 240..384, ending here
          box((96, 336, 0), (288, 384, 96), w), box((288, 336, 0), (384, 384, 96), w))
    m.entity("light", origin=(48, 48, 64), _light="255 240 220 400")
    start(m, 144, 48)
    return m, plain(WHITE, GREY)


def thin_wall():
    m = Map("A wall of one unit between a bright and an unlit room: the unlit one must stay exactly black.")
    m.add(room((0, 0, 0), (257, 128, 96), GREY, lightmap=16))
    m.add(box((128, 0, 0), (129, 128, 96), WHITE))
    m.entity("light", origin=(64, 64, 72), _light="255 255 255 600")
    start(m, 32, 32)
    m.entity("info_target", origin=(192, 64, 48), targetname="dark_side")
    return m, plain(WHITE, GREY)


def sun_room():
    m = Map("Sun and sky through one window; the sun patch on the floor has straight edges one can compute.",
            skyname="sky_day")
    lo, hi = (0, 0, 0), (256, 192, 128)
    walls = room(lo, hi, faces(WHITE, zm=GREY), lightmap=8)
    del walls[4]  # the wall at y = 0 has the window
    m.add(walls)
    m.add(slab_with_holes(1, (0, -16, 0), (256, 0, 128), [((96, 40), (160, 104))],
                          faces(WHITE, ym=NODRAW), lightmap=8))
    m.add(box((80, -32, 24), (176, -16, 120), SKY))
    m.entity("light_environment", origin=(128, 96, 96), angles="-45 90 0", pitch="-45", _light="255 240 215 1000",
             _ambient="170 200 255 200", SunSpreadAngle="0")
    start(m, 32, 96)
    return m, plain(WHITE, GREY)


def spot_room():
    m = Map("One light_spot straight down: inner cone 30, outer cone 45 degrees.")
    m.add(room((0, 0, 0), (256, 256, 160), faces(GREY, zp=WHITE), lightmap=8))
    m.entity("light_spot", origin=(128, 128, 144), angles="-90 0 0", pitch="-90", _inner_cone="30", _cone="45",
             _exponent="1", _light="255 230 190 800", _quadratic_attn="1")
    start(m, 32, 32)
    return m, plain(WHITE, GREY)


def detail_room():
    m = Map("A func_detail pillar on a structural floor: it hides no floor luxel it does not cover and splits no leaf.")
    m.add(room((0, 0, 0), (256, 192, 128), faces(WHITE, zm=GREY), lightmap=8))
    m.entity("func_detail", box((112, 80, 0), (144, 112, 128), RED, lightmap=8))
    m.entity("func_detail", box((104, 72, 0), (152, 120, 12), GREY, lightmap=8))  # overlaps the pillar's foot
    m.entity("light", origin=(48, 96, 96), _light="255 255 255 400")
    start(m, 208, 96)
    return m, plain(WHITE, GREY, RED)


def leak_room():
    m = Map("A hole of 16 x 16 units in the wall at x = 256: this level leaks, shortest from the player start.")
    walls = room((0, 0, 0), (256, 192, 128), GREY)
    del walls[3]
    m.add(walls)
    m.add(slab_with_holes(0, (256, -16, 0), (272, 208, 128), [((88, 56), (104, 72))], faces(GREY, xp=NODRAW)))
    m.entity("light", origin=(128, 96, 96), _light="255 255 255 300")
    start(m, 192, 96)
    return m, plain(GREY)


def brush_entity():
    m = Map("Two brush models: a func_brush that casts no shadow by default, and a func_door in its frame.")
    m.add(room((0, 0, 0), (320, 192, 128), faces(WHITE, zm=GREY), lightmap=8))
    m.add(slab_with_holes(0, (224, 0, 0), (240, 192, 128), [((64, 0), (128, 96))], GREY, lightmap=8))
    m.entity("func_brush", box((64, 64, 32), (112, 112, 80), RED, lightmap=8), origin=(88, 88, 56), targetname="block")
    m.entity("func_door", box((228, 64, 0), (236, 128, 96), GREEN, lightmap=8), origin=(232, 96, 48), targetname="door",
             movedir="0 90 0", speed="100")
    m.entity("light", origin=(160, 96, 112), _light="255 245 230 400")
    m.entity("light", origin=(280, 96, 96), _light="200 220 255 150")
    start(m, 32, 32)
    return m, plain(WHITE, GREY, RED, GREEN)


def terrain():
    """Displacements of powers 2 to 4 that share edges, two of them at one edge of a third; a cliff, an overhang, a part
    under the floor. Along the edges of the coarser ones the heights are straight between their vertices."""
    from math import cos, sin
    m = Map("Displacements of unequal powers in a sealed room: hills, a cliff with an overhang, a pond's bed under the floor.")
    m.add(room((0, 0, 0), (512, 512, 256), faces(WHITE, zm=GREY, xm=RED, xp=GREEN), lightmap=16))

    def smooth(x, y): return 26 * sin(x / 70 + 1) * cos(y / 55) + 16 * sin((x + y) / 43) + 6

    def height(x, y):  # straight between the vertices of the coarser grid where one begins: x = 256, y = 256
        def straight(f, t, step):
            k = t // step * step
            return f(k) + (f(k + step) - f(k)) * (t - k) / step if t > k else f(t)
        if x == 256: return straight(lambda t: smooth(256, t), y, 64 if y <= 256 else 32)
        if y == 256 and x >= 256: return straight(lambda t: smooth(t, 256), x, 64)
        if y == 256: return straight(lambda t: smooth(t, 256), x, 32)
        if x == 384 and y > 256: return straight(lambda t: smooth(384, t), y, 64)
        return smooth(x, y)

    def ground(p):
        x, y, _ = p
        h, dx = height(x, y), 0
        if 288 < x < 384 and 288 < y < 480: h, dx = h + 90, (-40 if x < 352 else 10)  # a rock that leans over
        return dx, 0, h

    def piece(lo, hi, power):
        b = box((*lo, 16), (*hi, 32), faces(NODRAW, zp="kiln/ground"), scale=0.25, lightmap=16)
        top = next(s for s in b.sides if s.normal[2] > 0)
        top.displacement = Displacement(power, ground, lambda p: 255 * p[0] / 512)
        m.add(b)

    piece((0, 0), (256, 256), 4)
    piece((256, 0), (512, 256), 2)
    piece((0, 256), (256, 512), 3)
    piece((256, 256), (384, 512), 3)
    piece((384, 256), (512, 512), 2)
    m.add(box((224, 96, 254), (288, 160, 256), faces(BLACK, zm=LAMP)))
    m.entity("info_camera_view", origin=(40, 40, 200), angles="28 42 0", fov=80, targetname="hills")
    m.entity("info_camera_view", origin=(480, 300, 120), angles="12 140 0", fov=80, targetname="rock")
    start(m, 128, 128, 120)
    return m, {**plain(WHITE, GREY, RED, GREEN, LAMP, BLACK), "kiln/ground": {"reflectance": [0.42, 0.36, 0.27]}}


def quake_room():
    m = Map("A Quake room: point lights of the three falloffs, a pillar, a step, a ramp.", message="quake room", wad="")
    wall, floor, trim = "stone1_3", "floor_tile2", "metal2_1"
    m.add(room((0, 0, 0), (384, 256, 160), {**faces(wall), "z-": floor}, scale=1))
    m.add(box((160, 96, 0), (192, 128, 160), trim, scale=1))
    m.add(box((288, 0, 0), (384, 256, 24), faces(wall, zp=floor), scale=1))
    m.add(wedge([(240, 0), (288, 24), (288, 0)], 64, 192, floor, scale=1))
    m.entity("light", origin=(64, 128, 120), light="300")
    m.entity("light", origin=(336, 64, 120), light="200", _color="1 0.6 0.3")
    m.entity("light", origin=(336, 192, 120), light="250", delay="2")
    m.entity("info_player_start", origin=(64, 64, 32), angle="0")
    return m, {wall: {"reflectance": [0.3, 0.27, 0.22]}, floor: {"reflectance": [0.35, 0.33, 0.3]},
               trim: {"reflectance": [0.25, 0.25, 0.28]}}


def tube():
    from .brushes import octagon
    m = Map("A tube ten times as long as wide, a lamp at its foot, a black lid: light falls by four decades along it.")
    inner, outer = octagon(0, 0, 32), octagon(0, 0, 48)
    for i in range(8):
        j = (i + 1) % 8
        m.add(prism([inner[i], outer[i], outer[j], inner[j]], 0, 640, {**faces(NODRAW), "side": GREY}, lightmap=8))
    m.add(prism(outer, -16, 0, faces(NODRAW, zp=LAMP), lightmap=8), prism(outer, 640, 656, faces(NODRAW, zm=BLACK), lightmap=8))
    start(m, 0, 0)
    return m, plain(GREY, LAMP, BLACK)


def maze():
    m = Map("Walls of one unit: a lamp in one corner, a way of eight turns to the other, a closet without a door.")
    m.add(room((0, 0, 0), (257, 256, 64), GREY, lightmap=8))
    def w(x0, y0, x1, y1): m.add(box((x0, y0, 0), (x1, y1, 64), WHITE, lightmap=8))
    w(64, 0, 65, 192), w(128, 64, 129, 256), w(192, 0, 193, 192)  # to and fro
    w(0, 96, 32, 97), w(65, 128, 96, 129), w(160, 96, 192, 97)    # baffles
    w(193, 63, 257, 64)                                           # the closet: x from 193, y below 63
    m.add(box((16, 16, 62), (48, 48, 64), faces(BLACK, zm=LAMP), lightmap=8))
    start(m, 32, 64)
    return m, plain(WHITE, GREY, LAMP, BLACK)


def hall():
    m = Map("A hall under 200 small lamps, with windows to sun and sky on one side and pillars in its midst.", skyname="sky_day")
    walls = room((0, 0, 0), (640, 384, 192), faces(WHITE, zm=GREY, xp=RED), lightmap=16)
    del walls[4]  # y = 0 has the windows
    m.add(walls)
    m.add(slab_with_holes(1, (0, -16, 0), (640, 0, 192), [((64 + 144 * i, 56), (144 + 144 * i, 152)) for i in range(4)], faces(WHITE, ym=NODRAW), lightmap=16))
    m.add(box((0, -48, 0), (640, -32, 192), SKY))
    m.add(box((0, -32, 192), (640, -16, 208), SKY), box((0, -32, -16), (640, -16, 0), SKY), box((-16, -32, 0), (0, -16, 192), SKY), box((640, -32, 0), (656, -16, 192), SKY))
    for x in (160, 320, 480): m.add(box((x - 12, 180, 0), (x + 12, 204, 192), GREY, lightmap=16))
    for i in range(20):
        for j in range(10):
            x, y = 12 + 32 * i, 14 + 36 * j
            m.entity("func_detail", box((x, y, 190), (x + 8, y + 8, 192), faces(BLACK, zm=LAMP), lightmap=16))
    m.entity("light_environment", origin=(320, 192, 96), angles="-40 70 0", pitch="-40", _light="255 240 215 600",
             _ambient="170 200 255 150", SunSpreadAngle="0")
    start(m, 40, 192)
    return m, plain(WHITE, GREY, RED, LAMP, BLACK)


def canyon():
    m = Map("A street between houses under sun and sky: outdoors, most of what a luxel sees is sky or sunlit wall.", skyname="sky_day")
    sky = {d: SKY for d in ("x-", "x+", "y-", "y+", "z+")}
    m.add(room((0, 0, 0), (768, 512, 384), {**sky, "z-": GREY}, lightmap=16))
    for i, (h, colour) in enumerate([(256, WHITE), (160, RED), (208, WHITE), (288, GREEN)]):
        m.add(box((64 + 160 * i, 64, 0), (64 + 160 * i + (160 if i % 2 else 128), 192, h), colour, lightmap=16))
    for i, (h, colour) in enumerate([(192, GREY), (288, WHITE), (128, GREEN)]):
        m.add(box((80 + 208 * i, 304, 0), (80 + 208 * i + 176, 448, h), colour, lightmap=16))
    m.entity("light_environment", origin=(384, 248, 96), angles="-50 60 0", pitch="-50", _light="255 240 215 800",
             _ambient="170 200 255 250", SunSpreadAngle="1")
    start(m, 384, 248)
    return m, plain(WHITE, GREY, RED, GREEN)


def glass(folder):
    os.makedirs(folder, exist_ok=True)
    colours = [(225, 40, 30), (40, 90, 230), (250, 190, 40), (40, 170, 70)]
    textures.png(os.path.join(folder, "stained.png"),
                 [[(20, 20, 20, 255) if x % 16 < 1 or y % 16 < 1 else (*colours[(x // 16 * 3 + y // 16) % 4], 64)
                   for x in range(64)] for y in range(64)])
    # Bars a hand apart; in the lower half a mesh besides, finer than any luxel.
    textures.png(os.path.join(folder, "grate.png"),
                 [[(90, 90, 95, 255 if x % 32 < 8 or y % 32 < 8 or (y >= 32 and (x % 4 < 2 or y % 4 < 2)) else 0)
                   for x in range(64)] for y in range(64)])
    m = Map("Sun through clear glass, stained glass and a grate; behind a green pane a closet without any other light.",
            skyname="sky_day")
    walls = room((0, 0, 0), (448, 256, 160), faces(WHITE, **{"z-": GREY}), lightmap=4)
    del walls[4]  # the wall at y = 0 has the windows
    m.add(walls)
    windows = [((32 + 112 * i, 32), (96 + 112 * i, 128)) for i in range(4)]
    m.add(slab_with_holes(1, (0, -16, 0), (448, 0, 160), windows, faces(WHITE, ym=NODRAW), lightmap=4))
    m.add(box((16, -32, 16), (432, -16, 144), SKY))
    for i, name in enumerate(("kiln/clear", "kiln/stained", "kiln/grate")):
        x = 32 + 112 * i
        m.add(box((x, -10, 32), (x + 64, -8, 128), name, scale=1, lightmap=4))
    # The closet in the corner, and its pane.
    m.add(box((336, 160, 0), (344, 256, 160), WHITE, lightmap=4))
    m.add(slab_with_holes(1, (344, 160, 0), (448, 168, 160), [((364, 16), (428, 112))], WHITE, lightmap=4))
    m.add(box((364, 163, 16), (428, 165, 112), "kiln/green_glass", scale=1, lightmap=4))
    m.entity("light_environment", origin=(128, 96, 96), angles="-40 100 0", pitch="-40", _light="255 240 215 1000",
             _ambient="170 200 255 100", SunSpreadAngle="0.5")
    start(m, 32, 96)
    m.entity("info_camera_view", origin=(24, 240, 120), angles="18 -40 0", fov="88", targetname="windows")
    m.entity("info_camera_view", origin=(280, 40, 72), angles="4 55 0", fov="80", targetname="closet")
    return m, {**plain(WHITE, GREY),
               "kiln/clear": {"reflectance": [0.4, 0.4, 0.4], "alpha": 0.5, "tint": 1},
               "kiln/stained": {"translucent": True, "albedo_map": "textures/stained.png", "size": [64, 64],
                                "reflectance": [0.25, 0.2, 0.15]},
               "kiln/grate": {"alpha_test": 0.5, "albedo_map": "textures/grate.png", "size": [64, 64],
                              "reflectance": [0.1, 0.1, 0.11]},
               "kiln/green_glass": {"reflectance": [0.1, 0.5, 0.15], "alpha": 0.25}}


VMF = {"furnace": furnace, "cornell": cornell, "two_rooms": two_rooms, "corridor": corridor, "thin_wall": thin_wall,
       "sun_room": sun_room, "spot_room": spot_room, "detail_room": detail_room, "leak_room": leak_room,
       "brush_entity": brush_entity, "terrain": terrain, "tube": tube, "maze": maze, "hall": hall, "canyon": canyon}
