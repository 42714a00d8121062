#include "tests/compiler/visibility/grid_map.h"
#include <cmath>

namespace kiln::test {

GridMap grid_map(const std::vector<std::string>& rows, bool runs, bool turn, double cell) {
    GridMap m;
    m.height = static_cast<int>(rows.size());
    m.width = static_cast<int>(rows[0].size());
    for (int y = 0; y < m.height; ++y)
        for (int x = 0; x < m.width; ++x) {
            const auto& row = rows[static_cast<std::size_t>(y)];
            const auto open = [&](int i) { return i >= 0 && row[static_cast<std::size_t>(i)] != '#'; };
            if (!open(x))
                m.cluster.push_back(-1);
            else if (runs && open(x - 1))
                m.cluster.push_back(m.cluster.back());
            else
                m.cluster.push_back(static_cast<int>(m.cluster_count++));
        }
    const Frame frame{normalize(Vec3{3, 1, 1}), {}, {}};
    const Vec3 b = normalize(cross(Vec3{1, 5, 2}, frame.t)), n = cross(frame.t, b);
    const auto place = [&](double x, double y, double z) {
        return turn ? frame.t * x + b * y + n * z + Vec3{100.5, -33.25, 7} : Vec3{x, y, z};
    };
    const double h = 96;
    for (int y = 0; y < m.height; ++y)
        for (int x = 0; x < m.width; ++x) {
            const int here = m.at(x, y), right = m.at(x + 1, y), below = m.at(x, y + 1);
            const double x0 = x * cell, y0 = y * cell, x1 = x0 + cell, y1 = y0 + cell;
            // Counter-clockwise seen from the front cluster, which is `here`.
            if (here >= 0 && right >= 0 && right != here)
                m.portals.push_back({static_cast<std::uint32_t>(here), static_cast<std::uint32_t>(right),
                                     {place(x1, y0, 0), place(x1, y0, h), place(x1, y1, h), place(x1, y1, 0)}});
            if (here >= 0 && below >= 0 && below != here)
                m.portals.push_back({static_cast<std::uint32_t>(here), static_cast<std::uint32_t>(below),
                                     {place(x0, y1, 0), place(x1, y1, 0), place(x1, y1, h), place(x0, y1, h)}});
        }
    return m;
}

std::vector<std::string> random_rows(std::mt19937& random, int width, int height, double solid_share) {
    std::vector<std::string> rows(static_cast<std::size_t>(height), std::string(static_cast<std::size_t>(width), '.'));
    for (std::string& row : rows)
        for (char& c : row)
            if (static_cast<double>(random() % 1000) < solid_share * 1000) c = '#';
    return rows;
}

std::vector<std::string> rooms(std::mt19937& random, int across, int down) {
    std::vector<std::string> rows(static_cast<std::size_t>(down * 6), std::string(static_cast<std::size_t>(across * 6), '.'));
    for (std::size_t y = 0; y < rows.size(); ++y)
        for (std::size_t x = 0; x < rows[y].size(); ++x) {
            if (y % 6 == 0 || x % 6 == 0) rows[y][x] = '#';
            else if (random() % 8 == 0) rows[y][x] = '#';
        }
    for (int r = 0; r < down; ++r)
        for (int c = 0; c < across; ++c) {
            rows[static_cast<std::size_t>(r * 6)][static_cast<std::size_t>(c * 6) + 1 + random() % 5] = '.';
            rows[static_cast<std::size_t>(r * 6) + 1 + random() % 5][static_cast<std::size_t>(c * 6)] = '.';
        }
    return rows;
}

std::vector<char> proven_pairs(const GridMap& m, std::mt19937& random, int rays) {
    std::vector<char> seen(std::size_t{m.cluster_count} * m.cluster_count, 0);
    std::uniform_real_distribution<double> unit(0, 1);
    std::vector<int> chain;
    for (int i = 0; i < rays; ++i) {
        const double x = unit(random) * m.width, y = unit(random) * m.height, angle = unit(random) * 6.283185307179586;
        const double dx = std::cos(angle), dy = std::sin(angle);
        int cx = static_cast<int>(x), cy = static_cast<int>(y);
        chain.clear();
        double tx = dx > 0 ? (cx + 1 - x) / dx : (cx - x) / dx, ty = dy > 0 ? (cy + 1 - y) / dy : (cy - y) / dy;
        while (m.at(cx, cy) >= 0) {
            if (chain.empty() || chain.back() != m.at(cx, cy)) chain.push_back(m.at(cx, cy));
            if (std::abs(tx - ty) < 1e-9) break; // through a corner: proves nothing
            if (tx < ty)
                cx += dx > 0 ? 1 : -1, tx += 1 / std::abs(dx);
            else
                cy += dy > 0 ? 1 : -1, ty += 1 / std::abs(dy);
        }
        // Every later cell is seen from every earlier one along the ray.
        for (std::size_t a = 0; a < chain.size(); ++a)
            for (std::size_t b = a; b < chain.size(); ++b) {
                const auto p = static_cast<std::size_t>(chain[a]), q = static_cast<std::size_t>(chain[b]);
                seen[p * m.cluster_count + q] = seen[q * m.cluster_count + p] = 1;
            }
    }
    return seen;
}

} // namespace kiln::test
