// Times read, world, csg, bsp and surfaces on levels of growing size, or on given maps: CSV, a fit of time against
// brush count for each stage, and a chart.
#include "compiler/bsp/bsp.h"
#include "compiler/compile.h"
#include "compiler/surfaces/surfaces.h"
#include "formats/quake_map/quake_map.h"
#include "formats/vmf/vmf.h"
#include "libs/core/file.h"
#include "libs/core/process.h"
#include "tools/chart/chart.h"
#include "tools/geometry_bench/soups.h"
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

namespace kiln::bench {
namespace {

constexpr std::size_t kStages = 5;
constexpr const char* kStage[kStages] = {"read", "world", "csg", "bsp", "surfaces"};

struct Row { // plain: it comes back through a pipe
    bool good = false;
    double seconds[kStages] = {};
    double peak_mb = 0;
    std::uint64_t brushes = 0, fragments = 0, nodes = 0, leaves = 0, clusters = 0, portals = 0, visible = 0, faces = 0, triangles = 0, luxels = 0;
    double total() const {
        double sum = 0;
        for (const double s : seconds) sum += s;
        return sum;
    }
};

Row measure(const Bytes& text, const std::string& name, int threads, std::string& trouble) {
    Row row;
    Context context;
    context.threads = threads;
    std::size_t stage = 0;
    const auto timed = [&](auto&& make) {
        const double before = cpu_seconds();
        auto made = make();
        row.seconds[stage++] = cpu_seconds() - before;
        if (!made) throw std::runtime_error(to_text(made.fault().diagnostic));
        return *std::move(made);
    };
    try {
        const TextFile file{name, text};
        Document document = timed([&] { return is_vmf(file) ? read_vmf(text, name, context) : read_quake_map(text, name, context); });
        MaterialDatabase materials;
        const World world = timed([&] { return build_world(document, materials, {}, context); });
        document = {};
        const Csg csg = timed([&] { return build_csg(world, {}, context); });
        row.brushes = csg.brushes.size(), row.fragments = csg.fragments.size();
        const Bsp bsp = timed([&] { // as a build does: the leak test is part of it
            Result<Bsp> made = build_bsp(world, csg, {}, context);
            if (made && !find_leaks(world, csg, *made, {.allow_leaks = true}, context)) throw std::runtime_error("leak test");
            return made;
        });
        row.nodes = bsp.nodes.size(), row.leaves = bsp.leaves.size(), row.clusters = bsp.cluster_count, row.portals = bsp.portals.size(), row.visible = bsp.visible.size();
        SurfacesOptions options;
        options.most_texels = UINT32_MAX;
        const Surfaces surfaces = timed([&] { return build_surfaces(world, csg, bsp, options, context); });
        row.faces = surfaces.faces.size(), row.triangles = surfaces.triangles.size(), row.luxels = surfaces.luxels.size();
        row.good = true;
    } catch (const std::exception& e) {
        trouble = e.what();
    }
    row.peak_mb = peak_rss_mb();
    return row;
}

// In a process of its own, so that its peak of memory is its own.
Row measure_apart(const Bytes& text, const std::string& name, int threads) {
    int ends[2];
    if (pipe(ends) != 0) throw std::runtime_error("no pipe");
    std::fflush(nullptr);
    const pid_t child = fork();
    if (child < 0) throw std::runtime_error("no process");
    if (child == 0) {
        std::string trouble;
        const Row row = measure(text, name, threads, trouble);
        if (!row.good) fmt::print(stderr, "{}: {}\n", name, trouble);
        const bool sent = write(ends[1], &row, sizeof row) == static_cast<ssize_t>(sizeof row);
        std::fflush(nullptr);
        _exit(sent ? 0 : 1);
    }
    close(ends[1]);
    Row row;
    if (read(ends[0], &row, sizeof row) != static_cast<ssize_t>(sizeof row)) row = {};
    close(ends[0]);
    waitpid(child, nullptr, 0);
    return row;
}

// The fastest of some runs: what else the machine does only ever adds.
Row best_of(int repeat, const Bytes& text, const std::string& name, int threads) {
    Row best = measure_apart(text, name, threads);
    for (int i = 1; i < repeat && best.good; ++i) {
        const Row row = measure_apart(text, name, threads);
        for (std::size_t s = 0; s < kStages; ++s) best.seconds[s] = std::min(best.seconds[s], row.seconds[s]);
        best.peak_mb = std::min(best.peak_mb, row.peak_mb);
    }
    return best;
}

std::string csv_head() { return "map,brushes,read_s,world_s,csg_s,bsp_s,surfaces_s,total_s,peak_mb,fragments,nodes,clusters,portals,visible,faces,triangles,luxels\n"; }
std::string csv_line(const std::string& name, const Row& r) {
    std::string line = fmt::format("{},{}", name, r.brushes);
    for (const double s : r.seconds) line += fmt::format(",{:.4f}", s);
    return line + fmt::format(",{:.4f},{:.1f},{},{},{},{},{},{},{},{}\n", r.total(), r.peak_mb, r.fragments, r.nodes, r.clusters, r.portals, r.visible,
                              r.faces, r.triangles, r.luxels);
}

int run(int argc, char** argv) {
    CLI::App app{"Times the geometry stages (read, world, csg, bsp, surfaces) on levels made of numbers, from 100 brushes up, or on the maps\n"
                 "given: CSV on standard output, then the exponent of time against brush count for each stage (1: linear)."};
    std::vector<std::string> maps, kinds;
    double most = 100000, least = 100;
    bool brief = false;
    int repeat = 1, threads = 1;
    std::string csv_path, svg_path, write_path;
    app.add_option("MAP", maps, "Maps to time instead of made ones (.map, .vmf)");
    app.add_option("--kind", kinds, "Of boxes, turned, tumbled, city, tiles (default: all)")->check(CLI::IsMember(std::vector<std::string>(std::begin(kSoupNames), std::end(kSoupNames))));
    app.add_option("--min", least, "Fewest brushes")->check(CLI::Range(16.0, 1e7));
    app.add_option("--max", most, "Most brushes, in steps of a factor of 10^(1/2)")->check(CLI::Range(16.0, 1e7));
    app.add_flag("--short", brief, "Up to 3162 brushes: some seconds");
    app.add_option("--repeat", repeat, "Runs of which the fastest counts")->check(CLI::Range(1, 1000));
    app.add_option("--threads", threads, "Threads (seconds are of all threads together)")->check(CLI::Range(1, 256));
    app.add_option("--csv", csv_path, "Also write the CSV here");
    app.add_option("--svg", svg_path, "Write a chart here");
    app.add_option("--write-maps", write_path, "Write the made maps into this folder and do nothing else");
    CLI11_PARSE(app, argc, argv);
    if (brief) most = std::min(most, 3163.0);

    std::string csv = csv_head();
    bool good = true;
    const auto keep = [&](const std::string& name, const Row& row) {
        good = good && row.good;
        csv += csv_line(name, row);
        fmt::print("{}", csv_line(name, row));
        std::fflush(stdout);
    };
    std::vector<Panel> panels;
    if (write_path.empty()) fmt::print("{}", csv_head());
    for (const std::string& path : maps) {
        const auto bytes = read_file(path);
        if (!bytes) throw std::runtime_error(to_text(bytes.fault().diagnostic));
        keep(std::filesystem::path(path).filename().string(), best_of(repeat, *bytes, path, threads));
    }
    for (std::size_t k = 0; maps.empty() && k < std::size(kSoupNames); ++k) {
        if (!kinds.empty() && std::ranges::find(kinds, kSoupNames[k]) == kinds.end()) continue;
        Panel panel{kSoupNames[k], {}, {"brushes"}, {"CPU seconds, one thread"}, {}};
        for (const char* stage : kStage) panel.series.push_back({.name = stage, .x = {}, .y = {}, .join = Join::fit});
        panel.series.push_back({.name = "all", .x = {}, .y = {}, .join = Join::fit});
        for (double count = least; count < most * 1.01; count *= std::sqrt(10.0)) {
            const std::string text = make_map(static_cast<Soup>(k), static_cast<std::size_t>(std::lround(count)));
            if (!write_path.empty()) {
                const std::string path = fmt::format("{}/{}_{}.map", write_path, kSoupNames[k], std::lround(count));
                if (const auto written = write_file(path, text); !written) throw std::runtime_error(to_text(written.fault().diagnostic));
                continue;
            }
            const Row row = best_of(repeat, Bytes(text.begin(), text.end()), kSoupNames[k], threads);
            keep(kSoupNames[k], row);
            if (!row.good) break;
            for (std::size_t s = 0; s <= kStages; ++s) {
                panel.series[s].x.push_back(static_cast<double>(row.brushes));
                panel.series[s].y.push_back(std::max(1e-4, s < kStages ? row.seconds[s] : row.total())); // the clock's own step
            }
        }
        panels.push_back(std::move(panel));
    }
    for (const Panel& p : panels)
        for (const Series& s : p.series)
            if (s.x.size() > 1) fmt::print("# {} {}: time ~ brushes^{:.3f}\n", p.title, s.name, fit_power(s.x, s.y).exponent);
    const auto write = [&](const std::string& path, const std::string& text) {
        if (path.empty()) return;
        if (const auto written = write_file(path, text); !written) throw std::runtime_error(to_text(written.fault().diagnostic));
    };
    write(csv_path, csv);
    if (!panels.empty()) write(svg_path, draw_svg("Geometry: time against brush count", panels, true));
    return good ? 0 : 1;
}

} // namespace
} // namespace kiln::bench

int main(int argc, char** argv) {
    try {
        return kiln::bench::run(argc, argv);
    } catch (const std::exception& e) {
        fmt::print(stderr, "kiln_bench_geometry: {}\n", e.what());
        return 1;
    }
}
