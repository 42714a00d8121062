// Long proofs about visibility; their short forms are in the test suite.
#include "tests/proof/geometry/pipeline.h"
#include "tests/proof/visibility/sightlines.h"
#include "tools/chart/chart.h"
#include "libs/core/file.h"
#include "libs/core/process.h"
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <bit>
#include <deque>
#include <filesystem>
#include <functional>
#include <queue>
#include <thread>
#include <tuple>

using namespace kiln;

namespace {

constexpr const char* kMaps[] = {"id-quake-map-source/e1m1.map", "id-quake-map-source/start.map", "librequake/lq_e1m5.map", "athwale-hammer/lambda_bunker_v2.vmf",
                                 "laurirasanen-mapsrc/box13.vmf", "alexwnovak-tf2maps/EyeOfHorus.vmf", "bagnaram-halflife-maps/dm_citystreet.vmf"};

// 1: refuted, 2: not tried.
int prove(const std::string& path, std::uint64_t rays) {
    const std::string name = std::filesystem::path(path).stem().string();
    const auto bytes = read_file(path);
    if (!bytes) return std::printf("%-20s cannot be read\n", name.c_str()), 2;
    proof::RunOptions options{.csg = {}, .bsp = {}, .last = "bsp", .threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()))};
    const proof::Geometry g = proof::run_text({reinterpret_cast<const char*>(bytes->data()), bytes->size()}, path, options);
    if (g.stage != "bsp") return std::printf("%-20s %s\n", name.c_str(), g.fault ? g.fault->diagnostic.message.c_str() : "has no tree"), 2;
    Context context;
    context.threads = options.threads;
    const std::vector<VisPortal> portals = vis_portals(g.bsp);
    const double begin = cpu_seconds();
    const auto v = compute_visibility(portals, g.bsp.cluster_count, {}, context);
    if (!v) return std::printf("%-20s %s\n", name.c_str(), v.fault().diagnostic.message.c_str()), 1;
    const double computed = cpu_seconds();
    const proof::Sightlines s = proof::find_sightlines(g.bsp, portals, *v, rays, 1, context);
    std::printf("%-20s %7u %8zu %9.1f %9.1f %7.3f %8.1f %12llu %14llu %8llu %7.0f%s\n", name.c_str(), v->cluster_count, portals.size(), static_cast<double>(s.seen) / std::max(1u, v->cluster_count),
                static_cast<double>(s.proven) / std::max(1u, v->cluster_count), s.excess(), computed - begin, static_cast<unsigned long long>(s.rays), static_cast<unsigned long long>(s.pairs_checked),
                static_cast<unsigned long long>(s.missing), cpu_seconds() - computed, g.leak ? "  (leaks)" : "");
    for (const proof::Miss& m : s.misses)
        std::printf("    clusters %u and %u: %.17g %.17g %.17g to %.17g %.17g %.17g\n", m.from, m.to, m.a.x, m.a.y, m.a.z, m.b.x, m.b.y, m.b.z);
    std::fflush(stdout);
    return s.missing != 0;
}

// ---- What the stage costs for what it leaves too much: flood, budgets of steps, the whole flow; CSV and SVG.

// Seconds of the waves on so many threads: whoever is free takes what waits first, the parts of a way wait before all others once the
// last of those before them has ended, and a wave ends with its last.
double schedule(const std::vector<VisibilityRun::WaveTimes>& waves, std::size_t threads) {
    struct Running {
        double end;
        std::size_t way, round;
        bool operator>(const Running& o) const { return std::tie(end, way) > std::tie(o.end, o.way); }
    };
    double total = 0;
    for (const VisibilityRun::WaveTimes& wave : waves) {
        std::deque<Running> waiting; // with how long they take
        std::priority_queue<Running, std::vector<Running>, std::greater<>> running;
        std::vector<std::size_t> open(wave.size());
        for (std::size_t i = 0; i < wave.size(); ++i) {
            open[i] = wave[i].front().size();
            for (const double seconds : wave[i].front()) waiting.push_back({seconds, i, 0});
        }
        double now = 0;
        while (!waiting.empty() || !running.empty()) {
            for (; !waiting.empty() && running.size() < threads; waiting.pop_front()) running.push({now + waiting.front().end, waiting.front().way, waiting.front().round});
            const Running done = running.top();
            running.pop(), now = done.end;
            if (--open[done.way] || done.round + 1 == wave[done.way].size()) continue;
            const std::vector<double>& next = wave[done.way][done.round + 1];
            open[done.way] = next.size();
            for (auto seconds = next.rbegin(); seconds != next.rend(); ++seconds) waiting.push_front({*seconds, done.way, done.round + 1});
        }
        total += now;
    }
    return total;
}

