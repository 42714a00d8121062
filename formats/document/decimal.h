// Decimal: a number exactly as the map text wrote it, value = mantissa * 10^exponent.
#pragma once
#include "libs/core/archive.h"
#include <cstdint>
#include <optional>
#include <string_view>

namespace kiln {

struct Decimal {
    std::int64_t mantissa = 0;
    std::int32_t exponent = 0;
    bool exact = true; // false: more than 18 significant digits, rounded to 18
    template <class A> void fields(A& a) { a(mantissa, exponent, exact); }

    double to_double() const; // the nearest double
    // Nearest multiple of 2^-bits, in units of 2^-bits (ties away from zero); nothing where |value| > 2^31.
    std::optional<std::int64_t> to_grid(int bits) const;
    bool on_grid(int bits) const; // exactly a multiple of 2^-bits
};
// The whole of `text` as a decimal number: [+-]digits[.digits][(e|E)[+-]digits]; nothing for anything else
// (nan and inf included).
std::optional<Decimal> parse_decimal(std::string_view text);

} // namespace kiln
