#include "compiler/assemble/decimal_math.h"
#include <cmath>
#include <cstdlib>
#include <utility>

namespace kiln::assemble_detail {
namespace {

constexpr __int128 kMantissaEnd = 1'000'000'000'000'000'000; // 10^18

Decimal made(__int128 mantissa, std::int32_t exponent, bool exact) {
    if (mantissa == 0) return {0, 0, exact};
    for (; mantissa % 10 == 0; ++exponent) mantissa /= 10;
    for (; mantissa >= kMantissaEnd || mantissa <= -kMantissaEnd; ++exponent) {
        // The last digit to go decides; those before it are below half of it.
        const __int128 half = mantissa < 0 ? -5 : 5;
        mantissa = (mantissa + half) / 10;
        exact = false;
    }
    for (; mantissa % 10 == 0; ++exponent) mantissa /= 10;
    return {static_cast<std::int64_t>(mantissa), exponent, exact};
}

} // namespace

Decimal negated(Decimal a) {
    a.mantissa = -a.mantissa;
    return a;
}

Decimal sum(Decimal a, Decimal b) {
    if (a.mantissa == 0) return {b.mantissa, b.exponent, a.exact && b.exact};
    if (b.mantissa == 0) return {a.mantissa, a.exponent, a.exact && b.exact};
    if (a.exponent < b.exponent) std::swap(a, b);
    constexpr std::int32_t kWidest = 20; // 10^18 * 10^20 fits an __int128
    if (a.exponent - b.exponent > kWidest) return {a.mantissa, a.exponent, false}; // b is below a's last digit
    __int128 scaled = a.mantissa;
    for (std::int32_t i = a.exponent; i > b.exponent; --i) scaled *= 10;
    return made(scaled + b.mantissa, b.exponent, a.exact && b.exact);
}

Decimal product(Decimal a, Decimal b) {
    return made(static_cast<__int128>(a.mantissa) * b.mantissa, a.exponent + b.exponent, a.exact && b.exact);
}

Decimal rounded_decimal(double x) {
    constexpr double kFine = 1e10, kFineEnd = 1e7, kCoarseEnd = 1e17;
    if (std::fabs(x) < kFineEnd) return made(std::llround(x * kFine), -10, true);
    if (std::fabs(x) < kCoarseEnd) return made(std::llround(x), 0, true);
    return {x < 0 ? -1 : 1, 17, false}; // no coordinate: out of range for all that reads it
}

std::string to_text(Decimal a) {
    if (a.mantissa == 0) return "0";
    std::string digits = std::to_string(std::llabs(a.mantissa));
    if (a.exponent > 0) digits.append(static_cast<std::size_t>(std::min<std::int32_t>(a.exponent, 40)), '0');
    if (a.exponent < 0) {
        const std::size_t behind = static_cast<std::size_t>(std::min<std::int32_t>(-a.exponent, 40));
        if (digits.size() <= behind) digits.insert(0, behind + 1 - digits.size(), '0');
        digits.insert(digits.size() - behind, 1, '.');
    }
    return a.mantissa < 0 ? "-" + digits : digits;
}

Vec3 to_vec(const DecimalPoint& p) { return {p[0].to_double(), p[1].to_double(), p[2].to_double()}; }

} // namespace kiln::assemble_detail
