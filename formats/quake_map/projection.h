// Texture projections of the .map layouts, brought to the one form of DocTexture, and planes given by four numbers.
// Private to the reader.
#pragma once
#include "formats/document/document.h"

namespace kiln::quake {

using PlanePoints = std::array<std::array<Decimal, 3>, 3>;

// Outward normal of three points, as long as it comes.
Vec3 normal_of(const PlanePoints& points);

// Axes of the classic projection: the texture is laid along the axis plane nearest to the side's plane, then
// turned by `rotation_deg` in it.
void project_standard(DocTexture& texture, Vec3 normal, double rotation_deg);

// QuArK's: the three points are the texture's origin, 128 texels along it and 128 texels up it; `up_first`: the second
// point is the one up (//TX1), else the third (//TX2). Points on a line leave `texture` as it is.
void project_quark(DocTexture& texture, const PlanePoints& points, bool up_first);

// brushDef: the matrix takes coordinates in the face, along Radiant's axis base of its normal, to repeats of the texture.
// False: it is singular; `texture` has one repeat in 64 units.
using TextureMatrix = std::array<std::array<double, 3>, 2>;
bool project_primitive(DocTexture& texture, Vec3 normal, const TextureMatrix& matrix);

// Three points, clockwise seen from outside, of a x + b y + c z + d = 0 with (a, b, c) outward, moved by `shift`; nothing
// where the numbers make no plane or it lies out of reach. How: FORMAT.md.
std::optional<PlanePoints> points_of_plane(const std::array<Decimal, 4>& plane, Vec3 shift);

} // namespace kiln::quake
