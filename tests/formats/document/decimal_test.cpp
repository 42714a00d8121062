#include "formats/document/decimal.h"
#include <cmath>
#include <cstdlib>
#include <gtest/gtest.h>
#include <limits>
#include <random>
#include <string>

namespace kiln {
namespace {

Decimal decimal(const std::string& text) {
    const std::optional<Decimal> d = parse_decimal(text);
    EXPECT_TRUE(d.has_value()) << text;
    return d.value_or(Decimal{});
}

// Short texts go a short way; zeros in front send the same number the long one.
TEST(Decimal, ShortAndLongTextsAreReadAlike) {
    std::mt19937 random(12);
    const std::string letters = "0123456789012345678900..-+e";
    int numbers = 0;
    for (int i = 0; i < 300000; ++i) {
        std::string text;
        for (auto n = random() % 18 + 1; n > 0; --n) text += letters[random() % letters.size()];
        const std::size_t sign = text[0] == '-' || text[0] == '+';
        if (sign == text.size() || text[sign] == '-' || text[sign] == '+' || text[sign] == 'e') continue;
        const std::optional<Decimal> a = parse_decimal(text);
        const std::optional<Decimal> b = parse_decimal(text.substr(0, sign) + std::string(20, '0') + text.substr(sign));
        // Zeros alone make a number of what has no digit.
        if (!a && b && text.find_first_of("0123456789") == std::string::npos) continue;
        if (!a && b) {
            EXPECT_EQ(text[sign], '.') << text;
        }
        if (!a || !b) continue;
        ++numbers;
        EXPECT_EQ(a->mantissa, b->mantissa) << text;
        EXPECT_EQ(a->exponent, b->exponent) << text;
        EXPECT_EQ(a->exact, b->exact) << text;
    }
    EXPECT_GT(numbers, 10000);
}

TEST(Decimal, ReadsWhatMapsContain) {
    const struct {
        const char* text;
        double value;
    } cases[] = {
        {"0", 0},
        {"-0", 0},
        {"+5", 5},
        {"-448", -448},
        {".5", 0.5},
        {"5.", 5},
        {"-19.88235294117618", -19.88235294117618},
        {"4.00061e-005", 4.00061e-005},
        {"1E3", 1000},
        {"-2.5e+2", -250},
        {"0.000000", 0},
        {"512.000000", 512},
        {"0001.50", 1.5},
        {"131072", 131072},
    };
    for (const auto& c : cases) EXPECT_EQ(decimal(c.text).to_double(), c.value) << c.text;
}

TEST(Decimal, RefusesWhatIsNoNumber) {
    for (const char* text : {"", "-", "+", ".", "-.", "e5", "1e", "1e+", "nan", "inf", "-inf", "1.2.3", "1,5",
                             "0x10", "1 ", " 1", "12a", "--1"})
        EXPECT_FALSE(parse_decimal(text)) << text;
}

TEST(Decimal, EqualNumbersAreEqualValues) {
    for (const char* text : {"64", "64.0", "+64.000", "6.4e1", "640e-1", "0064"}) {
        EXPECT_EQ(decimal(text).mantissa, 64) << text;
        EXPECT_EQ(decimal(text).exponent, 0) << text;
    }
}

// Law: the double is the one strtod gives (glibc rounds correctly).
TEST(Decimal, DoublesAreCorrectlyRounded) {
    std::mt19937_64 random(1);
    for (int i = 0; i < 200000; ++i) {
        const std::int64_t m = static_cast<std::int64_t>(random() % 1'000'000'000'000'000'000ull);
        const int e = static_cast<int>(random() % 60) - 40;
        const std::string text =
            (random() & 1 ? "-" : "") + std::to_string(m >> (random() % 60)) + "e" + std::to_string(e);
        ASSERT_EQ(decimal(text).to_double(), std::strtod(text.c_str(), nullptr)) << text;
    }
    EXPECT_EQ(decimal("1e999").to_double(), std::numeric_limits<double>::infinity());
    EXPECT_EQ(decimal("-1e99999999999").to_double(), -std::numeric_limits<double>::infinity());
    EXPECT_EQ(decimal("1e-99999999999").to_double(), 0);
}

TEST(Decimal, MoreThan18DigitsAreRoundedAndSaySo) {
    EXPECT_TRUE(decimal("0.123456789012345678").exact);
    EXPECT_FALSE(decimal("0.1234567890123456789").exact);
    EXPECT_EQ(decimal("0.1234567890123456789").mantissa, 123456789012345679);
    EXPECT_TRUE(decimal("64.00000000000000000000000").exact);
    EXPECT_TRUE(decimal("0.00000000000000000000000000005").exact);
    EXPECT_FALSE(decimal("64.00000000000000000000001").exact);
    EXPECT_EQ(decimal("99999999999999999999999").to_double(), 1e23);
    EXPECT_EQ(decimal("12345678901234567890123").exponent, 5);
}

TEST(Decimal, GridIsNearestWithTiesAwayFromZero) {
    EXPECT_EQ(decimal("1.5").to_grid(0), 2);
    EXPECT_EQ(decimal("-1.5").to_grid(0), -2);
    EXPECT_EQ(decimal("1.49999999999999999").to_grid(0), 1);
    EXPECT_EQ(decimal("0.1").to_grid(10), 102);
    EXPECT_EQ(decimal("-0.1").to_grid(10), -102);
    EXPECT_EQ(decimal("1e-40").to_grid(10), 0);
    EXPECT_EQ(decimal("1e-28").to_grid(30), 0);
    EXPECT_EQ(decimal("0").to_grid(30), 0);
    EXPECT_EQ(decimal("2147483648").to_grid(0), 2147483648);
    EXPECT_EQ(decimal("-2147483648").to_grid(10), -2147483648 * 1024);
    for (const char* text : {"2147483649", "2147483648.1", "1e18", "-1e30", "1e9999"})
        EXPECT_FALSE(decimal(text).to_grid(4)) << text;
}

// Law: n/2^bits, written out in decimals, comes back as n and lies on that grid, and not on a coarser one.
TEST(Decimal, GridPointsComeBackExactly) {
    std::mt19937_64 random(2);
    for (int bits = 0; bits <= 10; ++bits)
        for (int i = 0; i < 2000; ++i) {
            const std::int64_t n = static_cast<std::int64_t>(random() % (1u << 20)) - (1 << 19);
            char text[64];
            std::snprintf(text, sizeof text, "%.10f",
                          std::ldexp(static_cast<double>(n), -bits)); // 10 digits hold 2^-10
            const Decimal d = decimal(text);
            ASSERT_EQ(d.to_grid(bits), n) << text;
            ASSERT_TRUE(d.on_grid(bits)) << text;
            ASSERT_EQ(d.to_grid(bits + 3), n * 8) << text;
            if (bits > 0 && n % 2 != 0) {
                ASSERT_FALSE(d.on_grid(bits - 1)) << text;
            }
        }
    EXPECT_FALSE(decimal("0.1").on_grid(30));
    EXPECT_FALSE(decimal("0.3333333333333333333333").on_grid(30));
    EXPECT_TRUE(decimal("1e30").on_grid(0));
}

} // namespace
} // namespace kiln
