// The light against independent renderers: tables measured elsewhere, kept beside the project (skipped where absent).
#include "tests/support/program.h"
#include <cmath>
#include <map>
#include <numbers>
#include <sstream>

using namespace kiln::test;

namespace {

const std::filesystem::path kReference = std::filesystem::path(KILN_SOURCE_DIR) / "../shared/reference";

struct Value {
    std::array<double, 3> rgb{}, error{};
};
using Table = std::map<std::array<std::string, 3>, Value>; // (kind, id, direction)

Table read_table(std::istream& in) {
    Table table;
    bool header = true;
    for (std::string line; std::getline(in, line);) {
        if (line.empty() || line[0] == '#') continue;
        if (std::exchange(header, false)) continue;
        std::istringstream cells(line);
        std::array<std::string, 9> c;
        for (auto& cell : c) std::getline(cells, cell, ',');
        Value v;
        for (std::size_t k = 0; k < 3; ++k) v.rgb[k] = std::stod(c[3 + k]), v.error[k] = c[6 + k].empty() ? 0 : std::stod(c[6 + k]);
        table[{c[0], c[1], c[2]}] = v;
    }
    return table;
}
Table read_table(const std::string& path) {
    std::ifstream in(path);
    return read_table(in);
}

// rRMSE of a group of rows, percent; floor 2 % of the group's mean per channel. Free points are one group.
std::map<std::string, double> errors(const Table& expected, const Table& got) {
    struct Sum { std::array<double, 3> mean{}; double square = 0; std::size_t n = 0; };
    std::map<std::string, Sum> groups;
    const auto group = [](const auto& key) { return key[0] == "s" ? key[2] : std::string("cube"); };
    for (const auto& [key, v] : expected) {
        Sum& s = groups[group(key)];
        ++s.n;
        for (std::size_t c = 0; c < 3; ++c) s.mean[c] += v.rgb[c];
    }
    for (const auto& [key, v] : expected) {
        Sum& s = groups[group(key)];
        const auto it = got.find(key);
        EXPECT_TRUE(it != got.end()) << key[0] << key[1] << key[2];
        if (it == got.end()) continue;
        for (std::size_t c = 0; c < 3; ++c) {
            const double floor = std::max(v.rgb[c], 0.02 * s.mean[c] / static_cast<double>(s.n));
            s.square += std::pow((it->second.rgb[c] - v.rgb[c]) / floor, 2);
        }
    }
    std::map<std::string, double> out;
    for (const auto& [name, s] : groups) out[name] = 100 * std::sqrt(s.square / static_cast<double>(3 * s.n));
    return out;
}

Table run(const Workplace& w, const std::string& command, const std::string& scene, const std::string& map, std::vector<std::string> more) {
    std::vector<std::string> words = {command, (kReference / map).string(), "--points", (kReference / (scene + ".points.csv")).string(), "-o", w.path("got.csv"), "-q"};
    words.insert(words.end(), more.begin(), more.end());
    const Outcome o = w.run(words);
    EXPECT_EQ(o.code, 0) << o.said;
    return read_table(w.path("got.csv"));
}

class Reference : public ::testing::Test {
protected:
    void SetUp() override {
        if (!std::filesystem::exists(kReference)) GTEST_SKIP() << "no reference tables at " << kReference;
    }
    const Workplace w;
};

} // namespace

// Radiance 1 everywhere: irradiance pi, tilted values pi (1 + 1/sqrt 3)/2, cube faces pi. Sharpest test of leaks and energy.
TEST_F(Reference, FurnaceIsUniformToHalfAPercent) {
    const Table got = run(w, "gather", "furnace", "furnace.vmf", {"--error", "2"});
    ASSERT_GT(got.size(), 500u);
    for (const auto& [key, v] : got) {
        const double exact = key[2][0] == 'b' ? std::numbers::pi * (1 + 1 / std::sqrt(3.0)) / 2 : std::numbers::pi;
        for (const double x : v.rgb) EXPECT_NEAR(x, exact, 0.005 * exact) << key[0] << " " << key[1] << " " << key[2];
    }
}

TEST_F(Reference, CornellGatherWithinTwoPercent) {
    const Table got = run(w, "gather", "cornell", "cornell.vmf", {"--error", "2"});
    for (const auto& [name, e] : errors(read_table((kReference / "cornell.expected.csv").string()), got)) EXPECT_LE(e, 2.0) << name;
}

// The path tracer against the tables within both standard errors: mean of squared deviations in sigmas near 1.
TEST_F(Reference, CornellPathTracerAgreesWithinItsStandardErrors) {
    const Table expected = read_table((kReference / "cornell.expected.csv").string());
    const Table got = run(w, "reference", "cornell", "cornell.vmf", {"--rays", "4096"});
    double chi = 0;
    std::size_t n = 0;
    for (const auto& [key, v] : expected)
        for (std::size_t c = 0; c < 3; ++c, ++n) {
            const Value& g = got.at(key);
            chi += std::pow(g.rgb[c] - v.rgb[c], 2) / (std::pow(g.error[c], 2) + std::pow(v.error[c], 2));
        }
    // Replicates estimate each sigma from 15 degrees of freedom: the expected mean is 15/13; correlated channels and
    // directions leave about n/4 independent deviations.
    EXPECT_NEAR(chi / static_cast<double>(n), 15.0 / 13, 0.35);
    for (const auto& [name, e] : errors(expected, got)) EXPECT_LE(e, 4.0) << name;
}

TEST_F(Reference, RealMapGatherWithinSixPercent) {
    const Table got = run(w, "gather", "e1m1_world", "e1m1_world.map", {"--error", "5"});
    for (const auto& [name, e] : errors(read_table((kReference / "e1m1_world.expected.csv").string()), got)) EXPECT_LE(e, 6.0) << name;
}
