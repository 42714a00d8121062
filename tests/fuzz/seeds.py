#!/usr/bin/env python3
"""Seeds for the fuzz targets: small maps cut from whole ones.

usage: seeds.py OUT SIZE FILE...

Fuzzing wants inputs of a few thousand bytes that are read to their end. A map of SIZE bytes or less is taken as it is; of a larger
one, several pieces are made: its first block (the world) or another block of the file, with only some of the blocks inside, so that
braces stay balanced. What is taken depends on the file's text alone.
"""
import hashlib
import os
import random
import sys

PIECES = 6  # of one large map


def blocks(lines):
    """Lines as a tree: text, or [opening lines, children, closing line]."""
    root = [[], [], None]
    stack = [root]
    for line in lines:
        word = line.strip()
        if word == b"{":
            node = [[line], [], None]
            above = stack[-1][1]
            while above and isinstance(above[-1], bytes) and above[-1].strip() and above[-1].strip()[:1].isalpha():
                node[0].insert(0, above.pop())  # the name of a VMF block
            above.append(node)
            stack.append(node)
        elif word == b"}" and len(stack) > 1:
            stack.pop()[2] = line
        else:
            stack[-1][1].append(line)
    return root


def text(node):
    if isinstance(node, bytes):
        return node
    return b"".join(node[0]) + b"".join(text(c) for c in node[1]) + (node[2] or b"")


def thinned(node, choose, children):
    """A block with its own text and some of the blocks in it."""
    inner = [i for i, c in enumerate(node[1]) if not isinstance(c, bytes)]
    kept = set(choose.sample(inner, min(children, len(inner))))
    return [node[0], [c for i, c in enumerate(node[1]) if isinstance(c, bytes) or i in kept], node[2]]


def pieces(data, size):
    choose = random.Random(hashlib.sha256(data).digest())
    root = blocks(data.splitlines(keepends=True))
    tops = [c for c in root[1] if not isinstance(c, bytes)]
    world = [t for t in tops if b"worldspawn" in text(t)[:20000]][:1]
    for piece in range(PIECES):
        some = [thinned(t, choose, 2) for t in world + choose.sample(tops, min(2, len(tops)))]
        out = b"".join(text(t) for t in some)
        if len(out) <= size:
            yield out


def main():
    out, size, files = sys.argv[1], int(sys.argv[2]), sys.argv[3:]
    os.makedirs(out, exist_ok=True)
    for name in files:
        with open(name, "rb") as f:
            data = f.read()
        for seed in [data] if len(data) <= size else pieces(data, size):
            with open(os.path.join(out, hashlib.sha256(seed).hexdigest()[:16]), "wb") as f:
                f.write(seed)


main()