bool chart(const std::string& folder, std::uint64_t rays, const std::vector<std::string>& maps) {
    std::string csv = "map,clusters,portals,mode,cpu_s,steps,pairs,proven,excess,missing,waves_speedup_2,waves_speedup_8,waves_speedup_32\n";
    std::vector<bench::Panel> panels;
    for (const std::string& path : maps) {
        const std::string name = std::filesystem::path(path).stem().string();
        const auto bytes = read_file(path);
        if (!bytes) return std::printf("%s cannot be read\n", path.c_str()), false;
        const proof::Geometry g = proof::run_text({reinterpret_cast<const char*>(bytes->data()), bytes->size()}, path, {.csg = {}, .bsp = {}, .last = "bsp", .threads = 1});
        if (g.stage != "bsp") { // of a map that does not compile there is nothing to show
            std::printf("%s is left out: %s\n", path.c_str(), g.fault ? g.fault->diagnostic.message.c_str() : "it has no tree");
            continue;
        }
        const std::vector<VisPortal> portals = vis_portals(g.bsp);
        Context context;
        const auto whole = compute_visibility(portals, g.bsp.cluster_count, {}, context);
        if (!whole) return false;
        const proof::Sightlines lines = proof::find_sightlines(g.bsp, portals, *whole, rays, 1, context);
        const auto proven = static_cast<double>(std::max<std::uint64_t>(1, lines.proven));
        bench::Panel panel{name, {}, {.label = "CPU seconds"}, {.label = "pairs marked, less 1 of those proven", .least = 1e-3}};
        bench::Series fast, cut, full;
        fast.name = "flood", cut.name = "budget of steps", full.name = "whole flow";
        fast.join = full.join = bench::Join::none;
        const auto measure = [&](const VisibilityOptions& options, const char* mode, bench::Series& series) {
            std::vector<VisibilityRun::WaveTimes> waves;
            const double begin = cpu_seconds();
            const auto v = compute_visibility(portals, g.bsp.cluster_count, options, context, {.waves = &waves});
            const double cpu = cpu_seconds() - begin;
            std::uint64_t pairs = 0, lost = 0;
            for (std::size_t w = 0; w < v->rows.size(); ++w) pairs += static_cast<std::uint64_t>(std::popcount(v->rows[w]));
            const double one = schedule(waves, 1), excess = static_cast<double>(pairs) / proven;
            const auto speedup = [&](std::size_t threads) { return one > 0 ? one / schedule(waves, threads) : 1; };
            if (mode == std::string("full")) lost = lines.missing;
            const std::string row = std::string(name) + "," + std::to_string(v->cluster_count) + "," + std::to_string(portals.size()) + "," + mode + "," + std::to_string(cpu) + "," + std::to_string(v->steps) + "," + std::to_string(pairs) + "," +
                                    std::to_string(lines.proven) + "," + std::to_string(excess) + "," + std::to_string(lost) + "," + std::to_string(speedup(2)) + "," + std::to_string(speedup(8)) + "," + std::to_string(speedup(32)) + "\n";
            std::printf("%s", row.c_str()), std::fflush(stdout);
            csv += row;
            series.x.push_back(std::max(cpu, 1e-4)), series.y.push_back(excess - 1);
        };
        measure({.fast = true}, "fast", fast);
        for (const std::uint64_t part : {5, 15, 40}) measure({.total_budget = std::max<std::uint64_t>(1, whole->steps * part / 100)}, ("budget " + std::to_string(part) + " %").c_str(), cut);
        measure({}, "full", full);
        panel.series = {fast, cut, full};
        panels.push_back(std::move(panel));
        if (lines.missing) return std::printf("%s: %llu pairs are missing\n", name.c_str(), static_cast<unsigned long long>(lines.missing)), false;
    }
    if (panels.empty()) return false;
    std::filesystem::create_directories(folder);
    return write_file(folder + "/visibility.csv", csv) && write_file(folder + "/visibility.svg", bench::draw_svg("Visibility: time against what is marked too much", panels));
}

} // namespace

int main(int argc, char** argv) {
    char* end = nullptr;
    const bool charts = argc > 1 && !std::strcmp(argv[1], "visibility-chart");
    const std::uint64_t rays = argc > 2 ? std::strtoull(argv[2], &end, 10) : 0;
    if (argc < 3 || (!charts && std::strcmp(argv[1], "visibility") != 0) || *end || rays == 0 || (charts && argc < 4))
        return std::puts("usage: prove_visibility visibility RAYS [MAP...]\n       prove_visibility visibility-chart RAYS FOLDER [MAP...]"), 2;
    std::vector<std::string> maps(argv + (charts ? 4 : 3), argv + argc);
    if (maps.empty())
        for (const char* name : kMaps)
            if (const auto path = proof::shared_map(name)) maps.push_back(*path);
    if (charts && argc == 4)
        for (const char* name : {"librequake/lqdm1.map", "spirit-quake-maps/spirit2dm7.map", "tgs-archive/parable_comp_real.vmf"})
            if (const auto path = proof::shared_map(name)) maps.push_back(*path);
    if (maps.empty()) return std::puts("no maps are at hand"), 2;
    if (charts) return chart(argv[3], rays, maps) ? 0 : 1;
    std::printf("%-20s %7s %8s %9s %9s %7s %8s %12s %14s %8s %7s\n", "map", "cluster", "portals", "seen", "proven", "excess", "vis cpu", "rays", "pairs", "missing", "ray cpu");
    bool failed = false;
    for (const std::string& map : maps) failed = prove(map, rays) == 1 || failed;
    return failed;
}
