// Long proofs about light; their short forms are in the test suite. usage: prove_light leaks|seams [PART OF A NAME [LUXEL ERROR, PERCENT]]
#include "tests/proof/light/leaks.h"
#include "tests/proof/light/seams.h"
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace {
bool leaks(const char* part) {
    constexpr double kSizes[] = {4, 8, 16, 32, 64}, kMost = 1e-6;
    std::size_t maps = 0, runs = 0, bad = 0;
    std::printf("%-42s %5s %9s %9s %9s %9s %8s\n", "map", "luxel", "shown", "luxels", "patches", "cubes", "lookups");
    for (const kiln::proof::LeakMap& m : kiln::proof::leak_maps()) {
        if (m.name.find(part) == std::string::npos) continue;
        ++maps;
        for (const double size : kSizes) {
            const kiln::proof::LeakFound f = kiln::proof::find_leaks(m, size, 20);
            const bool ok = f.compiled && f.looked > 0 && f.worst() <= kMost;
            ++runs, bad += !ok;
            std::printf("%-42s %5g %9.2g %9.2g %9.2g %9.2g %8zu%s\n", m.name.c_str(), size, f.shown, f.luxel, f.patch, f.cube, f.looked,
                        ok ? "" : ("  LEAK " + (f.compiled ? f.where + (f.cube > kMost ? (f.where.empty() ? "" : "; ") + f.cube_where : "") : std::string("does not compile"))).c_str());
            std::fflush(stdout);
        }
    }
    std::printf("%zu maps, %zu bakes, %zu leak\n", maps, runs, bad);
    return maps > 0 && bad == 0;
}
bool seams(const char* part, double luxel_error) {
    constexpr double kP99 = 0.005, kMost = 0.02;
    std::size_t maps = 0, bad = 0;
    std::printf("%-56s %7s %9s %9s %9s %9s %s\n", "map: how both sides differ, per cent", "points", "flat p99", "flat max", "leaning99", "leaningmax", "texels");
    for (const kiln::proof::SeamMap& m : kiln::proof::seam_maps()) {
        if (m.name.find(part) == std::string::npos) continue;
        const kiln::proof::SeamsFound f = kiln::proof::find_seams_shown(m, 5, kiln::RnmEncoding::dot, 1, luxel_error);
        const bool ok = f.compiled && std::max(f.flat_p99, f.leaning_p99) < kP99 && std::max(f.flat_most, f.leaning_most) < kMost && f.dark <= 1e-6;
        ++maps, bad += !ok;
        std::printf("%-56s %7zu %9.3f %9.3f %9.3f %9.3f %6zu/%zu%s\n", m.name.c_str(), f.points, 100 * f.flat_p99, 100 * f.flat_most, 100 * f.leaning_p99,
                    100 * f.leaning_most, f.texels, f.texels_baked, ok ? "" : ("  SEAM " + (f.compiled ? f.where : std::string("does not compile"))).c_str());
        std::fflush(stdout);
    }
    std::printf("%zu maps, %zu show seams\n", maps, bad);
    return maps > 0 && bad == 0;
}
} // namespace

int main(int argc, char** argv) {
    if (argc > 1 && !std::strcmp(argv[1], "leaks")) return leaks(argc > 2 ? argv[2] : "") ? 0 : 1;
    if (argc > 1 && !std::strcmp(argv[1], "seams")) return seams(argc > 2 ? argv[2] : "", argc > 3 ? std::atof(argv[3]) : -1) ? 0 : 1;
    std::puts("usage: prove_light leaks|seams [PART OF A NAME [LUXEL ERROR, PERCENT]]");
    return 2;
}
