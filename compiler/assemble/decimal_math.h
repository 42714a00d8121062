// Private: sums and products of decimals, exact as long as 18 digits hold them (map coordinates: always).
#pragma once
#include "formats/document/decimal.h"
#include "libs/math/vec.h"
#include <array>
#include <string>

namespace kiln::assemble_detail {

using DecimalPoint = std::array<Decimal, 3>;

Decimal negated(Decimal a);
Decimal sum(Decimal a, Decimal b);     // more than 18 digits: rounded, and marked as not exact
Decimal product(Decimal a, Decimal b); // likewise
Decimal rounded_decimal(double x);     // the nearest multiple of 1e-10; coarser beyond 1e7
std::string to_text(Decimal a);        // plain digits, no exponent: "-12.5"

Vec3 to_vec(const DecimalPoint& p);

} // namespace kiln::assemble_detail
