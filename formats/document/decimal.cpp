#include "formats/document/decimal.h"
#include "formats/document/document.h"
#include "libs/core/check.h"
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <string>

namespace kiln {
namespace {

constexpr int kDigits = 18;                   // every number of that many digits fits std::int64_t
constexpr std::int32_t kExponentCap = 100000; // beyond it every double is 0 or infinite anyway

constexpr bool is_digit(char c) {
    return c >= '0' && c <= '9';
}

constexpr bool is_space(char c) {
    return c == ' ' || (c >= '\t' && c <= '\r');
}

constexpr __int128 power_of_ten(int n) { // n <= 38
    __int128 p = 1;
    while (n-- > 0) p *= 10;
    return p;
}

// parse_decimal for what nearly all numbers of maps are: at most 18 characters, no exponent. Nothing: it is not that.
std::optional<Decimal> parse_short(std::string_view text) {
    if (text.size() > static_cast<std::size_t>(kDigits)) return std::nullopt;
    const char* p = text.data();
    const char* const end = p + text.size();
    const bool negative = p != end && *p == '-';
    if (negative || (p != end && *p == '+')) ++p;
    std::uint64_t mantissa = 0;
    std::int32_t exponent = 0;
    const char* const digits = p;
    for (; p != end && is_digit(*p); ++p) mantissa = mantissa * 10 + static_cast<std::uint64_t>(*p - '0');
    bool any = p != digits;
    if (p != end && *p == '.') {
        const char* const fraction = ++p;
        for (; p != end && is_digit(*p); ++p) mantissa = mantissa * 10 + static_cast<std::uint64_t>(*p - '0');
        exponent = static_cast<std::int32_t>(fraction - p);
        any = any || p != fraction;
    }
    if (p != end || !any) return std::nullopt;
    if (mantissa == 0) return Decimal{};
    while (mantissa % 10 == 0) mantissa /= 10, ++exponent;
    const auto value = static_cast<std::int64_t>(mantissa);
    return Decimal{negative ? -value : value, exponent, true};
}

} // namespace

std::optional<Decimal> parse_decimal(std::string_view text) {
    if (const std::optional<Decimal> number = parse_short(text)) return number;
    const char* p = text.data();
    const char* const end = p + text.size();
    bool negative = false;
    if (p != end && (*p == '+' || *p == '-')) negative = *p++ == '-';

    Decimal d;
    std::int64_t point = 0; // digits behind the decimal point that went into the mantissa
    int digits = 0;         // significant ones taken
    int next_digit = -1;    // first significant digit that did not fit
    bool any = false, fraction = false;
    for (; p != end; ++p) {
        if (*p == '.' && !fraction) {
            fraction = true;
            continue;
        }
        if (!is_digit(*p)) break;
        any = true;
        const int v = *p - '0';
        if (digits < kDigits) {
            d.mantissa = d.mantissa * 10 + v;
            if (d.mantissa != 0) ++digits;
            if (fraction) --point;
        } else {
            if (next_digit < 0) next_digit = v;
            if (v != 0) d.exact = false;
            if (!fraction) ++point;
        }
    }
    if (!any) return std::nullopt;
    if (next_digit >= 5) ++d.mantissa;

    std::int64_t exponent = 0;
    if (p != end && (*p == 'e' || *p == 'E')) {
        ++p;
        bool down = false;
        if (p != end && (*p == '+' || *p == '-')) down = *p++ == '-';
        if (p == end) return std::nullopt;
        for (; p != end && is_digit(*p); ++p)
            if (exponent < kExponentCap) exponent = exponent * 10 + (*p - '0');
        if (down) exponent = -exponent;
    }
    if (p != end) return std::nullopt;
    if (d.mantissa == 0) return Decimal{};

    exponent += point;
    while (d.mantissa % 10 == 0) d.mantissa /= 10, ++exponent;
    d.exponent = static_cast<std::int32_t>(
        std::min<std::int64_t>(std::max<std::int64_t>(exponent, -kExponentCap), kExponentCap));
    if (negative) d.mantissa = -d.mantissa;
    return d;
}

double Decimal::to_double() const {
    // Both operands exact and one operation: correctly rounded (W. Clinger, PLDI 1990, fast path).
    static constexpr std::array<double, 23> kTens = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                                     1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                                     1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
    constexpr std::int64_t kExactDouble = std::int64_t{1} << 53;
    if (mantissa > -kExactDouble && mantissa < kExactDouble && exponent >= -22 && exponent <= 22) {
        const double m = static_cast<double>(mantissa);
        return exponent < 0 ? m / kTens[static_cast<std::size_t>(-exponent)]
                            : m * kTens[static_cast<std::size_t>(exponent)];
    }
    const std::string text = std::to_string(mantissa) + "e" + std::to_string(exponent);
    double value = 0;
    if (std::from_chars(text.data(), text.data() + text.size(), value).ec == std::errc::result_out_of_range) {
        if (exponent < 0) return mantissa < 0 ? -0.0 : 0.0;
        return std::copysign(std::numeric_limits<double>::infinity(), static_cast<double>(mantissa));
    }
    return value;
}

std::optional<std::int64_t> Decimal::to_grid(int bits) const {
    KILN_CHECK(bits >= 0 && bits <= 30);
    constexpr __int128 kLargest = __int128{1} << 31;
    if (mantissa == 0) return 0;
    if (exponent >= 0) {
        if (exponent > kDigits) return std::nullopt;
        const __int128 value = mantissa * power_of_ten(exponent); // < 10^36
        if (value > kLargest || value < -kLargest) return std::nullopt;
        return static_cast<std::int64_t>(value << bits);
    }
    // |mantissa| * 2^bits < 10^18 * 2^30 < 1.1 * 10^27, so from 10^28 on every value rounds to 0.
    if (exponent <= -28) return 0;
    const __int128 divisor = power_of_ten(-exponent);
    if (mantissa > kLargest * divisor || mantissa < -kLargest * divisor) return std::nullopt; // < 2^31 * 10^27
    const __int128 scaled = static_cast<__int128>(mantissa < 0 ? -mantissa : mantissa) << bits;
    const __int128 quotient = scaled / divisor, rest = scaled % divisor;
    const std::int64_t rounded = static_cast<std::int64_t>(quotient + (2 * rest >= divisor ? 1 : 0));
    return mantissa < 0 ? -rounded : rounded;
}

bool Decimal::on_grid(int bits) const {
    KILN_CHECK(bits >= 0 && bits <= 30);
    if (!exact) return false;
    if (exponent >= 0 || mantissa == 0) return true;
    if (exponent < -27) return false; // 5^27 > 10^18 cannot divide the mantissa
    const __int128 scaled = static_cast<__int128>(mantissa) << bits;
    return scaled % power_of_ten(-exponent) == 0;
}

// Of document.h; here, so that its parts can be inlined: texts of maps are mostly numbers.
std::optional<double> parse_number(std::string_view text) {
    while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
    while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
    const std::optional<Decimal> decimal = parse_decimal(text);
    if (!decimal) return std::nullopt;
    double value = decimal->to_double();
    if (value == 0 && text.front() == '-') return -0.0; // a Decimal knows no sign of zero
    if (!decimal->exact) { // more digits than a Decimal holds: round once, not twice
        if (text.front() == '+') text.remove_prefix(1);
        if (std::from_chars(text.data(), text.data() + text.size(), value).ec != std::errc{}) return std::nullopt;
    }
    if (!std::isfinite(value)) return std::nullopt;
    return value;
}

} // namespace kiln
