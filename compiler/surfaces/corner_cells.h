// Which corners may lie on a segment: those in the cells it passes.
#pragma once
#include "libs/math/vec.h"
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <unordered_map>
#include <vector>

namespace kiln {

template <class Id> class CornerCells {
public:
    void add(Id id, Vec3 p) { cells_[{cell_of(p.x), cell_of(p.y), cell_of(p.z)}].push_back(id); }

    // Calls visit(id) for all corners in cells within `reach` of the segment, slab by slab along its longest axis.
    template <class Visit> void along(Vec3 a, Vec3 b, double reach, const Visit& visit) const {
        const Vec3 d = b - a;
        std::size_t axis = 0;
        for (std::size_t i = 1; i < 3; ++i)
            if (std::abs(d[i]) > std::abs(d[axis])) axis = i;
        const std::int32_t first = cell_of(std::min(a[axis], b[axis]) - reach), last = cell_of(std::max(a[axis], b[axis]) + reach);
        const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
        for (std::int32_t k = first; k <= last; ++k) {
            const auto at = [&](double x) { return d[axis] == 0 ? 0.0 : std::clamp((x - a[axis]) / d[axis], 0.0, 1.0); };
            const double t0 = at(k * kCell - reach), t1 = at((k + 1) * kCell + reach);
            const auto range = [&](std::size_t i) {
                const double x0 = a[i] + d[i] * t0, x1 = a[i] + d[i] * t1;
                return std::array<std::int32_t, 2>{cell_of(std::min(x0, x1) - reach), cell_of(std::max(x0, x1) + reach)};
            };
            const auto [u0, u1] = range(u);
            const auto [v0, v1] = range(v);
            for (std::int32_t i = u0; i <= u1; ++i)
                for (std::int32_t j = v0; j <= v1; ++j) {
                    Cell c{};
                    c[axis] = k, c[u] = i, c[v] = j;
                    if (const auto it = cells_.find(c); it != cells_.end())
                        for (const Id id : it->second) visit(id);
                }
        }
    }

private:
    static constexpr double kCell = 64; // map units: about the spacing of corners in real maps
    using Cell = std::array<std::int32_t, 3>;
    struct Hash {
        std::size_t operator()(const Cell& c) const noexcept {
            std::uint64_t h = 0;
            for (const std::int32_t x : c) h = (h ^ static_cast<std::uint32_t>(x)) * 0x9E3779B97F4A7C15ull, h ^= h >> 29;
            return h;
        }
    };
    static std::int32_t cell_of(double x) { return static_cast<std::int32_t>(std::floor(x / kCell)); }
    std::unordered_map<Cell, std::vector<Id>, Hash> cells_;
};

} // namespace kiln
