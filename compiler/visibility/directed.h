// Directed portals: each portal of the map once for each way through it, with the plane tests and the flood that
// bound what can be seen through it. Private to compiler/visibility.
#pragma once
#include "compiler/visibility/kernels.h"
#include "compiler/visibility/visibility.h"
#include <bit>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace kiln::vis {

// What the stage promises holds for lines of sight: those that pass each portal at least kInside within its edges and, from one
// portal to a later one, leave the planes of both by more than the noise. NOTES.md derives it.
constexpr double kInside = 1e-6; // map units
// Distances below this are rounding of the doubles the windings come in, not geometry.
constexpr double kNoise = 1e-7; // map units
// The error of dot(n, x) - d in doubles, n of length one and d such a dot, nowhere farther out than `reach` along an axis: four
// roundings of at most (sqrt 3 + sqrt 3) reach, and the normal's own length.
constexpr double evaluation_error(double reach) { return 16 * 0x1p-53 * reach; }
struct Rounding {
    double noise = kNoise; // larger only where coordinates are so large that doubles cannot tell it
    double error = 0;      // of evaluating a plane
};

struct Plane {
    Vec3 normal{};
    double distance = 0;
    double at(Vec3 p) const { return dot(normal, p) - distance; }
};

struct Directed {
    Vec3 center{};
    double radius = 0;
    std::span<const Vec3> points; // *winding
    Plane plane;           // normal along the way of travel
    bool has_plane = true; // false: the winding has no area; no plane test may reject it
    std::uint32_t from = 0, to = 0;
    const std::vector<Vec3>* winding = nullptr;
    PointsView shape; // the same points
    double sphere[4] = {}; // center and radius
};

// Portal i of the map is directed portals 2i (front to back) and 2i + 1 (back to front).
constexpr std::uint32_t reversed(std::uint32_t p) { return p ^ 1u; }
struct DirectedPortals {
    DirectedPortals() = default;
    DirectedPortals(const DirectedPortals&) = delete; // the shapes look into `coordinates`
    DirectedPortals(DirectedPortals&&) = default;
    std::vector<Directed> ways;
    std::vector<double> coordinates; // what `shape` looks at
    Rounding rounding;
    operator std::span<const Directed>() const { return ways; }
};
DirectedPortals directed_portals(std::span<const VisPortal> portals);

// Bit matrix with rows of whole words.
class BitRows {
public:
    BitRows() = default;
    BitRows(std::size_t rows, std::size_t bits) : words_((bits + 63) / 64), data_(rows * words_) {}
    std::size_t words() const { return words_; }
    std::vector<std::uint64_t>& data() { return data_; }
    std::uint64_t* row(std::size_t r) { return data_.data() + r * words_; }
    const std::uint64_t* row(std::size_t r) const { return data_.data() + r * words_; }

private:
    std::size_t words_ = 0;
    std::vector<std::uint64_t> data_;
};
inline bool get_bit(const std::uint64_t* row, std::size_t i) { return row[i / 64] >> (i % 64) & 1; }
inline void set_bit(std::uint64_t* row, std::size_t i) { row[i / 64] |= std::uint64_t{1} << (i % 64); }
inline void clear_bit(std::uint64_t* row, std::size_t i) { row[i / 64] &= ~(std::uint64_t{1} << (i % 64)); }
inline std::size_t count_bits(const std::uint64_t* row, std::size_t words) {
    std::size_t n = 0;
    for (std::size_t w = 0; w < words; ++w) n += static_cast<std::size_t>(std::popcount(row[w]));
    return n;
}

// The directed portals that leave each cluster, in order of their ids.
struct Exits {
    std::vector<std::uint32_t> first, portal; // cluster c: portal[first[c] .. first[c + 1])
    std::span<const std::uint32_t> of(std::uint32_t cluster) const {
        return {portal.data() + first[cluster], portal.data() + first[cluster + 1]};
    }
};
Exits exits_of(std::span<const Directed> portals, std::uint32_t cluster_count);

// Row p, bit q: a line can go forward through p and later forward through q, as far as the flood can tell: q is reached
// from p through portals each of which passes the plane tests against p and against the portal before it.
// `radius`: of sight, map units, 0: no limit. Once `stop` says so, ways that are left take what their plane tests alone say.
BitRows flood(const DirectedPortals& portals, const Exits& exits, double radius, const std::function<bool()>& stop, Context& context);

} // namespace kiln::vis
