// Private: where an instance stands, and what that does to points, brushes and angles.
//
// Angles are those of the Source engine, degrees: rotation = yaw about z * pitch about y * roll about x, each
// right-handed; a positive pitch looks down.
#pragma once
#include "compiler/assemble/decimal_math.h"
#include "formats/document/document.h"

namespace kiln::assemble_detail {

using Matrix = std::array<Vec3, 3>; // rows

Matrix matrix_of_angles(Vec3 pitch_yaw_roll_deg); // quarter turns give exact zeros and ones
Vec3 angles_of_matrix(const Matrix& m);           // degrees, each in (-180, 180]
Matrix product(const Matrix& a, const Matrix& b);
Matrix transposed(const Matrix& m);
Vec3 operator*(const Matrix& m, Vec3 v);

struct Placement {
    Matrix rotation{Vec3{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    DecimalPoint origin{};
    DecimalPoint scale{Decimal{1, 0, true}, Decimal{1, 0, true}, Decimal{1, 0, true}}; // > 0; before the rotation

    bool quarter_turns() const; // the rotation only permutes and negates axes: decimals stay exact
    bool turned() const;        // the rotation is not the identity

    DecimalPoint point(const DecimalPoint& p) const; // exact for quarter turns; else to the nearest 1e-10 map unit
    Vec3 point(Vec3 p) const;
    Vec3 offset(Vec3 v) const;    // a difference of points: scaled and rotated
    Vec3 direction(Vec3 v) const; // rotated only
};

void place(DocSide& side, const Placement& placement);
void place(DocDisplacement& displacement, const Placement& placement);
void place(DocPatch& patch, const Placement& placement);

} // namespace kiln::assemble_detail
