#!/usr/bin/env python3
"""Draws every level of this folder: `maps/draw.py` rewrites all of them, `maps/draw.py NAME...` some.

The levels are drawn as text here (drawing/phenomena.py, drawing/atrium.py) and written as maps/NAME/NAME.vmf or
.map with NAME.materials.json beside. What is written is committed, so nobody needs Python to bake it.
"""
import json
import os
import re
import sys

sys.dont_write_bytecode = True
here = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, here)
from drawing import atrium, phenomena  # noqa: E402


def write(name, extension, text, materials):
    folder = os.path.join(here, name)
    os.makedirs(folder, exist_ok=True)
    with open(os.path.join(folder, name + extension), "w", newline="\n") as f:
        f.write(text)
    body = json.dumps({"materials": materials}, indent=1)
    body = re.sub(r"\[\s+([^\[\]{}]*?)\s+\]", lambda m: "[" + re.sub(r"\s+", " ", m.group(1)) + "]", body)
    with open(os.path.join(folder, name + ".materials.json"), "w", newline="\n") as f:
        f.write(body + "\n")


def main(wanted):
    known = [*phenomena.VMF, "quake_room", "quake_room_valve220", "glass", "atrium"]
    for name in wanted or known:
        if name in phenomena.VMF:
            m, materials = phenomena.VMF[name]()
            write(name, ".vmf", m.vmf(), materials)
        elif name.startswith("quake_room"):
            m, materials = phenomena.quake_room()
            write(name, ".map", m.quake(valve220=name.endswith("valve220")), materials)
        elif name == "glass":
            m, materials = phenomena.glass(os.path.join(here, name, "textures"))
            write(name, ".vmf", m.vmf(), materials)
        elif name == "atrium":
            m, materials = atrium.draw(os.path.join(here, "atrium", "textures"))
            write(name, ".vmf", m.vmf(), materials)
        else:
            sys.exit(f"no level is called {name}; there are {' '.join(known)}")


main(sys.argv[1:])
