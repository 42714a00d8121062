// Which corners may lie on a segment: those in the cells it passes.
#pragma once
#include "libs/math/vec.h"
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

namespace kiln {

template <class Id> class CornerCells {
public:
    // `position(id)` of each. One table of all corners, cell by cell, and a hash of the cells: nothing is allocated a corner.
    template <class Position> CornerCells(const std::vector<Id>& ids, const Position& position) {
        std::vector<std::uint32_t> cell_of_corner;
        cell_of_corner.reserve(ids.size());
        slots_.assign(64, kFree);
        for (const Id id : ids) {
            const Vec3 p = position(id);
            const Cell cell{cell_of(p.x), cell_of(p.y), cell_of(p.z)};
            if ((cells_.size() + 1) * 2 > slots_.size()) grow();
            const std::size_t slot = slot_of(cell);
            if (slots_[slot] == kFree) slots_[slot] = static_cast<std::uint32_t>(cells_.size()), cells_.push_back(cell), first_.push_back(0);
            ++first_[slots_[slot]];
            cell_of_corner.push_back(slots_[slot]);
        }
        first_.push_back(0);
        for (std::uint32_t sum = 0; std::uint32_t& f : first_) sum += std::exchange(f, sum);
        corners_.resize(ids.size());
        std::vector<std::uint32_t> next = first_;
        for (std::size_t i = 0; i < ids.size(); ++i) corners_[next[cell_of_corner[i]]++] = {position(ids[i]), ids[i]};
    }

    // Calls visit(id, position) for all corners in cells within `reach` of the segment, slab by slab along its longest axis.
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
                    const std::uint32_t cell = slots_[slot_of(c)];
                    if (cell == kFree) continue;
                    for (std::uint32_t n = first_[cell]; n < first_[cell + 1]; ++n) visit(corners_[n].id, corners_[n].position);
                }
        }
    }

private:
    static constexpr double kCell = 64; // map units: about the spacing of corners in real maps
    using Cell = std::array<std::int32_t, 3>;
    static constexpr std::uint32_t kFree = UINT32_MAX;
    struct Corner {
        Vec3 position;
        Id id;
    };
    std::size_t slot_of(const Cell& c) const { // where it is or would be
        std::uint64_t h = 0;
        for (const std::int32_t x : c) h = (h ^ static_cast<std::uint32_t>(x)) * 0x9E3779B97F4A7C15ull, h ^= h >> 29;
        std::size_t slot = h & (slots_.size() - 1);
        while (slots_[slot] != kFree && cells_[slots_[slot]] != c) slot = (slot + 1) & (slots_.size() - 1);
        return slot;
    }
    void grow() {
        slots_.assign(slots_.size() * 2, kFree);
        for (std::uint32_t i = 0; i < cells_.size(); ++i) slots_[slot_of(cells_[i])] = i;
    }
    static std::int32_t cell_of(double x) { return static_cast<std::int32_t>(std::floor(x / kCell)); }
    std::vector<std::uint32_t> slots_; // open addressing; into cells_, or kFree
    std::vector<Cell> cells_;
    std::vector<std::uint32_t> first_; // cells + 1, into corners_
    std::vector<Corner> corners_;
};

} // namespace kiln
