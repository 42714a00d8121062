// Long proofs about the geometry, on whole maps and large random scenes. `prove --help`.
#include "tests/proof/geometry/laws.h"
#include "tests/proof/geometry/oracle.h"
#include "tests/proof/geometry/pipeline.h"
#include "tests/proof/geometry/scenes.h"
#include "tests/proof/geometry/shape.h"
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <iostream>

namespace kiln::proof {
namespace {

double seconds() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

bool say(const char* law, const Findings& f) {
    std::cout << "  " << (f.ok() ? "ok   " : "WRONG") << ' ' << law << ": " << f << '\n';
    return f.ok();
}

bool laws(const std::string& path, std::size_t points) {
    Context context;
    const std::optional<World> world = load_world(path, context);
    std::cout << std::filesystem::path(path).filename().string() << '\n';
    if (!world) {
        std::cout << "  no world in it\n";
        return true;
    }
    RunOptions options;
    options.last = "bsp";
    const Geometry filled = run(*world, options);
    if (filled.fault) {
        std::cout << "  " << to_text(filled.fault->diagnostic) << '\n';
        return true;
    }
    options.bsp.fill = false;
    const Geometry open = run(*world, options);
    bool ok = say("closure", closure(filled.world, filled.csg));
    ok &= say("volumes", volumes(open.csg, open.bsp));
    ok &= say("volumes, filled", volumes(filled.csg, filled.bsp));
    ok &= say("points in leaves", points_in_leaves(filled.world, filled.csg, filled.bsp, points, 1));
    ok &= say("portals", portals(open.csg, open.bsp));
    ok &= say("brush lists", brush_lists(filled.world, filled.csg, filled.bsp));
    // Where detail stands in a closed gap its own faces close it, which are not in this sum.
    if (!filled.leak && filled.count("micro-gap") == 0) ok &= say("inside is closed", inside_is_closed(filled.world, filled.csg, filled.bsp));
    return ok;
}

bool stages(const std::string& path) {
    const double start = seconds();
    Context context;
    const auto text = [&] {
        std::FILE* f = std::fopen(path.c_str(), "rb");
        std::string s;
        char buffer[65536];
        for (std::size_t n; (n = std::fread(buffer, 1, sizeof buffer, f)) > 0;) s.append(buffer, n);
        std::fclose(f);
        return s;
    }();
    const Geometry r = run_text(text, std::filesystem::path(path).filename().string());
    std::size_t unmatched = 0;
    if (r.stage == "surfaces")
        for (std::uint32_t m = 0; m < r.world.model_count; ++m) unmatched += unmatched_hull_edges(r.surfaces, {m});
    std::printf("%-52s %-8s %6.2f s %6zu brushes %3u invalid %5u merged (max %.4f) %3u kept %7zu fragments %6u clusters %5zu portals %4zu gaps %s unmatched %zu %s\n",
                std::filesystem::path(path).filename().c_str(), r.stage.c_str(), seconds() - start, r.world.brushes.size(),
                r.csg.report.invalid_brushes, r.csg.report.merged_planes, r.csg.report.largest_move, r.csg.report.kept_brushes,
                r.csg.fragments.size(), r.bsp.cluster_count, r.bsp.portals.size(), r.count("micro-gap"), r.leak ? "LEAK" : "sealed",
                unmatched, r.fault ? to_text(r.fault->diagnostic).c_str() : "");
    for (const Diagnostic& d : r.diagnostics)
        if (d.severity == Severity::error) std::printf("      %s\n", to_text(d).c_str());
    return true;
}

// How many fragments are how narrow, and how thin the open leaves get.
bool thin(const std::string& path) {
    Context context;
    const std::optional<World> world = load_world(path, context);
    if (!world) return true;
    RunOptions options;
    options.bsp.fill = false, options.last = "bsp";
    const Geometry g = run(*world, options);
    if (g.fault) return true;
    std::map<int, std::pair<std::size_t, double>> by_width;
    for (const Fragment& f : g.csg.fragments) {
        const std::vector<Vec3> p = points(g.csg.planes, f.polygon);
        const double width = polygon_width(p, g.csg.planes.normal(f.polygon.support));
        auto& [count, area] = by_width[width < 1.0 / 32 ? static_cast<int>(std::floor(std::log10(std::max(width, 1e-12)))) : 0];
        ++count, area += polygon_area(p);
    }
    std::printf("%s: thinnest leaf %.3g; fragments", std::filesystem::path(path).filename().c_str(), thinnest_leaf(g.bsp));
    for (const auto& [decade, sum] : by_width) {
        if (decade == 0) std::printf(", wider %zu", sum.first);
        else std::printf(", from 1e%d %zu (%.3g square units)", decade, sum.first, sum.second);
    }
    std::puts("");
    return true;
}

bool oracle(const World& world, const CsgOptions& csg, OraclePlanes planes, std::size_t stride) {
    RunOptions options;
    options.csg = csg, options.last = "csg";
    const double start = seconds();
    const Geometry g = run(world, options);
    if (g.fault) return false;
    std::printf("%zu brushes, %zu fragments in %.1f s\n", g.world.brushes.size(), g.csg.fragments.size(), seconds() - start);
    return say("closure", closure(g.world, g.csg)) & say("fragments by CGAL", compare_fragments(g.world, g.csg, planes, stride));
}

} // namespace
} // namespace kiln::proof

int main(int argc, char** argv) {
    using namespace kiln::proof;
    const std::string what = argc > 1 ? argv[1] : "";
    bool ok = true;
    if (what == "laws" && argc > 3) {
        for (int i = 3; i < argc; ++i) ok &= laws(argv[i], std::strtoull(argv[2], nullptr, 10));
    } else if (what == "stages") {
        for (int i = 2; i < argc; ++i) ok &= stages(argv[i]);
    } else if (what == "soup" && argc == 5) {
        // As many to a volume whatever their number, so that each meets a dozen others.
        const int count = std::atoi(argv[2]);
        const SoupOptions soup_options{.bits = 3, .range = 40 * std::cbrt(static_cast<double>(count)), .size = 60, .mixed = true};
        kiln::CsgOptions exact;
        exact.plane_merge_distance = 0;
        ok = oracle(soup(std::strtoull(argv[3], nullptr, 10), count, soup_options), exact, OraclePlanes::text, std::strtoull(argv[4], nullptr, 10));
    } else if (what == "turned" && argc == 5) {
        kiln::Context context;
        const auto world = load_world(argv[4], context);
        ok = world && oracle(turned(*world, std::atof(argv[2])), {}, OraclePlanes::csg, std::strtoull(argv[3], nullptr, 10));
    } else if (what == "thin") {
        for (int i = 2; i < argc; ++i) ok &= thin(argv[i]);
    } else {
        std::puts("usage: prove laws POINTS MAP...\n       prove stages MAP...\n       prove thin MAP...\n       prove soup BRUSHES SEED STRIDE\n       prove turned STEP STRIDE MAP");
        return 2;
    }
    return ok ? 0 : 1;
}
