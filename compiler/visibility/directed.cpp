#include "compiler/visibility/directed.h"
#include "libs/parallel/parallel.h"
#include <algorithm>

namespace kiln::vis {

DirectedPortals directed_portals(std::span<const VisPortal> portals) {
    DirectedPortals result;
    double reach = 0;
    std::size_t room = 0;
    for (const VisPortal& portal : portals) {
        room += padded(static_cast<std::uint32_t>(portal.winding.size()));
        for (const Vec3& p : portal.winding) reach = std::max({reach, std::abs(p.x), std::abs(p.y), std::abs(p.z)});
    }
    Rounding& rounding = result.rounding;
    rounding.error = evaluation_error(reach);
    rounding.noise = std::max(kNoise, 4 * rounding.error);
    result.coordinates.resize(3 * room);
    double *x = result.coordinates.data(), *y = x + room, *z = y + room;
    std::vector<Directed>& out = result.ways;
    out.resize(portals.size() * 2);
    for (std::size_t i = 0; i < portals.size(); ++i) {
        const std::vector<Vec3>& w = portals[i].winding;
        Vec3 center{}, area{};
        for (const Vec3& p : w) center += p;
        center *= 1.0 / static_cast<double>(std::max<std::size_t>(w.size(), 1));
        for (std::size_t k = 0; k < w.size(); ++k) area += cross(w[k] - center, w[(k + 1) % w.size()] - center);
        double radius = 0;
        for (const Vec3& p : w) radius = std::max(radius, length(p - center));
        radius += rounding.error;
        const double size = length(area);
        const bool has_plane = size > kNoise * radius && size > 0;
        const Vec3 n = has_plane ? area / size : Vec3{};
        const PointsView shape{x, y, z, static_cast<std::uint32_t>(w.size())};
        for (std::uint32_t k = 0; k < padded(shape.n); ++k) {
            const Vec3& p = w[k < w.size() ? k : 0];
            *x++ = p.x, *y++ = p.y, *z++ = p.z;
        }
        for (std::uint32_t back = 0; back < 2; ++back) {
            Directed& d = out[2 * i + back];
            d.winding = &w, d.points = w, d.shape = shape;
            d.plane.normal = back ? n : -n; // the winding's normal looks to the front cluster
            d.plane.distance = dot(d.plane.normal, center);
            d.has_plane = has_plane;
            d.from = back ? portals[i].cluster_back : portals[i].cluster_front;
            d.to = back ? portals[i].cluster_front : portals[i].cluster_back;
            d.center = center;
            d.radius = radius;
            d.sphere[0] = center.x, d.sphere[1] = center.y, d.sphere[2] = center.z, d.sphere[3] = radius;
        }
    }
    return result;
}

Exits exits_of(std::span<const Directed> portals, std::uint32_t cluster_count) {
    Exits e;
    e.first.assign(cluster_count + 1, 0);
    for (const Directed& p : portals) ++e.first[p.from + 1];
    for (std::size_t c = 0; c < cluster_count; ++c) e.first[c + 1] += e.first[c];
    e.portal.resize(portals.size());
    std::vector<std::uint32_t> next(e.first.begin(), e.first.end() - 1);
    for (std::uint32_t p = 0; p < portals.size(); ++p) e.portal[next[portals[p].from]++] = p;
    return e;
}

RowLayout::RowLayout(const BitRows& of) : blocks_((of.words() + kBlockWords - 1) / kBlockWords), slot_(of.rows() * blocks_), count_(of.rows()) {
    for (std::size_t r = 0; r < of.rows(); ++r)
        for (std::size_t w = 0; w < of.words(); ++w)
            if (std::uint32_t& slot = slot_[r * blocks_ + w / kBlockWords]; of.row(r)[w] && !slot) slot = ++count_[r];
}
RowLayout::RowLayout(std::size_t rows, std::size_t bits, std::span<const std::uint64_t> there) : blocks_((bits + 64 * kBlockWords - 1) / (64 * kBlockWords)), slot_(rows * blocks_), count_(rows) {
    for (std::size_t i = 0; i < slot_.size() && i / 64 < there.size(); ++i)
        if (get_bit(there.data(), i)) slot_[i] = ++count_[i / blocks_];
}
std::vector<std::uint64_t> RowLayout::there() const {
    std::vector<std::uint64_t> out((slot_.size() + 63) / 64);
    for (std::size_t i = 0; i < slot_.size(); ++i)
        if (slot_[i]) set_bit(out.data(), i);
    return out;
}
SparseRows::SparseRows(const BitRows& of) : SparseRows(std::make_shared<const RowLayout>(of)) {
    for (std::size_t r = 0; r < of.rows(); ++r)
        for (std::size_t w = 0; w < of.words(); ++w)
            if (of.row(r)[w]) *row(r).place(w * 64) = of.row(r)[w];
}

namespace {

// Rows and columns of 64 by 64 bits change places.
void transpose(std::uint64_t (&a)[64]) {
    std::uint64_t mask = 0x00000000ffffffffull;
    for (unsigned j = 32; j; j >>= 1, mask ^= mask << j)
        for (unsigned k = 0; k < 64; k = ((k | j) + 1) & ~j) {
            const std::uint64_t t = ((a[k] >> j) ^ a[k | j]) & mask;
            a[k] ^= t << j, a[k | j] ^= t;
        }
}
BitRows transposed(const BitRows& of, std::size_t n, Context& context) {
    constexpr std::size_t kTile = 8; // words, as much as a cache line on both sides
    BitRows out(n, n);
    const std::size_t words = of.words();
    parallel_for(context, (words + kTile - 1) / kTile, [&](std::size_t tile) {
        for (std::size_t v0 = 0; v0 < words; v0 += kTile)
            for (std::size_t w = tile * kTile; w < std::min(words, (tile + 1) * kTile); ++w)
                for (std::size_t v = v0; v < std::min(words, v0 + kTile); ++v) {
                    std::uint64_t block[64], any = 0;
                    for (std::size_t k = 0; k < 64; ++k) any |= block[k] = v * 64 + k < n ? of.row(v * 64 + k)[w] : 0;
                    if (!any) continue;
                    transpose(block);
                    for (std::size_t k = 0; k < 64 && w * 64 + k < n; ++k) out.row(w * 64 + k)[v] = block[k];
                }
    });
    return out;
}
// Bit k of the lower half to bit 2 k.
std::uint64_t spread(std::uint64_t x) {
    x &= 0xffffffffull;
    x = (x | x << 16) & 0x0000ffff0000ffffull;
    x = (x | x << 8) & 0x00ff00ff00ff00ffull;
    x = (x | x << 4) & 0x0f0f0f0f0f0f0f0full;
    x = (x | x << 2) & 0x3333333333333333ull;
    return (x | x << 1) & 0x5555555555555555ull;
}

// Least distance of two boxes: nothing of the one is nearer to anything of the other.
double distance(const Box3& a, const Box3& b) {
    Vec3 gap;
    for (std::size_t k = 0; k < 3; ++k) gap[k] = std::max({0.0, a.lo[k] - b.hi[k], b.lo[k] - a.hi[k]});
    return length(gap);
}

// Row p, bit q: q lies in part in front of the plane of p, and p in part behind that of q.
BitRows plane_tests(const DirectedPortals& of, double radius, const std::function<bool()>& stop, Context& context) {
    const std::span<const Directed> ways = of.ways;
    const std::size_t n = ways.size(), portals = n / 2;
    std::vector<PointsView> shapes(portals);
    std::vector<double> spheres[4], around[4]; // of each portal, and of each 64
    const double *sphere[4], *group[4];
    for (std::size_t k = 0; k < 4; ++k) {
        spheres[k].assign((portals + 3) & ~std::size_t{3}, 0), around[k].assign((portals + 63) / 64, 0);
        sphere[k] = spheres[k].data(), group[k] = around[k].data();
    }
    for (std::size_t i = 0; i < portals; ++i) {
        shapes[i] = ways[2 * i].shape;
        for (std::size_t k = 0; k < 4; ++k) spheres[k][i] = ways[2 * i].sphere[k];
    }
    for (std::size_t g = 0; g < around[0].size(); ++g) {
        const std::span<const Directed> members = ways.subspan(128 * g, std::min<std::size_t>(128, n - 128 * g));
        Box3 box;
        for (const Directed& d : members) box.add(d.center);
        const Vec3 center = box.center();
        for (std::size_t k = 0; k < 3; ++k) around[k][g] = center[k];
        for (const Directed& d : members) around[3][g] = std::max(around[3][g], length(d.center - center) + d.radius);
    }
    // Of each portal's plane, its normal as that of its second way.
    BitRows front(portals, portals), back(portals, portals);
    parallel_for(context, portals, [&](std::size_t i) {
        const Directed& w = ways[2 * i + 1];
        if (!w.has_plane || stop()) {
            std::fill_n(front.row(i), front.words(), ~std::uint64_t{0});
            std::fill_n(back.row(i), back.words(), ~std::uint64_t{0});
            return;
        }
        const double plane[4] = {w.plane.normal.x, w.plane.normal.y, w.plane.normal.z, w.plane.distance};
        kernels().sides(plane, group, sphere, shapes.data(), portals, of.rounding.noise, front.row(i), back.row(i));
    });
    const BitRows in_front_of = transposed(front, portals, context), behind = transposed(back, portals, context); // row i, bit j: i is so of j
    std::vector<Box3> boxes(radius > 0 ? portals : 0);
    for (std::size_t i = 0; i < boxes.size(); ++i)
        for (const Vec3& v : ways[2 * i].points) boxes[i].add(v);
    BitRows base(n, n);
    parallel_for(context, portals, [&](std::size_t i) {
        for (std::size_t side = 0; side < 2; ++side) {
            std::uint64_t* row = base.row(2 * i + side);
            const std::uint64_t* seen = side ? front.row(i) : back.row(i);
            for (std::size_t w = 0; w < base.words(); ++w) {
                const unsigned half = w % 2 ? 32 : 0;
                row[w] = spread((seen[w / 2] & in_front_of.row(i)[w / 2]) >> half) | spread((seen[w / 2] & behind.row(i)[w / 2]) >> half) << 1;
            }
            clear_bit(row, 2 * i), clear_bit(row, 2 * i + 1);
            for (std::size_t j = 0; j < boxes.size(); ++j)
                if ((get_bit(row, 2 * j) || get_bit(row, 2 * j + 1)) && distance(boxes[i], boxes[j]) > radius) clear_bit(row, 2 * j), clear_bit(row, 2 * j + 1);
        }
    });
    return base;
}

} // namespace

SparseRows flood(const DirectedPortals& of, const Exits& exits, double radius, const std::function<bool()>& stop, Context& context) {
    const std::span<const Directed> portals = of.ways;
    const std::size_t n = portals.size();
    BitRows base = plane_tests(of, radius, stop, context), reach(n, n);
    // Exits that a way may go on to, as the test against it alone says: side by side, where there are not too many (clusters with very many portals).
    constexpr std::size_t kMostListed = std::size_t{1} << 26;
    std::size_t pairs = 0;
    for (const Directed& p : portals) pairs += exits.of(p.to).size();
    const bool listed = pairs <= kMostListed;
    Exits next;
    if (listed) {
        next.first.assign(1, 0);
        for (std::size_t p = 0; p < n; ++p) {
            for (const std::uint32_t q : exits.of(portals[p].to))
                if (get_bit(base.row(p), q)) next.portal.push_back(q);
            next.first.push_back(static_cast<std::uint32_t>(next.portal.size()));
        }
    }
    parallel_for(context, n, [&](std::size_t p) {
        const std::uint64_t* front = base.row(p);
        std::uint64_t* row = reach.row(p);
        if (stop()) {
            std::copy_n(front, reach.words(), row);
            return;
        }
        std::vector<std::uint32_t> open{static_cast<std::uint32_t>(p)};
        while (!open.empty()) {
            const std::uint32_t last = open.back();
            open.pop_back();
            for (const std::uint32_t q : listed ? next.of(last) : exits.of(portals[last].to))
                if (get_bit(front, q) && !get_bit(row, q) && (listed || get_bit(base.row(last), q))) set_bit(row, q), open.push_back(q);
        }
    });
    base = {}, next = {};
    // p sees q exactly if q, looked through backwards, sees p backwards.
    BitRows columns = transposed(reach, n, context);
    parallel_for(context, n, [&](std::size_t p) {
        constexpr std::uint64_t kEven = 0x5555555555555555ull;
        const std::uint64_t* column = columns.row(reversed(static_cast<std::uint32_t>(p)));
        for (std::size_t w = 0; w < reach.words(); ++w) reach.row(p)[w] &= (column[w] & kEven) << 1 | (column[w] >> 1 & kEven);
    });
    columns = {};
    return SparseRows(reach);
}

} // namespace kiln::vis
