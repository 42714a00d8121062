// Charts of what did not change stay as they are when something else in the map does: a cache by chart can keep its light.
#include "formats/quake_map/quake_map.h"
#include "libs/core/file.h"
#include "tests/compiler/surfaces/build.h"
#include <filesystem>
#include <map>
#include <random>

namespace kiln {
namespace {

using namespace test;

// All that places a chart's luxels; not its number, nor where its texels are stored.
Bytes content(const Chart& c) {
    ByteWriter w;
    w(c.origin, c.s, c.t, c.n, c.frame, c.luxel_size, c.width, c.height, c.smooth);
    return w.bytes;
}
std::map<Bytes, int> charts_of(const World& world) {
    std::map<Bytes, int> charts;
    for (const Chart& c : build(world).surfaces.charts) ++charts[content(c)];
    return charts;
}

// The same world with a box of six sides before or after all other brushes.
World with_box(const World& world, Vec3 lo, Vec3 hi, bool at_start) {
    WorldBuilder extra;
    extra.box(lo, hi);
    World out = world;
    WorldBrush brush = extra.world.brushes[0];
    std::vector<WorldSide> sides(extra.world.sides.begin(), extra.world.sides.end());
    for (WorldSide& s : sides) s.lightmap_scale = 8;
    brush.first_side = at_start ? 0 : static_cast<std::uint32_t>(out.sides.size());
    out.sides.insert(at_start ? out.sides.begin() : out.sides.end(), sides.begin(), sides.end());
    if (at_start)
        for (WorldBrush& b : out.brushes) b.first_side += 6;
    out.brushes.insert(at_start ? out.brushes.begin() : out.brushes.end(), brush);
    for (WorldOverlay& o : out.overlays)
        for (SideId& s : o.sides)
            if (at_start) s.value += 6;
    return out;
}

// Every chart of `before` is in `after`; beside them there are `more`.
void expect_kept(const std::map<Bytes, int>& before, const std::map<Bytes, int>& after, int more) {
    int lost = 0, all_before = 0, all_after = 0;
    for (const auto& [chart, n] : before) {
        const auto it = after.find(chart);
        lost += std::max(0, n - (it == after.end() ? 0 : it->second));
        all_before += n;
    }
    for (const auto& [chart, n] : after) all_after += n;
    EXPECT_EQ(lost, 0) << "of " << all_before;
    EXPECT_EQ(all_after, all_before + more);
}

TEST(StableCharts, AnUnrelatedBrushChangesNoOtherChart) {
    for (std::uint64_t seed = 1; seed <= 12; ++seed) {
        std::mt19937_64 rng(seed);
        const auto whole = [&](int lo, int hi) { return static_cast<double>(lo + static_cast<int>(rng() % static_cast<std::uint64_t>(hi - lo))); };
        WorldBuilder b;
        sealed_room(b, {0, 0, 0}, {512, 512, 256});
        b.world.entities.back().origin = {500, 500, 250};
        for (int i = 0; i < 25; ++i) { // below z = 160; half of them off the grid
            const double off = i % 2 ? 1.0 / 3 : 0;
            const Vec3 at{whole(8, 400) + off, whole(8, 400), whole(-8, 80) + off / 7};
            if (i % 3) {
                b.box(at, at + Vec3{whole(8, 80), whole(8, 80), whole(8, 60)}, i % 5 ? Contents::solid : Contents::detail);
            } else {
                b.tetrahedron({at, at + Vec3{whole(10, 60), whole(-9, 9), 3}, at + Vec3{whole(-9, 9), whole(10, 60), 5}, at + Vec3{whole(-9, 9), 4, whole(10, 60)}});
            }
        }
        for (std::size_t i = 0; i < b.world.sides.size(); ++i) b.world.sides[i].lightmap_scale = i % 4 ? 16 : 24;
        const std::map<Bytes, int> before = charts_of(b.world);
        for (const bool at_start : {false, true}) expect_kept(before, charts_of(with_box(b.world, {200, 200, 200}, {216.5, 232, 208}, at_start)), 6);
    }
}

TEST(StableCharts, InARealMap) {
    const std::string path = std::string(KILN_SOURCE_DIR) + "/../shared/maps/id-quake-map-source/e1m1.map";
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "no maps at " << path;
    Context context;
    const Result<Document> document = read_quake_map(*read_file(path), path, context);
    ASSERT_TRUE(document);
    MaterialDatabase materials;
    const Result<World> world = build_world(*document, materials, {}, context);
    ASSERT_TRUE(world);
    Vec3 start{};
    for (const WorldEntity& e : world->entities)
        if (e.get("classname") == "info_player_start") start = e.origin;
    const std::map<Bytes, int> before = charts_of(*world);
    EXPECT_GT(before.size(), 1000u);
    for (const bool at_start : {false, true}) expect_kept(before, charts_of(with_box(*world, start + Vec3{-4, 24, 8}, start + Vec3{4, 32, 16}, at_start)), 6);
}

} // namespace
} // namespace kiln
